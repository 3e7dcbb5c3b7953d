/* Views as objects: memory, and the three classes. */
#include "view.h"
#include "decode.h"

PyTypeObject *View, *RecordView, *ChoiceView, *ListView;

enum { KEPT = 64 };
static view *spare[KEPT];
static int spare_count;

static PyTypeObject *class_for(const shape *shape)
{
    return shape->op == OP_SEQUENCE ? RecordView : shape->op == OP_LIST ? ListView : ChoiceView;
}

PyObject *view_new(const shape *shape, const unsigned char *value, storage *storage)
{
    view *new = spare_count > 0 ? spare[--spare_count] : PyObject_Malloc(sizeof *new);
    if (new == NULL)
        return PyErr_NoMemory();
    PyObject_Init((PyObject *)new, class_for(shape));
    new->shape = shape;
    new->value = value;
    new->storage = storage_hold(storage);
    return (PyObject *)new;
}

static void view_dealloc(PyObject *self)
{
    PyTypeObject *class = Py_TYPE(self);
    storage_release(((view *)self)->storage);
    if (spare_count < KEPT)
        spare[spare_count++] = (view *)self;
    else
        PyObject_Free(self);
    Py_DECREF(class);
}

PyObject *view_value(const shape *shape, const unsigned char *value, storage *storage)
{
    if (shape->op < OP_SEQUENCE)
        return quick_value(shape, value);
    if (shape->op != OP_OPEN)
        return view_new(shape, value, storage);
    const captain_open *open = (const captain_open *)(const void *)value;
    const struct shape *inner = open_shape(shape, open);
    return inner == NULL ? octets_value(open->octets) : view_value(inner, open->value, storage);
}

const view *view_check(PyObject *object)
{
    PyTypeObject *class = Py_TYPE(object);
    return class == RecordView || class == ChoiceView || class == ListView ? (const view *)object : NULL;
}

/* ---------------------------------------------------------------- classes */

static PyObject *to_dict(PyObject *self, PyObject *unused)
{
    (void)unused;
    return python_value(((view *)self)->shape, ((view *)self)->value);
}

static PyObject *refuse_new(PyTypeObject *class, PyObject *arguments, PyObject *names)
{
    (void)class, (void)arguments, (void)names;
    PyErr_SetString(PyExc_TypeError, "views come from Message.view");
    return NULL;
}

#define TO_DICT {"to_dict", to_dict, METH_NOARGS, "The value as Message.decode gives it."}
static PyMethodDef VIEW_METHODS[] = {TO_DICT, {0}};
static PyMethodDef RECORD_METHODS[] = {TO_DICT, {"__dir__", record_dir, METH_NOARGS, NULL}, {0}};
static PyGetSetDef CHOICE_MEMBERS[] = {
    {"choice", choice_choice, NULL, "Name of the alternative.", NULL},
    {"value", choice_value, NULL, "Value of the alternative.", NULL},
    {0},
};

#define COMMON                                                                                                             \
    {Py_tp_dealloc, view_dealloc}, {Py_tp_repr, view_repr}, {Py_tp_richcompare, view_compare},                             \
        {Py_tp_hash, PyObject_HashNotImplemented}, {Py_tp_new, refuse_new}

static PyType_Slot VIEW_SLOTS[] = {COMMON, {Py_tp_methods, VIEW_METHODS},
                                   {Py_tp_doc, "A part of a message, whose values are made when they are touched."}, {0}};
static PyType_Slot RECORD_SLOTS[] = {COMMON, {Py_tp_methods, RECORD_METHODS}, {Py_tp_getattro, record_getattro},
                                     {Py_tp_doc, "A SEQUENCE: its components are attributes; absent ones are None."}, {0}};
static PyType_Slot CHOICE_SLOTS[] = {COMMON, {Py_tp_getset, CHOICE_MEMBERS},
                                     {Py_tp_doc, "A CHOICE: the name and the value of its alternative."}, {0}};
static PyType_Slot LIST_SLOTS[] = {COMMON, {Py_sq_length, list_length}, {Py_sq_item, list_item},
                                   {Py_mp_length, list_length}, {Py_mp_subscript, list_subscript},
                                   {Py_tp_doc, "A SEQUENCE OF: a sequence."}, {0}};

#define SPEC(class, table, flag) \
    {.name = "captain_messages." class, .basicsize = (int)sizeof(view), .flags = Py_TPFLAGS_DEFAULT | flag, .slots = table}
static PyType_Spec VIEW_SPEC = SPEC("View", VIEW_SLOTS, Py_TPFLAGS_BASETYPE);
static PyType_Spec RECORD_SPEC = SPEC("RecordView", RECORD_SLOTS, 0);
static PyType_Spec CHOICE_SPEC = SPEC("ChoiceView", CHOICE_SLOTS, 0);
static PyType_Spec LIST_SPEC = SPEC("ListView", LIST_SLOTS, 0);

static PyTypeObject *add(PyObject *module, PyType_Spec *spec, const char *name, PyTypeObject *base)
{
    PyObject *bases = base == NULL ? NULL : PyTuple_Pack(1, base);
    PyObject *class = PyType_FromSpecWithBases(spec, bases);
    Py_XDECREF(bases);
    if (class != NULL && PyModule_AddObjectRef(module, name, class) < 0)
        Py_CLEAR(class);
    return (PyTypeObject *)class;
}

/* A list is what typing and match take for a sequence. */
static bool register_sequence(void)
{
    PyObject *abc = PyImport_ImportModule("collections.abc");
    PyObject *sequence = abc == NULL ? NULL : PyObject_GetAttrString(abc, "Sequence");
    PyObject *done = sequence == NULL ? NULL : PyObject_CallMethod(sequence, "register", "O", (PyObject *)ListView);
    Py_XDECREF(abc);
    Py_XDECREF(sequence);
    Py_XDECREF(done);
    return done != NULL;
}

bool views_add(PyObject *module)
{
    if ((View = add(module, &VIEW_SPEC, "View", NULL)) == NULL)
        return false;
    RecordView = add(module, &RECORD_SPEC, "RecordView", View);
    ChoiceView = add(module, &CHOICE_SPEC, "ChoiceView", View);
    ListView = add(module, &LIST_SPEC, "ListView", View);
    return RecordView != NULL && ChoiceView != NULL && ListView != NULL && register_sequence();
}

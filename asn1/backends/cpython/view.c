/* Classes of views, and their memory. */
#include "view.h"

PyObject *value_name;
PyTypeObject *View;
view_class view_classes[3];

view *view_allocate(view_class *class)
{
    view *new = PyObject_Malloc(sizeof *new);
    if (new == NULL)
        return (view *)PyErr_NoMemory();
    return (view *)PyObject_Init((PyObject *)new, class->class);
}

static void view_dealloc(PyObject *self)
{
    view *view = (struct view *)self;
    view_class *class = &view_classes[view->shape->op - OP_SEQUENCE];
    storage_release(view->storage);
    if (class->spare_count < VIEWS_KEPT) {
        class->spare[class->spare_count++] = view;
        return;
    }
    PyObject_Free(self);
    Py_DECREF(class->class);
}

PyObject *view_open(const shape *shape, const unsigned char *value, storage *storage)
{
    const captain_open *open = &AT(captain_open, value);
    const struct shape *inner = open_shape(shape, open);
    return inner == NULL ? octets_value(open->octets) : view_value(inner, open->value, storage);
}

const view *view_check(PyObject *object)
{
    for (size_t index = 0; index < sizeof view_classes / sizeof *view_classes; index++)
        if (Py_TYPE(object) == view_classes[index].class)
            return (const view *)(const void *)object;
    return NULL;
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
static PyType_Slot CHOICE_SLOTS[] = {COMMON, {Py_tp_getset, CHOICE_MEMBERS}, {Py_tp_getattro, choice_getattro},
                                     {Py_tp_doc, "A CHOICE: the name and the value of its alternative."}, {0}};
static PyType_Slot LIST_SLOTS[] = {COMMON, {Py_sq_length, list_length}, {Py_sq_item, list_item},
                                   {Py_mp_length, list_length}, {Py_mp_subscript, list_subscript},
                                   {Py_tp_doc, "A SEQUENCE OF: a sequence."}, {0}};

/* Immutable classes: a view whose class is changed would read its struct as another type. */
#define FIXED Py_TPFLAGS_IMMUTABLETYPE
#define SPEC(class, table, flag) \
    {.name = "captain_messages." class, .basicsize = (int)sizeof(view), .flags = Py_TPFLAGS_DEFAULT | FIXED | flag, .slots = table}
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

/* Register a list as a Sequence, for typing and match. */
static bool register_sequence(PyTypeObject *class)
{
    PyObject *abc = PyImport_ImportModule("collections.abc");
    PyObject *sequence = abc == NULL ? NULL : PyObject_GetAttrString(abc, "Sequence");
    PyObject *done = sequence == NULL ? NULL : PyObject_CallMethod(sequence, "register", "O", (PyObject *)class);
    Py_XDECREF(abc);
    Py_XDECREF(sequence);
    Py_XDECREF(done);
    return done != NULL;
}

bool views_add(PyObject *module)
{
    view_class *records = &view_classes[0], *choices = &view_classes[OP_CHOICE - OP_SEQUENCE];
    view_class *lists = &view_classes[OP_LIST - OP_SEQUENCE];
    value_name = PyUnicode_InternFromString("value");
    if (value_name == NULL || (View = add(module, &VIEW_SPEC, "View", NULL)) == NULL)
        return false;
    records->class = add(module, &RECORD_SPEC, "RecordView", View);
    choices->class = add(module, &CHOICE_SPEC, "ChoiceView", View);
    lists->class = add(module, &LIST_SPEC, "ListView", View);
    return records->class != NULL && choices->class != NULL && lists->class != NULL && register_sequence(lists->class);
}

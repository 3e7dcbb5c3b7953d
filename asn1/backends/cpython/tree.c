/* Class Type: the tables as objects, for forms and documentation. Types recur, so objects are created on access. */
#include "decode.h"
#include "errors.h"
#include "message.h"
#include "plain.h"

typedef struct type {
    PyObject_HEAD
    const shape *shape;
} type;

static PyTypeObject *Type, *Field;

static PyObject *type_object(const shape *shape)
{
    type *new = PyObject_New(type, Type);
    if (new != NULL)
        new->shape = shape;
    return (PyObject *)new;
}

static void type_dealloc(PyObject *self)
{
    PyTypeObject *class = Py_TYPE(self);
    PyObject_Free(self);
    Py_DECREF(class);
}

static const shape *of(PyObject *self)
{
    return ((const type *)(const void *)self)->shape;
}

static PyObject *text_or_none(const char *text)
{
    return text == NULL ? Py_NewRef(Py_None) : PyUnicode_FromString(text);
}

static bool has_names(const captain_type *type)
{
    return type->names_count > 0;
}

/* Steals a reference to the item. On failure it drops the tuple. */
static void put(PyObject **tuple, Py_ssize_t index, PyObject *item)
{
    if (item == NULL)
        Py_CLEAR(*tuple);
    else
        TUPLE_SET(*tuple, index, item);
}

/* ---------------------------------------------------------------- attributes */

static PyObject *type_name(PyObject *self, void *unused)
{
    (void)unused;
    return text_or_none(of(self)->type->name);
}

static PyObject *type_kind(PyObject *self, void *unused)
{
    (void)unused;
    return PyUnicode_FromString(captain_kind_text(of(self)->type));
}

static PyObject *type_unit(PyObject *self, void *unused)
{
    (void)unused;
    return text_or_none(of(self)->type->unit);
}

static PyObject *type_standard(PyObject *self, void *unused)
{
    (void)unused;
    return text_or_none(of(self)->type->standard);
}

static bool has_range(uint8_t kind)
{
    return kind == CAPTAIN_INTEGER || (kind >= CAPTAIN_SMALL_BITS && kind <= CAPTAIN_UTF8) || kind == CAPTAIN_LIST;
}

static PyObject *type_low(PyObject *self, void *unused)
{
    (void)unused;
    const captain_type *type = of(self)->type;
    if (!has_range(type->kind) || type->flags & CAPTAIN_UNBOUNDED_LOW)
        Py_RETURN_NONE;
    return PyLong_FromLongLong(type->low);
}

static PyObject *type_high(PyObject *self, void *unused)
{
    (void)unused;
    const captain_type *type = of(self)->type;
    if (!has_range(type->kind) || type->flags & CAPTAIN_UNBOUNDED_HIGH)
        Py_RETURN_NONE;
    return of(self)->op == OP_U64 ? PyLong_FromUnsignedLongLong((uint64_t)type->high) : PyLong_FromLongLong(type->high);
}

static PyObject *type_is_extensible(PyObject *self, void *unused)
{
    (void)unused;
    return PyBool_FromLong(of(self)->type->flags & CAPTAIN_EXTENSIBLE);
}

static PyObject *type_names(PyObject *self, void *unused)
{
    (void)unused;
    const captain_type *type = of(self)->type;
    PyObject *tuple = PyTuple_New(has_names(type) ? type->names_count : 0);
    for (uint16_t index = 0; tuple != NULL && index < type->names_count; index++)
        put(&tuple, index, Py_BuildValue("(sL)", type->names[index].name, (long long)type->names[index].value));
    return tuple;
}

static PyObject *type_special(PyObject *self, void *unused)
{
    (void)unused;
    const captain_type *type = of(self)->type;
    PyObject *list = PyList_New(0);
    for (uint16_t index = 0; list != NULL && type->kind == CAPTAIN_INTEGER && index < type->names_count; index++) {
        PyObject *name = captain_plain_is_special(type->names[index].name) ? PyUnicode_FromString(type->names[index].name) : Py_NewRef(Py_None);
        if (name == NULL || (name != Py_None && PyList_Append(list, name) < 0))
            Py_CLEAR(list);
        Py_XDECREF(name);
    }
    PyObject *tuple = list == NULL ? NULL : PyList_AsTuple(list);
    Py_XDECREF(list);
    return tuple;
}

/* Return the ends of the range in the plain dialect, and their unit. */
static PyObject *type_plain_range(PyObject *self, PyObject *unit)
{
    const captain_type *type = of(self)->type;
    char low[PLAIN_TEXT], high[PLAIN_TEXT];
    const char *text = type->unit;
    if (unit != Py_None && (text = PyUnicode_AsUTF8AndSize(unit, NULL)) == NULL)
        return NULL;
    if (type->kind != CAPTAIN_INTEGER || text == NULL)
        return PyErr_Format(PyExc_ValueError, "%R is no INTEGER with a unit", self);
    captain_plain plain = captain_plain_of(type, text);
    const char *least = captain_plain_low(type, plain, low) ? low : NULL, *most = captain_plain_high(type, plain, high) ? high : NULL;
    return Py_BuildValue("(zzs)", least, most, plain.unit);
}

static PyObject *field_object(const slot *slot)
{
    PyObject *new = PyStructSequence_New(Field);
    if (new == NULL)
        return NULL;
    bool is_absent = slot->field->default_value == NULL || !slot->has_default;
    PyObject *const members[] = {
        Py_NewRef(slot->key), type_object(slot->shape), text_or_none(slot->field->unit),
        PyBool_FromLong(slot->present != CAPTAIN_NOWHERE),
        is_absent ? Py_NewRef(Py_None) : python_value(slot->shape, slot->field->default_value),
        PyLong_FromLong(slot->field->addition),
    };
    for (Py_ssize_t index = 0; index < (Py_ssize_t)(sizeof members / sizeof *members); index++)
        PyStructSequence_SetItem(new, index, members[index]);
    if (PyErr_Occurred())
        Py_CLEAR(new);
    return new;
}

static PyObject *type_fields(PyObject *self, void *unused)
{
    (void)unused;
    PyObject *tuple = PyTuple_New(of(self)->slots_count);
    for (uint16_t index = 0; tuple != NULL && index < of(self)->slots_count; index++)
        put(&tuple, index, field_object(&of(self)->slots[index]));
    return tuple;
}

static PyObject *type_element(PyObject *self, void *unused)
{
    (void)unused;
    return of(self)->element == NULL ? Py_NewRef(Py_None) : type_object(of(self)->element);
}

static PyObject *type_rows(PyObject *self, void *unused)
{
    (void)unused;
    const shape *shape = of(self);
    uint16_t count = shape->rows == NULL ? 0 : shape->type->rows_count;
    PyObject *tuple = PyTuple_New(count);
    for (uint16_t index = 0; tuple != NULL && index < count; index++)
        put(&tuple, index, Py_BuildValue("(LN)", (long long)shape->type->rows[index].id, type_object(shape->rows[index])));
    return tuple;
}

/* ---------------------------------------------------------------- the classes */

static PyMethodDef METHODS[] = {
    {"plain_range", type_plain_range, METH_O, "Unit of the component or None to the least and the largest number of the plain dialect, and their unit."},
    {0},
};

static PyObject *type_compare(PyObject *left, PyObject *right, int operation)
{
    if (Py_TYPE(left) != Type || Py_TYPE(right) != Type || (operation != Py_EQ && operation != Py_NE))
        return Py_NewRef(Py_NotImplemented);
    return PyBool_FromLong((of(left) == of(right)) == (operation == Py_EQ));
}

static Py_hash_t type_hash(PyObject *self)
{
    return (Py_hash_t)((uintptr_t)of(self) >> 4);
}

static PyObject *type_repr(PyObject *self)
{
    return PyUnicode_FromFormat("<type %s: %s>", captain_type_text(of(self)->type), captain_kind_text(of(self)->type));
}

static PyGetSetDef ATTRIBUTES[] = {
    {"name", type_name, NULL, "In the ASN.1; None inside another type.", NULL},
    {"kind", type_kind, NULL, "\"INTEGER\", \"SEQUENCE\", ...", NULL},
    {"unit", type_unit, NULL, "Of a value of 1.", NULL},
    {"standard", type_standard, NULL, "Document and version.", NULL},
    {"low", type_low, NULL, "Smallest value, or size, of the root; None: no bound.", NULL},
    {"high", type_high, NULL, "Largest value, or size, of the root; None: no bound.", NULL},
    {"is_extensible", type_is_extensible, NULL, NULL, NULL},
    {"names", type_names, NULL, "Named numbers, items or bits: (name, value).", NULL},
    {"special", type_special, NULL, "Names of the special values of an INTEGER.", NULL},
    {"fields", type_fields, NULL, "Components of a SEQUENCE, alternatives of a CHOICE.", NULL},
    {"element", type_element, NULL, "Type of the elements of a list.", NULL},
    {"rows", type_rows, NULL, "Of an open type: (identifier, type).", NULL},
    {0},
};
static PyType_Slot SLOTS[] = {{Py_tp_dealloc, type_dealloc}, {Py_tp_repr, type_repr}, {Py_tp_richcompare, type_compare},
                              {Py_tp_hash, type_hash}, {Py_tp_getset, ATTRIBUTES}, {Py_tp_methods, METHODS}, {Py_tp_doc, "A type of the ASN.1."}, {0}};
static PyType_Spec SPEC = {.name = "captain_messages.Type", .basicsize = (int)sizeof(type),
                           .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_IMMUTABLETYPE | Py_TPFLAGS_DISALLOW_INSTANTIATION,
                           .slots = SLOTS};

static PyStructSequence_Field FIELD_FIELDS[] = {
    {"name", "in the ASN.1"}, {"type", "a Type"}, {"unit", "where the component has one of its own"},
    {"is_optional", "may be absent"}, {"default", "None where there is none"},
    {"addition", "0 in the root, else the number of the extension addition"}, {0},
};
static PyStructSequence_Desc FIELD = {"captain_messages.Field", "A component or alternative.", FIELD_FIELDS, 6};

PyObject *message_type_tree(PyObject *self, PyObject *unused)
{
    (void)unused;
    return type_object(message_of(self)->shape);
}

bool tree_add(PyObject *module)
{
    Type = (PyTypeObject *)PyType_FromSpec(&SPEC);
    Field = PyStructSequence_NewType(&FIELD);
    return Type != NULL && Field != NULL && PyModule_AddObjectRef(module, "Type", (PyObject *)Type) == 0
        && PyModule_AddObjectRef(module, "Field", (PyObject *)Field) == 0;
}

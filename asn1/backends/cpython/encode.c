#include "encode.h"
#include "walk.h"

#include <string.h>

/* ---------------------------------------------------------------- numbers */

static bool refuse_range(maker *maker, const shape *shape, PyObject *value)
{
    char allowed[CAPTAIN_RANGE_TEXT];
    PyObject *text = shown(value);
    if (text != NULL)
        refuse(maker, "out of range: %U is not in %s", text, captain_range_text(shape->type, allowed));
    Py_XDECREF(text);
    return false;
}

/* Return whether the standard allows numbers of this size; then only memory limits them. */
static bool is_too_wide(const captain_type *type, int overflow)
{
    unsigned open = CAPTAIN_EXTENSIBLE | (overflow > 0 ? CAPTAIN_UNBOUNDED_HIGH : CAPTAIN_UNBOUNDED_LOW);
    return overflow != 0 && (type->flags & open) != 0;
}

static bool refuse_width(maker *maker, PyObject *value)
{
    PyObject *text = shown(value);
    if (text != NULL)
        refuse(maker, "out of range: %U does not fit into 64 bits, -2**63..2**63-1: the standard has no limit here, this library has", text);
    Py_XDECREF(text);
    return false;
}

/* Return a new reference to an int, converted by __index__ if necessary (numpy, ctypes). NULL if refused. */
static PyObject *as_int(maker *maker, PyObject *value)
{
    if (PyLong_Check(value) && !PyBool_Check(value))
        return Py_NewRef(value);
    if (PyBool_Check(value) || !PyIndex_Check(value)) {
        refuse_class(maker, value, "int");
        return NULL;
    }
    maker->foreign++;
    PyObject *number = PyNumber_Index(value);
    if (number == NULL)
        refuse_error(maker, "__index__");
    return number;
}

/* An unsigned number beyond 63 bits is stored as the signed one with the same octets. */
static bool large_integer(maker *maker, const shape *shape, PyObject *value, int64_t *number)
{
    int overflow = 0;
    PyObject *integer = as_int(maker, value);
    if (integer == NULL)
        return false;
    *number = PyLong_AsLongLongAndOverflow(integer, &overflow);
    bool fits = overflow == 0;
    if (overflow > 0 && shape->op == OP_U64) {
        *number = (int64_t)PyLong_AsUnsignedLongLong(integer);
        fits = !PyErr_Occurred();
        PyErr_Clear();
    } else if (fits) {
        fits = *number >= shape->low && *number <= shape->high;
    }
    Py_DECREF(integer);
    if (is_too_wide(shape->type, fits ? 0 : overflow))
        return refuse_width(maker, value);
    return fits || refuse_range(maker, shape, value);
}

bool other_integer_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at)
{
    int64_t number;
    if (small_integer(value, &number)) /* it was handled before: out of range */
        return refuse_range(maker, shape, value);
    Py_INCREF(value);
    bool is_good = large_integer(maker, shape, value, &number);
    Py_DECREF(value);
    if (is_good)
        put_integer(shape, number, at);
    return is_good;
}

static bool boolean_from(maker *maker, PyObject *value, unsigned char *at)
{
    if (value != Py_True && value != Py_False)
        return refuse_class(maker, value, "bool");
    PUT(bool, at, value == Py_True);
    return true;
}

static bool null_from(maker *maker, PyObject *value, unsigned char *at)
{
    PUT(bool, at, false);
    return value == Py_None || refuse_class(maker, value, "None");
}

/* ---------------------------------------------------------------- enumerations */

/* Return the index of an unknown addition: decode returns such an item as its index. */
static bool unknown_item(maker *maker, const captain_type *type, PyObject *value, unsigned char *at)
{
    int64_t index;
    int64_t known = type->names_count - type->root_count;
    if (!small_integer(value, &index)) {
        int overflow;
        index = PyLong_AsLongLongAndOverflow(value, &overflow);
    }
    if (!(type->flags & CAPTAIN_EXTENSIBLE))
        return refuse_class(maker, value, "str: this enumeration has no unknown items");
    if (index < known || index >= CAPTAIN_UNKNOWN)
        return refuse(maker, "out of range: %lld is no index of an unknown item, which begin at %lld", (long long)index,
                      (long long)known);
    PUT(int32_t, at, CAPTAIN_UNKNOWN + index);
    return true;
}

bool enumerated_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at)
{
    Py_ssize_t index = item_find(shape, value);
    if (index >= 0) {
        PUT(int32_t, at, shape->type->names[index].value);
        return true;
    }
    if (PyLong_Check(value) && !PyBool_Check(value))
        return unknown_item(maker, shape->type, value, at);
    if (!PyUnicode_Check(value))
        return refuse_class(maker, value, "str");
    return refuse_name(maker, value, "item", shape->type);
}

/* ---------------------------------------------------------------- containers */

static bool fits_size(maker *maker, const captain_type *type, Py_ssize_t count)
{
    char allowed[CAPTAIN_RANGE_TEXT];
    bool is_bounded = !(type->flags & (CAPTAIN_EXTENSIBLE | CAPTAIN_UNBOUNDED_HIGH));
    if ((is_bounded && (count < type->low || count > type->high)) || (uint64_t)count > UINT32_MAX)
        return refuse(maker, "wrong size: %zd elements, not %s", count, captain_size_text(type, allowed));
    return true;
}

static bool items_from(maker *maker, const shape *shape, PyObject *list, Py_ssize_t count, unsigned char *at)
{
    size_t step = shape->element->type->size;
    bool is_list = PyList_Check(list);
    for (Py_ssize_t index = 0; index < count; index++, at += step) {
        if (is_list && index >= LIST_COUNT(list))
            return refuse(maker, "the list became shorter while it was encoded");
        PyObject *item = is_list ? LIST_ITEM(list, index) : TUPLE_ITEM(list, index);
        if (!quick_from(maker, shape->element, item, at))
            return under_index(maker, index);
    }
    return true;
}

bool list_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at)
{
    bool is_list = PyList_Check(value);
    if (!is_list && !PyTuple_Check(value))
        return view_from(maker, shape, value, at);
    Py_ssize_t count = is_list ? LIST_COUNT(value) : TUPLE_COUNT(value);
    size_t octets;
    if (!fits_size(maker, shape->type, count))
        return false;
    if (__builtin_mul_overflow((size_t)count, shape->element->type->size, &octets))
        return refuse(maker, "%zd elements are too many for this machine", count);
    void *items = maker_take(maker, octets);
    if (items == NULL)
        return false;
    PUT(captain_list, at, ((captain_list){.count = (uint32_t)count, .items = items}));
    if (++maker->depth > CAPTAIN_MAX_DEPTH)
        return refuse(maker, "nested deeper than %d", (int)CAPTAIN_MAX_DEPTH);
    Py_INCREF(value);
    bool is_good = items_from(maker, shape, value, count, items);
    Py_DECREF(value);
    maker->depth--;
    return is_good;
}

/* ("[1]", octets) */
static bool unknown_alternative(maker *maker, const shape *shape, PyObject *name, PyObject *value, unsigned char *at)
{
    const captain_type *type = shape->type;
    uint32_t index, known = (uint32_t)(type->fields_count - type->root_count);
    if (index_of(name, &index) && (type->flags & CAPTAIN_EXTENSIBLE) && index >= known) {
        PUT(uint32_t, at, CAPTAIN_UNKNOWN + index);
        return octets_from(maker, value, (captain_octets *)(void *)(at + union_offset(type)));
    }
    return refuse_name(maker, name, "alternative", type);
}

static bool alternative_from(maker *maker, const shape *shape, PyObject *name, PyObject *value, unsigned char *at)
{
    Py_ssize_t index = slot_find(shape, name, 0);
    if (index < 0)
        return unknown_alternative(maker, shape, name, value, at);
    const slot *slot = &shape->slots[index];
    unsigned char *inner = at + slot->offset;
    PUT(uint32_t, at, index + 1);
    if (slot->is_pointer) {
        void *memory = maker_take(maker, slot->shape->type->size);
        if (memory == NULL)
            return false;
        PUT(void *, inner, memory);
        inner = memory;
    }
    return quick_from(maker, slot->shape, value, inner) || under_name(maker, slot->field->name);
}

bool choice_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at)
{
    PyObject *name, *inner;
    if (PyTuple_Check(value) && TUPLE_COUNT(value) == 2) {
        name = Py_NewRef(TUPLE_ITEM(value, 0));
        inner = Py_NewRef(TUPLE_ITEM(value, 1));
    } else if (PyList_Check(value) && LIST_COUNT(value) == 2) {
        name = Py_NewRef(LIST_ITEM(value, 0));
        inner = Py_NewRef(LIST_ITEM(value, 1));
    } else {
        return view_from(maker, shape, value, at);
    }
    bool is_good = ++maker->depth > CAPTAIN_MAX_DEPTH ? refuse(maker, "nested deeper than %d", (int)CAPTAIN_MAX_DEPTH)
                                                      : alternative_from(maker, shape, name, inner, at);
    maker->depth--;
    Py_DECREF(name);
    Py_DECREF(inner);
    return is_good;
}

bool value_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at)
{
    switch (shape->op) {
    case OP_BOOLEAN:
        return boolean_from(maker, value, at);
    case OP_NULL:
        return null_from(maker, value, at);
    case OP_ENUMERATED:
        return enumerated_from(maker, shape, value, at);
    case OP_SEQUENCE:
        return record_from(maker, shape, value, at);
    case OP_CHOICE:
        return choice_from(maker, shape, value, at);
    case OP_LIST:
        return list_from(maker, shape, value, at);
    case OP_SMALL_BITS:
    case OP_BITS:
    case OP_FIXED_OCTETS:
    case OP_OCTETS:
    case OP_TEXT:
    case OP_OID:
        return string_from(maker, shape, value, at);
    case OP_OPEN:
        PyErr_SetString(PyExc_SystemError, "captain_messages: an open type outside a SEQUENCE");
        return false;
    default:
        return integer_from(maker, shape, value, at);
    }
}

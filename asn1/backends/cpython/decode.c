#include "decode.h"

PyObject *index_name(uint32_t index)
{
    return PyUnicode_FromFormat("[%u]", (unsigned)index);
}

PyObject *octets_value(captain_octets octets)
{
    return PyBytes_FromStringAndSize((const char *)octets.octets, (Py_ssize_t)octets.count);
}

static PyObject *item_name(const shape *shape, int32_t number)
{
    if (number >= CAPTAIN_UNKNOWN)
        return PyLong_FromLong(number - CAPTAIN_UNKNOWN);
    for (uint16_t index = 0; index < shape->type->names_count; index++)
        if (shape->type->names[index].value == number)
            return Py_NewRef(shape->names[index]);
    PyErr_Format(PyExc_SystemError, "captain_messages: %s has no item %d", shape->type->name, (int)number);
    return NULL;
}

static PyObject *pair(PyObject *first, PyObject *second)
{
    PyObject *tuple = first == NULL || second == NULL ? NULL : PyTuple_New(2);
    if (tuple == NULL) {
        Py_XDECREF(first);
        Py_XDECREF(second);
        return NULL;
    }
    TUPLE_SET(tuple, 0, first);
    TUPLE_SET(tuple, 1, second);
    return tuple;
}

PyObject *choice_name(const shape *shape, uint32_t choice)
{
    if (choice >= CAPTAIN_UNKNOWN)
        return index_name(choice - CAPTAIN_UNKNOWN);
    if (choice > 0 && choice <= shape->slots_count)
        return Py_NewRef(shape->slots[choice - 1].key);
    PyErr_Format(PyExc_SystemError, "captain_messages: %s has no alternative %u", shape->type->name, (unsigned)choice);
    return NULL;
}

static PyObject *choice_pair(const shape *shape, const unsigned char *value)
{
    uint32_t choice = AT(uint32_t, value);
    PyObject *name = choice_name(shape, choice);
    if (name == NULL)
        return NULL;
    if (choice >= CAPTAIN_UNKNOWN)
        return pair(name, octets_value(AT(captain_octets, value + union_offset(shape->type))));
    const slot *slot = &shape->slots[choice - 1];
    return pair(name, quick_value(slot->shape, slot_value(slot, value)));
}

static PyObject *list_of(const shape *shape, const captain_list *list)
{
    const unsigned char *item = list->items;
    size_t step = shape->element->type->size;
    PyObject *values = PyList_New((Py_ssize_t)list->count);
    if (values == NULL)
        return NULL;
    for (uint32_t index = 0; index < list->count; index++, item += step) {
        PyObject *value = quick_value(shape->element, item);
        if (value == NULL) {
            Py_DECREF(values);
            return NULL;
        }
        LIST_SET(values, (Py_ssize_t)index, value);
    }
    return values;
}

const shape *open_shape(const shape *shape, const captain_open *open)
{
    for (uint16_t index = 0; open->type != NULL && index < shape->type->rows_count; index++)
        if (shape->type->rows[index].type == open->type)
            return shape->rows[index];
    return NULL;
}

static PyObject *open_value(const shape *shape, const captain_open *open)
{
    const struct shape *inner = open_shape(shape, open);
    return inner == NULL ? octets_value(open->octets) : python_value(inner, open->value);
}

PyObject *other_value(const shape *shape, const unsigned char *value)
{
    switch (shape->op) {
    case OP_BOOLEAN:
        return PyBool_FromLong(AT(bool, value));
    case OP_NULL:
        return Py_NewRef(Py_None);
    case OP_U64:
        return PyLong_FromUnsignedLongLong(AT(uint64_t, value));
    case OP_I64:
        return PyLong_FromLongLong(AT(int64_t, value));
    case OP_ENUMERATED:
        return item_name(shape, AT(int32_t, value));
    case OP_CHOICE:
        return choice_pair(shape, value);
    case OP_LIST:
        return list_of(shape, &AT(captain_list, value));
    case OP_OPEN:
        return open_value(shape, &AT(captain_open, value));
    default:
        return string_value(shape, value);
    }
}

PyObject *python_value(const shape *shape, const unsigned char *value)
{
    return quick_value(shape, value);
}

/* Bits, octets, text and object identifiers, out of memory into Python. The way back is strings_from.c. */
#include "decode.h"
#include "walk.h"

static PyObject *bits_value(const unsigned char *octets, size_t bits)
{
    PyObject *tuple = PyTuple_New(2);
    if (tuple == NULL)
        return NULL;
    TUPLE_SET(tuple, 0, PyBytes_FromStringAndSize((const char *)octets, (Py_ssize_t)octets_of_bits(bits)));
    TUPLE_SET(tuple, 1, PyLong_FromSize_t(bits));
    if (TUPLE_ITEM(tuple, 0) == NULL || TUPLE_ITEM(tuple, 1) == NULL)
        Py_CLEAR(tuple);
    return tuple;
}

static PyObject *small_bits_value(const captain_type *type, const unsigned char *value)
{
    unsigned char octets[8];
    size_t bits = (size_t)type->high;
    uint64_t number = bits == 0 ? 0 : (uint64_t)captain_walk_number(type, value) << (64 - bits);
    for (size_t index = 0; index < sizeof octets; index++)
        octets[index] = (unsigned char)(number >> (56 - 8 * index));
    return bits_value(octets, bits);
}

static bool append(void *context, const char *text, size_t octets)
{
    PyObject **whole = context;
    PyUnicode_AppendAndDel(whole, PyUnicode_FromStringAndSize(text, (Py_ssize_t)octets));
    return *whole != NULL;
}

static PyObject *oid_value(const captain_type *type, const captain_octets *oid)
{
    PyObject *text = PyUnicode_FromString("");
    captain_out out;
    captain_out_start(&out, append, &text);
    captain_out_oid(&out, type->kind == CAPTAIN_RELATIVE_OID, oid);
    captain_out_end(&out);
    return text;
}

PyObject *string_value(const shape *shape, const unsigned char *value)
{
    const captain_type *type = shape->type;
    switch (shape->op) {
    case OP_SMALL_BITS:
        return small_bits_value(type, value);
    case OP_BITS:
        return bits_value(AT(captain_bits, value).octets, AT(captain_bits, value).count);
    case OP_FIXED_OCTETS:
        return PyBytes_FromStringAndSize((const char *)value, (Py_ssize_t)type->high);
    case OP_OCTETS:
        return octets_value(AT(captain_octets, value));
    case OP_TEXT:
        return PyUnicode_DecodeUTF8(AT(captain_text, value).text, (Py_ssize_t)AT(captain_text, value).count, NULL);
    case OP_OID:
        return oid_value(type, &AT(captain_octets, value));
    default:
        PyErr_Format(PyExc_SystemError, "captain_messages: a type of kind %d", (int)type->kind);
        return NULL;
    }
}

/* Bits, octets, text and object identifiers to Python objects. strings_from.c has the opposite direction. */
#include "decode.h"
#include "walk.h"

static PyObject *new_bits(const unsigned char *octets, size_t bits)
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

/* Cache of tuples for short bit strings, because messages have many of them with few different values. A new tuple replaces the
 * old one at its place. Tuples are immutable, so they can be shared. The GIL protects the cache. */
enum { LOG2_KEPT = 8, FEW_BITS = 64 };
static struct kept {
    PyObject *tuple;
    uint64_t number;
    size_t bits;
} kept[1 << LOG2_KEPT];

static NEVER_INLINE PyObject *keep_bits(struct kept *place, uint64_t number, size_t bits)
{
    unsigned char octets[8];
    for (size_t index = 0; index < sizeof octets; index++)
        octets[index] = (unsigned char)(number >> (56 - 8 * index));
    PyObject *tuple = new_bits(octets, bits), *before = place->tuple;
    if (tuple == NULL)
        return NULL;
    *place = (struct kept){.tuple = Py_NewRef(tuple), .number = number, .bits = bits};
    Py_XDECREF(before);
    return tuple;
}

/* Return the tuple of up to FEW_BITS bits. The first bit is the highest of the number. */
static PyObject *few_bits_value(uint64_t number, size_t bits)
{
    struct kept *place = &kept[(number + bits) * UINT64_C(0x9E3779B97F4A7C15) >> (64 - LOG2_KEPT)];
    if (place->tuple == NULL || place->number != number || place->bits != bits)
        return keep_bits(place, number, bits);
    return Py_NewRef(place->tuple);
}

static PyObject *small_bits_value(const captain_type *type, const unsigned char *value)
{
    size_t bits = (size_t)type->high;
    return few_bits_value(bits == 0 ? 0 : (uint64_t)captain_walk_number(type, value) << (64 - bits), bits);
}

static PyObject *bits_value(const captain_bits *value)
{
    uint64_t number = 0;
    size_t octets = octets_of_bits(value->count);
    if (value->count > FEW_BITS || value->count == 0)
        return new_bits(value->octets, value->count);
    for (size_t index = 0; index < octets; index++)
        number = number << 8 | value->octets[index];
    return few_bits_value(number << (64 - 8 * octets), value->count);
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
        return bits_value(&AT(captain_bits, value));
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

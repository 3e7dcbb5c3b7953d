/* Bits, octets, text, object identifiers and open types from Python objects. Everything is copied. */
#include "encode.h"
#include "octets.h"
#include "json.h"

#include <string.h>

static bool is_buffer(PyObject *value)
{
    return PyBytes_Check(value) || PyByteArray_Check(value) || PyMemoryView_Check(value);
}

static bool copy(maker *maker, const void *data, size_t count, captain_octets *octets)
{
    if (count > UINT32_MAX)
        return refuse(maker, "wrong size: %zu octets", count);
    void *memory = maker_take(maker, count);
    if (memory == NULL)
        return false;
    memcpy(memory, data, count);
    *octets = (captain_octets){.count = (uint32_t)count, .octets = memory};
    return true;
}

bool octets_from(maker *maker, PyObject *value, captain_octets *copied)
{
    octets octets;
    if (!is_buffer(value))
        return refuse_class(maker, value, "bytes");
    Py_INCREF(value);
    maker->foreign += !PyBytes_CheckExact(value);
    bool is_good = octets_open(&octets, value);
    if (is_good) {
        is_good = copy(maker, octets.data, octets.count, copied);
        octets_close(&octets);
    } else {
        refuse_error(maker, "its buffer");
    }
    Py_DECREF(value);
    return is_good;
}

/* ---------------------------------------------------------------- BIT STRING */

static PyObject *item_of(PyObject *pair, Py_ssize_t index)
{
    return PyList_Check(pair) ? LIST_ITEM(pair, index) : TUPLE_ITEM(pair, index);
}

static bool is_pair(PyObject *value)
{
    return (PyTuple_Check(value) && TUPLE_COUNT(value) == 2) || (PyList_Check(value) && LIST_COUNT(value) == 2);
}

static bool bit_count(maker *maker, PyObject *number, int64_t *count)
{
    if (!small_integer(number, count))
        *count = PyLong_Check(number) && !PyBool_Check(number) ? PyLong_AsLongLong(number) : -1;
    if (*count >= 0 && *count <= UINT32_MAX)
        return true;
    PyErr_Clear();
    return refuse_class(maker, number, "the number of bits");
}

/* Copy the octets, with the unused bits of the last one cleared. */
static bool bits_from(maker *maker, PyObject *value, captain_bits *bits)
{
    captain_octets octets = {0};
    int64_t count = 0;
    if (!is_pair(value))
        return refuse_class(maker, value, "a tuple (octets, number of bits)");
    if (!bit_count(maker, item_of(value, 1), &count))
        return false;
    if (!octets_from(maker, item_of(value, 0), &octets))
        return false;
    if (octets.count != octets_of_bits((size_t)count))
        return refuse(maker, "%u octets do not hold %lld bits", (unsigned)octets.count, (long long)count);
    if (count % 8 != 0)
        ((unsigned char *)(uintptr_t)octets.octets)[octets.count - 1] &= (unsigned char)(0xff << (8 - count % 8));
    *bits = (captain_bits){.count = (uint32_t)count, .octets = octets.octets};
    return true;
}

/* Get the bits of a tuple (bytes, int), as decode returns, without a copy. If false, bits_from reports the error. */
static bool plain_bits(PyObject *value, captain_bits *bits)
{
    int64_t count;
    if (!PyTuple_CheckExact(value) || TUPLE_COUNT(value) != 2)
        return false;
    PyObject *octets = TUPLE_ITEM(value, 0);
    if (!PyBytes_CheckExact(octets) || !small_integer(TUPLE_ITEM(value, 1), &count) || count < 0 || count > 64
        || BYTES_COUNT(octets) != (Py_ssize_t)octets_of_bits((size_t)count))
        return false;
    *bits = (captain_bits){.count = (uint32_t)count, .octets = (const uint8_t *)BYTES_DATA(octets)};
    return true;
}

/* Trailing zeros of named bits may be missing (X.680 22.7). */
static bool small_bits_from(maker *maker, const captain_type *type, PyObject *value, unsigned char *at)
{
    captain_bits bits = {0};
    uint64_t number = 0;
    if (!plain_bits(value, &bits) && !bits_from(maker, value, &bits))
        return false;
    if (bits.count > type->high || (bits.count < type->high && !(type->flags & CAPTAIN_NAMED_BITS)))
        return refuse(maker, "wrong size: %u bits, not %lld", (unsigned)bits.count, (long long)type->high);
    for (uint32_t index = 0; index < octets_of_bits(bits.count); index++)
        number |= (uint64_t)bits.octets[index] << (56 - 8 * index);
    if (bits.count % 64 != 0)
        number &= ~(UINT64_MAX >> bits.count);
    captain_walk_set_number(type, at, type->high == 0 ? 0 : (int64_t)(number >> (64 - type->high)));
    return true;
}

/* ---------------------------------------------------------------- the others */

static bool fixed_octets_from(maker *maker, const captain_type *type, PyObject *value, unsigned char *at)
{
    captain_octets octets = {0};
    if (!octets_from(maker, value, &octets))
        return false;
    if (octets.count != type->high)
        return refuse(maker, "wrong size: %u octets, not %lld", (unsigned)octets.count, (long long)type->high);
    memcpy(at, octets.octets, octets.count);
    return true;
}

static const char *text_from(maker *maker, PyObject *value, size_t *length)
{
    Py_ssize_t count = 0;
    if (!PyUnicode_Check(value)) {
        refuse_class(maker, value, "str");
        return NULL;
    }
    const char *text = PyUnicode_AsUTF8AndSize(value, &count);
    if (text == NULL)
        refuse_error(maker, "a character that UTF-8 has not (a lone surrogate): its encoder");
    *length = (size_t)count;
    return text;
}

static bool characters_from(maker *maker, PyObject *value, captain_text *characters)
{
    captain_octets octets = {0};
    size_t length = 0;
    const char *text = text_from(maker, value, &length);
    if (text == NULL || !copy(maker, text, length + 1, &octets))
        return false;
    *characters = (captain_text){.count = (uint32_t)length, .text = (const char *)octets.octets};
    return true;
}

static bool oid_from(maker *maker, const captain_type *type, PyObject *value, captain_octets *oid)
{
    captain_text text;
    if (!characters_from(maker, value, &text))
        return false;
    uint8_t *octets = maker_take(maker, text.count + (size_t)1);
    if (octets == NULL)
        return false;
    size_t count = captain_json_oid(&text, type->kind == CAPTAIN_RELATIVE_OID, octets);
    if (count != SIZE_MAX) {
        *oid = (captain_octets){.count = (uint32_t)count, .octets = octets};
        return true;
    }
    PyObject *words = shown(value);
    if (words != NULL)
        refuse(maker, "%U is no object identifier like '1.3.6.1'", words);
    Py_XDECREF(words);
    return false;
}

bool string_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at)
{
    const captain_type *type = shape->type;
    switch (shape->op) {
    case OP_SMALL_BITS:
        return small_bits_from(maker, type, value, at);
    case OP_BITS:
        return bits_from(maker, value, (captain_bits *)(void *)at);
    case OP_FIXED_OCTETS:
        return fixed_octets_from(maker, type, value, at);
    case OP_OCTETS:
        return octets_from(maker, value, (captain_octets *)(void *)at);
    case OP_TEXT:
        return characters_from(maker, value, (captain_text *)(void *)at);
    default:
        return oid_from(maker, type, value, (captain_octets *)(void *)at);
    }
}

/* ---------------------------------------------------------------- open types */

/* Octets are the whole encoded open type, unless its type is an OCTET STRING itself. */
bool open_from(maker *maker, const shape *owner, const slot *slot, PyObject *value, unsigned char *record)
{
    const struct slot *selector = &owner->slots[slot->shape->type->selector];
    captain_open *open = (captain_open *)(void *)(record + slot->offset);
    int64_t id = captain_walk_number(selector->shape->type, slot_value(selector, record));
    const captain_type *content = captain_walk_row(slot->shape->type, id);
    const shape *row = content == NULL ? NULL : shape_of(content); /* created together with the shape of the open type */
    *open = (captain_open){0};
    if (is_buffer(value) && (row == NULL || (row->op != OP_OCTETS && row->op != OP_FIXED_OCTETS)))
        return octets_from(maker, value, &open->octets);
    if (row == NULL)
        return refuse(maker, "of the unknown type %lld; its octets are wanted, as bytes", (long long)id);
    void *memory = maker_take(maker, row->type->size);
    if (memory == NULL)
        return false;
    open->type = row->type;
    open->value = memory;
    return value_from(maker, row, value, memory);
}

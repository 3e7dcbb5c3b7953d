/* Conversion of values in memory to Python objects, in the forms of asn1/README.md. Every function returns a new reference, or
 * NULL with an exception. */
#ifndef CAPTAIN_DECODE_H
#define CAPTAIN_DECODE_H

#include "shapes.h"

PyObject *python_value(const shape *shape, const unsigned char *value);
/* Convert the kinds that quick_value does not handle. */
PyObject *other_value(const shape *shape, const unsigned char *value);
/* Convert a SEQUENCE to a dict, without absent components and with defaults (record.c). */
PyObject *record_dict(const shape *shape, const unsigned char *record);
/* Return the name of an alternative; "[1]" for an unknown one. */
PyObject *choice_name(const shape *shape, uint32_t choice);
/* Return the shape of an open type's contents; NULL, without an exception, if only octets are known. */
const shape *open_shape(const shape *shape, const captain_open *open);
/* Return an index without a name: "[3]". */
PyObject *index_name(uint32_t index);
PyObject *octets_value(captain_octets octets);
/* Convert bits, octets, text and identifiers (strings.c). */
PyObject *string_value(const shape *shape, const unsigned char *value);

#define AT(type, value) (*(const type *)(const void *)(value))

/* python_value with the most frequent kinds inline. */
static ALWAYS_INLINE PyObject *quick_value(const shape *shape, const unsigned char *value)
{
    int64_t number;
    switch (shape->op) {
    case OP_U8:
        return Py_NewRef(integers[*value - LEAST_KEPT]);
    case OP_U16:
        number = AT(uint16_t, value);
        break;
    case OP_U32:
        number = AT(uint32_t, value);
        break;
    case OP_I8:
        number = AT(int8_t, value);
        break;
    case OP_I16:
        number = AT(int16_t, value);
        break;
    case OP_I32:
        number = AT(int32_t, value);
        break;
    case OP_ENUMERATED:
        if (shape->is_dense && (uint32_t)AT(int32_t, value) < shape->type->names_count)
            return Py_NewRef(shape->names[AT(int32_t, value)]);
        return other_value(shape, value);
    case OP_SEQUENCE:
        return record_dict(shape, value);
    default:
        return other_value(shape, value);
    }
    return new_integer(number);
}

#endif

/* Conversion of Python objects to a value in memory. An invalid object gives false and a reason, never a crash: containers are
 * held while they are read, strings are copied, and the length of a list is checked at every step, because the __index__ of an
 * element may have changed it. Objects are borrowed from their containers. They are held only where their own code may run
 * (__index__, buffer, metaclass) and they are needed afterwards. */
#ifndef CAPTAIN_ENCODE_H
#define CAPTAIN_ENCODE_H

#include "errors.h"
#include "memory.h"
#include "shapes.h"

enum { MAX_PATH = 512 };

#define PUT(type, at, value) (*(type *)(void *)(at) = (type)(value))

typedef struct maker {
    memory memory;
    struct held *held;  /* buffers that the value points into */
    PyObject *reason;   /* reason of the failure */
    PyObject *cause;    /* its exception, or NULL */
    int depth;
    unsigned foreign;   /* number of calls of the objects' own code, which may have changed any dict or list */
    size_t path_start;  /* the path is written from its end: each level prepends its name */
    char path[MAX_PATH];
} maker;

void maker_open(maker *maker, void *first, size_t octets);
void maker_close(maker *maker);
/* Raise the error of the failure. Returns NULL. */
PyObject *maker_raise(maker *maker, PyObject *error);

/* Return NULL with an exception if memory is exhausted. */
void *maker_take(maker *maker, size_t octets);

/* Convert a value. It may be a dict, list, ... or a view of the same type. */
bool value_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at);
/* Convert an INTEGER that is not a small int in its range. */
bool other_integer_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at);
bool enumerated_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at);
bool record_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at);
bool slot_from(maker *maker, const shape *shape, const slot *slot, PyObject *value, unsigned char *record);
/* Handle a component that the dict lacks; false if it is mandatory. */
bool leave_out(const slot *slot, unsigned char *record);
bool refuse_missing(maker *maker, const slot *slot);
bool any_order(maker *maker, const shape *shape, PyObject *dict, unsigned char *record); /* record_any.c */
bool choice_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at);
bool list_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at);
bool open_from(maker *maker, const shape *owner, const slot *slot, PyObject *value, unsigned char *record);
bool string_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at);
/* Copy the octets of any buffer. wanted: expected type for the error, such as "bytes". */
bool octets_from(maker *maker, PyObject *value, captain_octets *octets);
/* Convert a view in place of a dict, list or tuple. */
bool view_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at);

/* All return false. Formats are those of PyUnicode_FromFormat. */
bool refuse(maker *maker, const char *format, ...);
bool refuse_class(maker *maker, PyObject *value, const char *wanted); /* "1.5 is a float, not an int" */
bool refuse_name(maker *maker, PyObject *name, const char *what, const captain_type *type); /* "'x' is no item of T" */
bool refuse_error(maker *maker, const char *what); /* an exception of the object's own is set */
bool under_name(maker *maker, const char *name);   /* the failure was inside this component: prepend its name to the path */
bool under_index(maker *maker, Py_ssize_t index);
bool under_addition(maker *maker, uint32_t index); /* "[3]" of a SEQUENCE: ".[3]", as the runtime writes it */

static inline void put_integer(const shape *shape, int64_t number, unsigned char *at)
{
    switch (shape->op) {
    case OP_U8:
    case OP_I8:
        *at = (unsigned char)number;
        return;
    case OP_U16:
    case OP_I16:
        PUT(uint16_t, at, number);
        return;
    case OP_U32:
    case OP_I32:
        PUT(uint32_t, at, number);
        return;
    default:
        PUT(int64_t, at, number);
    }
}

static inline bool integer_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at)
{
    int64_t number;
    if (!small_integer(value, &number) || number < shape->low || number > shape->high)
        return other_integer_from(maker, shape, value, at);
    put_integer(shape, number, at);
    return true;
}

/* value_from with the most frequent kinds inline. */
static inline bool quick_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at)
{
    if (shape->op >= OP_U8 && shape->op <= OP_I64)
        return integer_from(maker, shape, value, at);
    if (shape->op == OP_SEQUENCE)
        return record_from(maker, shape, value, at);
    if (shape->op == OP_ENUMERATED)
        for (uint16_t index = 0; index < shape->type->names_count; index++)
            if (shape->names[index] == value) {
                PUT(int32_t, at, shape->type->names[index].value);
                return true;
            }
    return value_from(maker, shape, value, at);
}

/* Parse "[3]"; false for other texts, and from CAPTAIN_UNKNOWN on. */
bool index_of(PyObject *name, uint32_t *index);

#endif

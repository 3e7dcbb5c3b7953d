/* Octets from a caller: any object with a contiguous buffer. */
#ifndef CAPTAIN_OCTETS_H
#define CAPTAIN_OCTETS_H

#include "compat.h"

typedef struct octets {
    const unsigned char *data;
    size_t count;
    bool is_constant; /* immutable, so that they can be read without the GIL */
#ifdef Py_LIMITED_API
    PyObject *copy; /* copy for the limited API, which has buffers only from 3.11 on */
#else
    Py_buffer buffer; /* valid if not is_constant */
#endif
} octets;

/* Return false with TypeError (or the object's exception) without a buffer, or for a non-contiguous one. */
bool octets_open_any(octets *octets, PyObject *source);
void octets_close_any(octets *octets);

static inline bool octets_open(octets *octets, PyObject *source)
{
    if (!PyBytes_CheckExact(source))
        return octets_open_any(octets, source);
    octets->data = (const unsigned char *)BYTES_DATA(source);
    octets->count = (size_t)BYTES_COUNT(source);
    octets->is_constant = true;
    return true;
}

static inline void octets_close(octets *octets)
{
    if (!octets->is_constant)
        octets_close_any(octets);
}

#endif

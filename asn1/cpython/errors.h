/* DecodeError, EncodeError, ValidateError: ValueErrors that know where and why. Made only once something failed. */
#ifndef CAPTAIN_ERRORS_H
#define CAPTAIN_ERRORS_H

#include "memory.h"
#include "shapes.h"

extern PyObject *DecodeError, *EncodeError, *ValidateError;

bool errors_add(PyObject *module);

/* All of these return NULL with the exception set. */
PyObject *raise_decode(const captain_type *type, const void *octets, size_t count, captain_status status, const memory *memory);
PyObject *raise_report(PyObject *error, const captain_report *report);
/* Steals reason and cause; cause may be NULL. */
PyObject *raise_reason(PyObject *error, const char *path, PyObject *reason, PyObject *cause);
/* Python could not hold what was decoded: a ValueError or OverflowError becomes a DecodeError. */
PyObject *raise_unheld(void);

/* "; did you mean 'speedValue'?" where a component, alternative or item has a name like this, else "". */
PyObject *suggestion(const captain_type *type, PyObject *name);
/* The value as a few words, whatever it is: "300", "'abc'", "a list". NULL: no memory. */
PyObject *shown(PyObject *value);
/* Name of its class. */
PyObject *class_name(PyObject *value);

#endif

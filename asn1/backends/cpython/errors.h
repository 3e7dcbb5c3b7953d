/* DecodeError, EncodeError, ValidateError: ValueErrors with path and reason. They are made only after a failure. */
#ifndef CAPTAIN_ERRORS_H
#define CAPTAIN_ERRORS_H

#include "memory.h"
#include "shapes.h"

extern PyObject *DecodeError, *EncodeError, *ValidateError;

bool errors_add(PyObject *module);

/* All of these return NULL with the exception set. */
PyObject *raise_decode(const captain_type *type, const void *octets, size_t count, captain_status status, const memory *memory);
PyObject *raise_report(PyObject *error, const captain_report *report);
/* Steals references to reason and cause; cause may be NULL. */
PyObject *raise_reason(PyObject *error, const char *path, PyObject *reason, PyObject *cause);
/* Python could not represent the decoded value: convert its ValueError or OverflowError to a DecodeError. */
PyObject *raise_unheld(void);

/* Return "; did you mean 'speedValue'?" for a similar name of a component, alternative or item, else "". */
PyObject *suggestion(const captain_type *type, PyObject *name);
/* Return a short text of any value: "300", "'abc'", "a list". NULL if memory is exhausted. */
PyObject *shown(PyObject *value);
/* Return the name of the object's class. */
PyObject *class_name(PyObject *value);

#endif

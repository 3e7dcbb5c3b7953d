/* Suggestion of the nearest name for a misspelt one. */
#include "errors.h"
#include "walk.h"

#include <string.h>

PyObject *suggestion(const captain_type *type, PyObject *name)
{
    Py_ssize_t length = 0;
    const char *text = PyUnicode_Check(name) ? PyUnicode_AsUTF8AndSize(name, &length) : NULL;
    const char *nearest = NULL;
    if (text == NULL || strlen(text) != (size_t)length)
        PyErr_Clear();
    else if (type->names_count > 0)
        nearest = captain_walk_nearest(text, &type->names->name, sizeof *type->names, type->names_count);
    else if (type->fields_count > 0)
        nearest = captain_walk_nearest(text, &type->fields->name, sizeof *type->fields, type->fields_count);
    return nearest == NULL ? PyUnicode_FromString("") : PyUnicode_FromFormat("; did you mean '%s'?", nearest);
}

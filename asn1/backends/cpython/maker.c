/* Memory, reasons and paths for the conversion of Python objects. */
#include "encode.h"
#include "view.h"
#include "walk.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

typedef struct held {
    struct held *next;
    storage *storage;
} held;

void maker_open(maker *maker, void *first, size_t octets)
{
    memory_open(&maker->memory, first, octets, SIZE_MAX / 4);
    maker->held = NULL;
    maker->reason = maker->cause = NULL;
    maker->depth = 0;
    maker->foreign = 0;
    maker->path_start = MAX_PATH - 1;
    maker->path[MAX_PATH - 1] = 0;
}

void maker_close(maker *maker)
{
    for (held *held = maker->held; held != NULL; held = held->next)
        storage_release(held->storage);
    Py_XDECREF(maker->reason);
    Py_XDECREF(maker->cause);
    memory_close(&maker->memory);
}

PyObject *maker_raise(maker *maker, PyObject *error)
{
    if (maker->reason == NULL) {
        if (!PyErr_Occurred())
            PyErr_SetString(PyExc_SystemError, "captain_messages: a refusal without a reason");
        return NULL;
    }
    PyObject *reason = maker->reason, *cause = maker->cause;
    const char *path = maker->path + maker->path_start;
    maker->reason = maker->cause = NULL;
    return raise_reason(error, path[0] == '.' ? path + 1 : path, reason, cause);
}

void *maker_take(maker *maker, size_t octets)
{
    void *memory = captain_arena_take(&maker->memory.arena, octets > 0 ? octets : 1);
    if (memory == NULL)
        PyErr_NoMemory();
    return memory;
}

/* Types with the same name belong to two editions; then the error names their documents. */
static bool refuse_view(maker *maker, const captain_type *found, const captain_type *wanted)
{
    const char *name = captain_type_text(found), *other = captain_type_text(wanted);
    if (strcmp(name, other) != 0 || found->standard == NULL || wanted->standard == NULL)
        return refuse(maker, "a view of %s, not of %s", name, other);
    return refuse(maker, "a view of %s of %s, not of %s of %s: to_dict() goes from one edition to another as far as both have "
                         "the same components", name, found->standard, other, wanted->standard);
}

bool view_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at)
{
    const char *wanted = shape->op == OP_SEQUENCE ? "a dict" : shape->op == OP_LIST ? "a list" : "a tuple (name, value)";
    const view *view = view_check(value);
    if (view == NULL)
        return refuse_class(maker, value, wanted);
    if (view->shape != shape)
        return refuse_view(maker, view->shape->type, shape->type);
    held *held = maker_take(maker, sizeof *held);
    if (held == NULL)
        return false;
    *held = (struct held){.next = maker->held, .storage = storage_hold(view->storage)};
    maker->held = held;
    memcpy(at, view->value, shape->type->size);
    return true;
}

/* ---------------------------------------------------------------- reasons */

bool refuse(maker *maker, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    maker->reason = PyUnicode_FromFormatV(format, arguments);
    va_end(arguments);
    return false;
}

bool refuse_class(maker *maker, PyObject *value, const char *wanted)
{
    Py_INCREF(value); /* the metaclass may run code that drops it */
    PyObject *text = shown(value), *class = class_name(value);
    if (text != NULL && class != NULL)
        refuse(maker, "%U is of class %U, not %s", text, class, wanted);
    Py_XDECREF(text);
    Py_XDECREF(class);
    Py_DECREF(value);
    return false;
}

bool refuse_name(maker *maker, PyObject *name, const char *what, const captain_type *type)
{
    Py_INCREF(name); /* the metaclass may run code that drops it */
    PyObject *text = shown(name), *nearest = suggestion(type, name);
    if (text != NULL && nearest != NULL)
        refuse(maker, "%U is no %s of %s%U", text, what, captain_type_text(type), nearest);
    Py_XDECREF(text);
    Py_XDECREF(nearest);
    Py_DECREF(name);
    return false;
}

/* Turn an exception of the object into a reason. MemoryError, and exceptions such as KeyboardInterrupt, are passed on. */
bool refuse_error(maker *maker, const char *what)
{
    PyObject *type, *value, *traceback;
    if (!PyErr_ExceptionMatches(PyExc_Exception) || PyErr_ExceptionMatches(PyExc_MemoryError))
        return false;
    PyErr_Fetch(&type, &value, &traceback);
    PyErr_NormalizeException(&type, &value, &traceback);
    if (traceback != NULL && value != NULL)
        PyException_SetTraceback(value, traceback);
    maker->cause = value;
    PyObject *class = class_name(value);
    if (class != NULL)
        refuse(maker, "%s raised %U", what, class);
    Py_XDECREF(class);
    Py_XDECREF(type);
    Py_XDECREF(traceback);
    return false;
}

/* ---------------------------------------------------------------- paths */

static bool put_in_front(maker *maker, const char *text, size_t length)
{
    if (length > maker->path_start) { /* the path is too long: drop its beginning */
        length = maker->path_start < 3 ? maker->path_start : 3;
        text = "...";
    }
    maker->path_start -= length;
    memcpy(maker->path + maker->path_start, text, length);
    return false;
}

bool under_name(maker *maker, const char *name)
{
    char first = maker->path[maker->path_start];
    if (first != 0 && first != '[' && first != '.')
        put_in_front(maker, ".", 1);
    return put_in_front(maker, name, strlen(name));
}

bool under_index(maker *maker, Py_ssize_t index)
{
    char text[32];
    char first = maker->path[maker->path_start];
    int length = snprintf(text, sizeof text, first != 0 && first != '[' && first != '.' ? "[%zd]." : "[%zd]", index);
    return put_in_front(maker, text, (size_t)length);
}

bool under_addition(maker *maker, uint32_t index)
{
    char text[32];
    int length = snprintf(text, sizeof text, ".[%u]", (unsigned)index);
    return put_in_front(maker, text, (size_t)length);
}

bool index_of(PyObject *name, uint32_t *index)
{
    Py_ssize_t length;
    const char *text = PyUnicode_Check(name) ? PyUnicode_AsUTF8AndSize(name, &length) : NULL;
    if (text == NULL) {
        PyErr_Clear();
        return false;
    }
    if (length < 3 || text[0] != '[' || text[length - 1] != ']' || (text[1] == '0' && length > 3))
        return false;
    *index = 0;
    for (Py_ssize_t at = 1; at < length - 1; at++) {
        if (text[at] < '0' || text[at] > '9' || *index >= CAPTAIN_UNKNOWN / 10 + 1)
            return false;
        *index = *index * 10 + (uint32_t)(text[at] - '0');
    }
    return *index < CAPTAIN_UNKNOWN;
}

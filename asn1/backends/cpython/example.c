/* Example messages: a legal message from fields by name, as a dict. */
#include "decode.h"
#include "errors.h"
#include "message.h"

/* Return the text of a field's value for captain_set; NULL with an exception. */
static PyObject *field_text(PyObject *name, PyObject *value)
{
    if (PyBool_Check(value))
        return PyUnicode_FromString(value == Py_True ? "true" : "false");
    if (PyLong_Check(value) || PyFloat_Check(value) || PyUnicode_Check(value))
        return PyObject_Str(value);
    PyObject *text = shown(value);
    PyObject *reason = text == NULL ? NULL : PyUnicode_FromFormat("%U is not a number, str or bool", text);
    Py_XDECREF(text);
    const char *path = PyUnicode_AsUTF8AndSize(name, NULL);
    if (path == NULL)
        Py_CLEAR(reason);
    return reason == NULL ? NULL : raise_reason(EncodeError, path, reason, NULL);
}

static bool set_field(const captain_message *message, void *struct_, PyObject *name, PyObject *value, captain_arena *arena)
{
    captain_report report;
    PyObject *text = field_text(name, value);
    const char *key = text == NULL ? NULL : PyUnicode_AsUTF8AndSize(name, NULL);
    const char *new = key == NULL ? NULL : PyUnicode_AsUTF8AndSize(text, NULL);
    bool is_good = new != NULL && captain_set(message, struct_, key, new, arena, &report) == CAPTAIN_OK;
    if (new != NULL && !is_good)
        raise_report(EncodeError, &report);
    Py_XDECREF(text);
    return is_good;
}

static bool set_fields(const captain_message *message, void *struct_, PyObject *fields, captain_arena *arena)
{
    PyObject *name, *value;
    Py_ssize_t at = 0;
    while (fields != NULL && PyDict_Next(fields, &at, &name, &value))
        if (!set_field(message, struct_, name, value, arena))
            return false;
    return true;
}

/* Raise the first constraint that the fields break. */
static bool is_legal(const captain_type *type, const void *struct_)
{
    captain_status status = captain_validate(type, struct_);
    if (status == CAPTAIN_OK)
        return true;
    captain_report report = {.status = status};
    if (captain_explain_value(type, struct_, true, &report) == CAPTAIN_OK)
        report = (captain_report){.status = status};
    raise_report(ValidateError, &report);
    return false;
}

PyObject *message_example(PyObject *self, PyObject *arguments, PyObject *fields)
{
    const captain_message *message = message_of(self)->message;
    memory memory;
    _Alignas(max_align_t) unsigned char first[SCRATCH];
    if (TUPLE_COUNT(arguments) != 0) {
        PyErr_SetString(PyExc_TypeError, "the fields of an example are keywords: example(speed=13.9)");
        return NULL;
    }
    memory_open(&memory, first, sizeof first, SIZE_MAX / 4);
    PyObject *dict = NULL;
    void *struct_ = captain_arena_take(&memory.arena, message->pdu->size);
    captain_status status = struct_ == NULL ? CAPTAIN_NO_MEMORY : captain_example(message, struct_, &memory.arena);
    if (status == CAPTAIN_NO_MEMORY)
        PyErr_NoMemory();
    else if (set_fields(message, struct_, fields, &memory.arena) && is_legal(message->pdu, struct_))
        dict = python_value(message_of(self)->shape, struct_);
    memory_close(&memory);
    return dict;
}

PyObject *message_short_names(PyObject *self, void *unused)
{
    (void)unused;
    const captain_message *message = message_of(self)->message;
    PyObject *dict = PyDict_New();
    for (unsigned i = 0; dict != NULL && i < message->short_names_count; i++) {
        PyObject *path = PyUnicode_FromString(message->short_names[i].path);
        if (path == NULL || PyDict_SetItemString(dict, message->short_names[i].name, path) < 0)
            Py_CLEAR(dict);
        Py_XDECREF(path);
    }
    return dict;
}

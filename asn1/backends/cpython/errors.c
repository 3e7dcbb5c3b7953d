#include "errors.h"

#include <string.h>

PyObject *DecodeError, *EncodeError, *ValidateError;

static PyObject *make_class(PyObject *module, const char *name, const char *full_name, const char *text, bool has_bit)
{
    PyObject *members = has_bit ? Py_BuildValue("{sssiss}", "path", "", "bit", 0, "reason", "")
                                : Py_BuildValue("{ssss}", "path", "", "reason", "");
    PyObject *class = members == NULL ? NULL : PyErr_NewExceptionWithDoc(full_name, text, PyExc_ValueError, members);
    Py_XDECREF(members);
    if (class != NULL && PyModule_AddObjectRef(module, name, class) < 0)
        Py_CLEAR(class);
    return class;
}

bool errors_add(PyObject *module)
{
    DecodeError = make_class(module, "DecodeError", "captain_messages.DecodeError",
                             "Octets that are no such message: path of the bad value, its first bit, the reason.", true);
    EncodeError = make_class(module, "EncodeError", "captain_messages.EncodeError",
                             "A value that is no such message: path of the bad value, the reason.", false);
    ValidateError = make_class(module, "ValidateError", "captain_messages.ValidateError",
                               "A message that breaks a constraint of its standard: path, reason.", false);
    return DecodeError != NULL && EncodeError != NULL && ValidateError != NULL;
}

/* ---------------------------------------------------------------- raising */

/* Steals references to message, path and reason. Any may be NULL, with an exception set. bit: negative if the class has none. */
static PyObject *raise(PyObject *class, PyObject *message, PyObject *path, PyObject *reason, long long bit)
{
    PyObject *error = message == NULL ? NULL : PyObject_CallFunctionObjArgs(class, message, NULL);
    PyObject *offset = bit < 0 ? NULL : PyLong_FromLongLong(bit);
    if (error != NULL && path != NULL && reason != NULL && PyObject_SetAttrString(error, "path", path) == 0
        && PyObject_SetAttrString(error, "reason", reason) == 0
        && (offset == NULL || PyObject_SetAttrString(error, "bit", offset) == 0))
        PyErr_SetObject(class, error);
    Py_XDECREF(offset);
    Py_XDECREF(error);
    Py_XDECREF(message);
    Py_XDECREF(path);
    Py_XDECREF(reason);
    return NULL;
}

static PyObject *text_of(const char *text)
{
    return PyUnicode_DecodeUTF8(text, (Py_ssize_t)strlen(text), "replace");
}

/* Return the sentence, after the words of the status if they add something. */
static PyObject *reason_of(const captain_report *report)
{
    const char *words = captain_status_text(report->status);
    PyObject *sentence = text_of(report->text);
    bool is_enough = strncmp(report->text, words, strlen(words)) == 0
                  || (report->status == CAPTAIN_PRESENCE && report->text[0] != 0); /* "is missing" */
    if (sentence == NULL || is_enough)
        return sentence;
    PyObject *reason = PyUnicode_FromFormat(report->text[0] == 0 ? "%s%U" : "%s: %U", words, sentence);
    Py_DECREF(sentence);
    return reason;
}

PyObject *raise_report(PyObject *error, const captain_report *report)
{
    bool has_bit = error == DecodeError;
    unsigned long long bit = report->bit;
    PyObject *path = text_of(report->path), *reason = reason_of(report), *message = NULL;
    const char *colon = report->path[0] == 0 ? "" : ": ";
    if (path != NULL && reason != NULL)
        message = has_bit ? PyUnicode_FromFormat("%U%sbit %llu: %U", path, colon, bit, reason)
                          : PyUnicode_FromFormat("%U%s%U", path, colon, reason);
    return raise(error, message, path, reason, has_bit ? (long long)bit : -1);
}

PyObject *raise_decode(const captain_type *type, const void *octets, size_t count, captain_status status, const memory *memory)
{
    captain_report report = {.status = status};
    if (memory->is_exhausted)
        return PyErr_NoMemory();
    if (status == CAPTAIN_NO_MEMORY || captain_explain_decode(type, octets, count, true, &report) == CAPTAIN_OK)
        report = (captain_report){.status = status};
    return raise_report(DecodeError, &report);
}

PyObject *raise_reason(PyObject *error, const char *path, PyObject *reason, PyObject *cause)
{
    PyObject *message = NULL, *path_text = text_of(path);
    if (path_text != NULL && reason != NULL)
        message = PyUnicode_FromFormat(path[0] == 0 ? "%U%U" : "%U: %U", path_text, reason);
    raise(error, message, path_text, reason, -1);
    if (cause != NULL) {
        PyObject *type, *value, *traceback;
        PyErr_Fetch(&type, &value, &traceback);
        PyErr_NormalizeException(&type, &value, &traceback);
        if (value != NULL)
            PyException_SetCause(value, cause);
        else
            Py_DECREF(cause);
        PyErr_Restore(type, value, traceback);
    }
    return NULL;
}

PyObject *raise_unheld(void)
{
    if (!PyErr_ExceptionMatches(PyExc_ValueError) && !PyErr_ExceptionMatches(PyExc_OverflowError))
        return NULL;
    PyObject *type, *value, *traceback;
    PyErr_Fetch(&type, &value, &traceback);
    PyErr_NormalizeException(&type, &value, &traceback);
    PyObject *reason = value == NULL ? NULL : PyObject_Str(value);
    Py_XDECREF(type);
    Py_XDECREF(value);
    Py_XDECREF(traceback);
    return raise(DecodeError, Py_XNewRef(reason), PyUnicode_FromString(""), reason, 0);
}

/* ---------------------------------------------------------------- words */

PyObject *class_name(PyObject *value)
{
    PyObject *class = Py_NewRef((PyObject *)Py_TYPE(value));
    PyObject *name = PyObject_GetAttrString(class, "__name__");
    Py_DECREF(class);
    if (name != NULL && PyUnicode_CheckExact(name))
        return name;
    PyErr_Clear(); /* a metaclass may raise any exception */
    Py_XDECREF(name);
    return PyUnicode_FromString("object");
}

static bool is_plain(PyObject *value)
{
    return value == Py_None || PyBool_Check(value) || PyLong_CheckExact(value) || PyFloat_CheckExact(value)
        || PyUnicode_CheckExact(value) || PyBytes_CheckExact(value);
}

enum { MAX_SHOWN = 60 }; /* limit in characters */

PyObject *shown(PyObject *value)
{
    PyObject *text = is_plain(value) ? PyObject_Repr(value) : NULL;
    if (text == NULL) { /* this also happens for an int with more digits than Python prints */
        PyErr_Clear();
        PyObject *name = class_name(value);
        text = name == NULL ? NULL : PyUnicode_FromFormat("a value of class %U", name);
        Py_XDECREF(name);
    }
    if (text == NULL || PyUnicode_GetLength(text) <= MAX_SHOWN)
        return text;
    PyObject *start = PyUnicode_Substring(text, 0, MAX_SHOWN);
    Py_DECREF(text);
    text = start == NULL ? NULL : PyUnicode_FromFormat("%U...", start);
    Py_XDECREF(start);
    return text;
}

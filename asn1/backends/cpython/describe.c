/* Methods for JSON, text and explanation, by the runtime's functions. */
#include "message.h"

#include <stdlib.h>
#include <string.h>

/* ---------------------------------------------------------------- text that grows */

/* Limit of memory, in octets per character of JSON: a list element takes at least two characters, and its struct some hundred
 * octets. */
enum { JSON_RATE = 1024 };

typedef struct buffer {
    char *text;
    size_t count, room;
} buffer;

static bool append(void *context, const char *text, size_t octets)
{
    buffer *buffer = context;
    if (octets > buffer->room - buffer->count) {
        size_t room = 2 * (buffer->count + octets) + 1024;
        char *larger = realloc(buffer->text, room);
        if (larger == NULL)
            return false;
        buffer->text = larger;
        buffer->room = room;
    }
    memcpy(buffer->text + buffer->count, text, octets);
    buffer->count += octets;
    return true;
}

typedef captain_status (*writer)(const captain_type *type, const void *value, captain_sink sink, void *context);

static PyObject *written(PyObject *self, PyObject *source, writer write)
{
    decoded decoded;
    buffer buffer = {0};
    if (!decoded_open(&decoded, message_of(self)->message, source))
        return NULL;
    PyObject *text = NULL;
    captain_report report = {.status = write(decoded.type, decoded.value, append, &buffer)};
    if (report.status == CAPTAIN_OK)
        text = PyUnicode_DecodeUTF8(buffer.count > 0 ? buffer.text : "", (Py_ssize_t)buffer.count, "replace");
    else if (report.status == CAPTAIN_NO_SPACE) /* the sink found no memory */
        PyErr_NoMemory();
    else
        raise_report(DecodeError, &report);
    free(buffer.text);
    decoded_close(&decoded);
    return text;
}

/* Read the arguments of to_json and from_json: one by position, and `plain` by name. */
static bool json_arguments(PyObject *const *arguments, Py_ssize_t count, PyObject *names, bool *is_plain)
{
    Py_ssize_t named = names == NULL ? 0 : TUPLE_COUNT(names);
    *is_plain = false;
    if (count != 1 || named > 1 || (named == 1 && PyUnicode_CompareWithASCIIString(TUPLE_ITEM(names, 0), "plain") != 0)) {
        PyErr_SetString(PyExc_TypeError, "one argument is expected, and optionally plain=True");
        return false;
    }
    int plain = named == 1 ? PyObject_IsTrue(arguments[1]) : 0;
    *is_plain = plain == 1;
    return plain >= 0;
}

PyObject *message_to_json(PyObject *self, PyObject *const *arguments, Py_ssize_t count, PyObject *names)
{
    bool is_plain;
    if (!json_arguments(arguments, count, names, &is_plain))
        return NULL;
    return written(self, arguments[0], is_plain ? captain_json_write_plain : captain_json_write);
}

PyObject *message_text(PyObject *self, PyObject *source)
{
    return written(self, source, captain_print);
}

PyObject *message_leaves(PyObject *self, PyObject *source)
{
    decoded decoded;
    buffer buffer = {0};
    if (!decoded_open(&decoded, message_of(self)->message, source))
        return NULL;
    PyObject *pair = NULL;
    uint32_t unknown;
    captain_report report = {.status = captain_leaves(decoded.type, decoded.value, append, &buffer, &unknown)};
    if (report.status == CAPTAIN_OK)
        pair = Py_BuildValue("y#I", buffer.count > 0 ? buffer.text : "", (Py_ssize_t)buffer.count, (unsigned)unknown);
    else if (report.status == CAPTAIN_NO_SPACE)
        PyErr_NoMemory();
    else
        raise_report(DecodeError, &report);
    free(buffer.text);
    decoded_close(&decoded);
    return pair;
}

/* ---------------------------------------------------------------- JSON to octets */

/* Return the UTF-8 text of a str or of bytes. */
static const char *json_text(PyObject *source, Py_ssize_t *count)
{
    if (PyUnicode_Check(source))
        return PyUnicode_AsUTF8AndSize(source, count);
    char *text = NULL;
    if (PyBytes_Check(source))
        PyBytes_AsStringAndSize(source, &text, count);
    else
        PyErr_SetString(PyExc_TypeError, "JSON is a str or bytes");
    return text;
}

static PyObject *read_json(const captain_type *type, PyObject *source, bool is_plain)
{
    memory memory;
    _Alignas(max_align_t) unsigned char first[SCRATCH];
    captain_report report = {0};
    Py_ssize_t count;
    const char *text = json_text(source, &count);
    if (text == NULL)
        return PyErr_ExceptionMatches(PyExc_UnicodeError)
            ? (PyErr_Clear(), raise_reason(EncodeError, "", PyUnicode_FromString("a lone surrogate, which UTF-8 has not"), NULL))
            : NULL;
    memory_open(&memory, first, sizeof first, type->size + 65536 + JSON_RATE * (size_t)count);
    void *value = captain_arena_take(&memory.arena, type->size);
    captain_status status = CAPTAIN_NO_MEMORY;
    if (value != NULL)
        status = (is_plain ? captain_json_read_plain : captain_json_read)(type, value, text, (size_t)count, &memory.arena, &report);
    if (report.status == CAPTAIN_OK)
        report.status = status;
    PyObject *octets = NULL;
    if (status == CAPTAIN_OK)
        octets = encoded(type, value);
    else if (memory.is_exhausted)
        PyErr_NoMemory();
    else
        raise_report(EncodeError, &report);
    memory_close(&memory);
    return octets;
}

PyObject *message_from_json(PyObject *self, PyObject *const *arguments, Py_ssize_t count, PyObject *names)
{
    bool is_plain;
    if (!json_arguments(arguments, count, names, &is_plain))
        return NULL;
    return read_json(message_of(self)->message->pdu, arguments[0], is_plain);
}

/* ---------------------------------------------------------------- bit by bit */

static PyTypeObject *Step;

static PyStructSequence_Field STEP_FIELDS[] = {
    {"what", "value, enter, leave, extension bit, presence, length, choice, open, unknown or padding"},
    {"bit", "offset in the message"},
    {"width", "bits taken"},
    {"path", "as in DecodeError"},
    {"name", "of the component; empty for elements and the PDU"},
    {"type", "name of the type; empty where it has none"},
    {"text", "the value with the names of special values"},
    {"unit", "of the value; empty where it has none"},
    {"clause", "of ITU-T X.691"},
    {0},
};
static PyStructSequence_Desc STEP = {"captain_messages.Step", "What some bits of a message say.", STEP_FIELDS, 9};

static const char *const WHAT[] = {
    [CAPTAIN_STEP_VALUE] = "value", [CAPTAIN_STEP_ENTER] = "enter", [CAPTAIN_STEP_LEAVE] = "leave",
    [CAPTAIN_STEP_EXTENSION_BIT] = "extension bit", [CAPTAIN_STEP_PRESENCE] = "presence", [CAPTAIN_STEP_LENGTH] = "length",
    [CAPTAIN_STEP_CHOICE] = "choice", [CAPTAIN_STEP_OPEN] = "open", [CAPTAIN_STEP_UNKNOWN] = "unknown",
    [CAPTAIN_STEP_PADDING] = "padding",
};

static PyObject *text_or_empty(const char *text)
{
    return PyUnicode_DecodeUTF8(text == NULL ? "" : text, text == NULL ? 0 : (Py_ssize_t)strlen(text), "replace");
}

static const char *unit_of(const captain_step *step)
{
    if (step->field != NULL && step->field->unit != NULL)
        return step->field->unit;
    return step->type == NULL ? NULL : step->type->unit;
}

static bool add_step(void *context, const captain_step *step)
{
    PyObject *const members[] = {
        text_or_empty(WHAT[step->what]), PyLong_FromSize_t(step->bit), PyLong_FromSize_t(step->width),
        text_or_empty(step->path), text_or_empty(step->field == NULL ? NULL : step->field->name),
        text_or_empty(step->type == NULL ? NULL : step->type->name), text_or_empty(step->text),
        text_or_empty(unit_of(step)), text_or_empty(step->clause),
    };
    PyObject *new = PyStructSequence_New(Step);
    bool is_good = new != NULL;
    for (Py_ssize_t index = 0; index < (Py_ssize_t)(sizeof members / sizeof *members); index++) {
        is_good = is_good && members[index] != NULL;
        if (new != NULL)
            PyStructSequence_SetItem(new, index, members[index]);
        else
            Py_XDECREF(members[index]);
    }
    is_good = is_good && PyList_Append(context, new) == 0;
    Py_XDECREF(new);
    return is_good;
}

PyObject *message_explain(PyObject *self, PyObject *source)
{
    octets octets;
    captain_report report;
    if (!octets_open(&octets, source))
        return NULL;
    PyObject *steps = PyList_New(0);
    if (steps != NULL)
        captain_explain(message_of(self)->message->pdu, octets.data, octets.count, add_step, steps, &report);
    octets_close(&octets);
    if (PyErr_Occurred())
        Py_CLEAR(steps);
    return steps;
}

bool describe_add(PyObject *module)
{
    Step = PyStructSequence_NewType(&STEP);
    return Step != NULL && PyModule_AddObjectRef(module, "Step", (PyObject *)Step) == 0;
}

/* Octets to serialised ROS 2 messages, and back. */
#include "ros2.h"

#include <captain/ros2.h>

#include <stdlib.h>
#include <string.h>

static PyObject *CdrError;
static PyTypeObject *LeftOut;

static PyStructSequence_Field LEFT_OUT_FIELDS[] = {
    {"path", "of the part in the message, as in DecodeError"},
    {"octets", "its encoding; empty where it is a number or an item"},
    {0},
};
static PyStructSequence_Desc LEFT_OUT = {"captain_messages.LeftOut", "A part of a message that its ROS 2 message has no place for.",
                                         LEFT_OUT_FIELDS, 2};

/* ---------------------------------------------------------------- arguments */

enum { MOST = 3 };

/* Sort positional and named arguments into `values`; missing ones are NULL. */
static bool take_arguments(const char *function, const char *const *wanted, int most, PyObject *const *arguments, Py_ssize_t count,
                           PyObject *names, PyObject **values)
{
    Py_ssize_t named = names == NULL ? 0 : TUPLE_COUNT(names);
    if (count > most) {
        PyErr_Format(PyExc_TypeError, "%s() takes at most %d arguments (%zd given)", function, most, count);
        return false;
    }
    for (int index = 0; index < most; index++)
        values[index] = index < count ? arguments[index] : NULL;
    for (Py_ssize_t number = 0; number < named; number++) {
        int index = 0;
        while (index < most && PyUnicode_CompareWithASCIIString(TUPLE_ITEM(names, number), wanted[index]) != 0)
            index++;
        if (index == most || values[index] != NULL) {
            PyErr_Format(PyExc_TypeError, "%s() got an unexpected or a second argument %R", function, TUPLE_ITEM(names, number));
            return false;
        }
        values[index] = arguments[count + number];
    }
    return true;
}

static const captain_ros2 *no_ros2(const captain_message *message, const char *profile)
{
    PyErr_Format(PyExc_LookupError, "no ROS 2 message for %s%s%s in this module: generate it with --ros2", message->name,
                 profile == NULL ? "" : " in the profile ", profile == NULL ? "" : profile);
    return NULL;
}

/* Return the entry of a profile; without a profile the first one. NULL with LookupError or TypeError. */
static const captain_ros2 *ros2_of(PyObject *self, PyObject *profile)
{
    const captain_message *message = message_of(self)->message;
    const captain_ros2 *ros2 = message_of(self)->ros2;
    if (profile == NULL || profile == Py_None)
        return ros2 != NULL ? ros2 : no_ros2(message, NULL);
    const char *text = PyUnicode_Check(profile) ? PyUnicode_AsUTF8AndSize(profile, NULL) : NULL;
    if (text == NULL) {
        if (!PyErr_Occurred())
            PyErr_SetString(PyExc_TypeError, "the name of a profile is a str");
        return NULL;
    }
    if (ros2 == NULL || strcmp(ros2->profile, text) != 0)
        ros2 = captain_find_ros2(message->name, text);
    return ros2 != NULL ? ros2 : no_ros2(message, text);
}

PyObject *message_ros2_type(PyObject *self, PyObject *const *arguments, Py_ssize_t count, PyObject *names)
{
    static const char *const WANTED[] = {"profile"};
    PyObject *values[1];
    if (!take_arguments("ros2_type", WANTED, 1, arguments, count, names, values))
        return NULL;
    const captain_ros2 *ros2 = ros2_of(self, values[0]);
    return ros2 == NULL ? NULL : PyUnicode_FromString(ros2->type);
}

/* ---------------------------------------------------------------- octets to CDR */

static PyObject *raise_large(void)
{
    PyErr_SetString(PyExc_ValueError, "the ROS 2 message would have more than 16 MB");
    return NULL;
}

/* Write into the stack; if it is too small, write again into bytes of the known size. */
static PyObject *cdr_of(const captain_ros2 *ros2, const void *value, bool is_large, size_t *left_out)
{
    unsigned char cdr[LARGE];
    size_t octets;
    captain_status status = captain_to_cdr(ros2, value, cdr, sizeof cdr, &octets, left_out);
    if (status == CAPTAIN_OK)
        return PyBytes_FromStringAndSize((const char *)cdr, (Py_ssize_t)octets);
    if (status == CAPTAIN_LENGTH)
        return raise_large();
    PyObject *bytes = PyBytes_FromStringAndSize(NULL, (Py_ssize_t)octets);
    if (bytes == NULL)
        return NULL;
    char *into = PyBytes_AsString(bytes);
    if (is_large) {
        Py_BEGIN_ALLOW_THREADS
        captain_to_cdr(ros2, value, into, octets, &octets, left_out);
        Py_END_ALLOW_THREADS
    } else {
        captain_to_cdr(ros2, value, into, octets, &octets, left_out);
    }
    return bytes;
}

/* Encode a part, if its type can be encoded separately; otherwise return empty bytes, without an exception. */
static PyObject *octets_of(const captain_type *type, const void *value)
{
    const captain_open *open = value;
    if (type != NULL && type->kind == CAPTAIN_OPEN) {
        type = open->type;
        if (type == NULL)
            return PyBytes_FromStringAndSize((const char *)open->octets.octets, (Py_ssize_t)open->octets.count);
        value = open->value;
    }
    if (type == NULL) {
        const captain_addition *addition = value;
        return PyBytes_FromStringAndSize((const char *)addition->octets.octets, (Py_ssize_t)addition->octets.count);
    }
    PyObject *bytes = type->encode == NULL ? NULL : encoded(type, value);
    if (bytes != NULL || PyErr_ExceptionMatches(PyExc_MemoryError))
        return bytes;
    PyErr_Clear();
    return PyBytes_FromStringAndSize("", 0);
}

static bool add_left_out(void *context, const char *path, const captain_type *type, const void *value)
{
    PyObject *entry = PyStructSequence_New(LeftOut);
    PyObject *text = PyUnicode_DecodeUTF8(path, (Py_ssize_t)strlen(path), "replace"), *octets = octets_of(type, value);
    bool is_good = entry != NULL && text != NULL && octets != NULL;
    if (is_good) {
        PyStructSequence_SetItem(entry, 0, text);
        PyStructSequence_SetItem(entry, 1, octets);
        is_good = PyList_Append(context, entry) == 0;
    } else {
        Py_XDECREF(text);
        Py_XDECREF(octets);
    }
    Py_XDECREF(entry);
    return is_good;
}

static PyObject *left_out_of(const captain_ros2 *ros2, const void *value, PyObject *cdr, size_t count)
{
    if (count == 0)
        return PyTuple_New(0);
    PyObject *list = PyList_New(0);
    if (list == NULL)
        return NULL;
    captain_cdr_left_out(ros2, value, PyBytes_AsString(cdr), (size_t)PyBytes_Size(cdr), add_left_out, list);
    PyObject *tuple = PyErr_Occurred() ? NULL : PyList_AsTuple(list);
    Py_DECREF(list);
    return tuple;
}

PyObject *message_to_cdr(PyObject *self, PyObject *const *arguments, Py_ssize_t count, PyObject *names)
{
    static const char *const WANTED[] = {"octets", "profile"};
    PyObject *values[2];
    decoded decoded;
    size_t left_count;
    if (!take_arguments("to_cdr", WANTED, 2, arguments, count, names, values))
        return NULL;
    if (values[0] == NULL) {
        PyErr_SetString(PyExc_TypeError, "to_cdr() needs octets");
        return NULL;
    }
    const captain_ros2 *ros2 = ros2_of(self, values[1]);
    if (ros2 == NULL || !decoded_open(&decoded, message_of(self)->message, values[0]))
        return NULL;
    PyObject *cdr = cdr_of(ros2, decoded.value, decoded.octets.count > LARGE, &left_count);
    PyObject *left_out = cdr == NULL ? NULL : left_out_of(ros2, decoded.value, cdr, left_count);
    decoded_close(&decoded);
    PyObject *both = left_out == NULL ? NULL : PyTuple_Pack(2, cdr, left_out);
    Py_XDECREF(cdr);
    Py_XDECREF(left_out);
    return both;
}

/* ---------------------------------------------------------------- CDR to octets */

static PyObject *raise_cdr(const captain_report *report)
{
    size_t octet = report->bit / 8;
    const char *colon = report->path[0] == 0 ? "" : ": ", *words = captain_status_text(report->status);
    bool is_said = strncmp(report->text, words, strlen(words)) == 0 || report->status == CAPTAIN_SYNTAX;
    PyObject *path = PyUnicode_FromString(report->path);
    PyObject *reason = PyUnicode_FromFormat("%s%s%s", is_said ? "" : words, is_said ? "" : ": ", report->text);
    PyObject *text = reason == NULL ? NULL : PyUnicode_FromFormat("%s%soctet %zu: %U", report->path, colon, octet, reason);
    PyObject *error = text == NULL ? NULL : PyObject_CallFunctionObjArgs(CdrError, text, NULL);
    PyObject *number = PyLong_FromSize_t(octet);
    if (error != NULL && path != NULL && number != NULL && PyObject_SetAttrString(error, "path", path) == 0
        && PyObject_SetAttrString(error, "octet", number) == 0 && PyObject_SetAttrString(error, "reason", reason) == 0)
        PyErr_SetObject(CdrError, error);
    Py_XDECREF(number);
    Py_XDECREF(error);
    Py_XDECREF(text);
    Py_XDECREF(reason);
    Py_XDECREF(path);
    return NULL;
}

typedef struct readable {
    memory memory;
    void *value;
    captain_report report;
    _Alignas(max_align_t) unsigned char first[SCRATCH];
} readable;

/* Read CDR, without the GIL for large ones. Returns false with MemoryError, or with the error in the report. */
static bool read_cdr(readable *into, const captain_ros2 *ros2, const octets *cdr, bool takes_unknown)
{
    captain_status status = CAPTAIN_NO_MEMORY;
    memory *memory = &into->memory;
    memory_open(memory, into->first, sizeof into->first, ros2->pdu->size + 65536 + 2 * (size_t)ros2->arena * cdr->count);
    into->value = captain_arena_take(&memory->arena, ros2->pdu->size);
    if (into->value != NULL && (cdr->count <= LARGE || !cdr->is_constant)) {
        status = captain_from_cdr(ros2, into->value, cdr->data, cdr->count, takes_unknown, &memory->arena, &into->report);
    } else if (into->value != NULL) {
        Py_BEGIN_ALLOW_THREADS
        status = captain_from_cdr(ros2, into->value, cdr->data, cdr->count, takes_unknown, &memory->arena, &into->report);
        Py_END_ALLOW_THREADS
    }
    if (into->value == NULL || memory->is_exhausted)
        PyErr_NoMemory();
    return status == CAPTAIN_OK;
}

/* Return NULL with CdrError, or with EncodeError for an invalid value that no field of the ROS message contains. */
static PyObject *octets_from_cdr(const captain_ros2 *ros2, const octets *cdr)
{
    readable readable;
    PyObject *result = NULL;
    if (read_cdr(&readable, ros2, cdr, false))
        result = encoded(ros2->pdu, readable.value);
    else if (!PyErr_Occurred())
        raise_cdr(&readable.report);
    memory_close(&readable.memory);
    return result;
}

/* Read and write CDR again, which clears padding and the fields of absent components. Returns NULL without an exception if it
 * is invalid; then octets_from_cdr reports the error. */
static PyObject *written_again(const captain_ros2 *ros2, const octets *cdr)
{
    readable readable;
    size_t left_count;
    PyObject *result = NULL;
    if (read_cdr(&readable, ros2, cdr, true))
        result = cdr_of(ros2, readable.value, cdr->is_constant && cdr->count > LARGE, &left_count);
    memory_close(&readable.memory);
    return result;
}

static bool are_equal(PyObject *bytes, const octets *octets)
{
    return (size_t)BYTES_COUNT(bytes) == octets->count && memcmp(BYTES_DATA(bytes), octets->data, octets->count) == 0;
}

/* Return whether a CDR equals the one of a message. -1 with an exception if the message is invalid. */
static int says_the_same(const captain_message *message, const captain_ros2 *ros2, const octets *cdr, PyObject *original)
{
    decoded decoded;
    size_t left_count;
    if (!decoded_open(&decoded, message, original))
        return -1;
    PyObject *before = cdr_of(ros2, decoded.value, decoded.octets.count > LARGE, &left_count);
    decoded_close(&decoded);
    if (before == NULL)
        return -1;
    int is_same = are_equal(before, cdr);
    PyObject *again = is_same ? NULL : written_again(ros2, cdr);
    if (again != NULL)
        is_same = BYTES_COUNT(again) == BYTES_COUNT(before)
               && memcmp(BYTES_DATA(again), BYTES_DATA(before), (size_t)BYTES_COUNT(again)) == 0;
    else if (PyErr_Occurred())
        is_same = -1;
    Py_XDECREF(again);
    Py_DECREF(before);
    return is_same;
}

PyObject *message_from_cdr(PyObject *self, PyObject *const *arguments, Py_ssize_t count, PyObject *names)
{
    static const char *const WANTED[MOST] = {"cdr", "profile", "original"};
    PyObject *values[MOST], *result = NULL;
    octets cdr;
    if (!take_arguments("from_cdr", WANTED, MOST, arguments, count, names, values))
        return NULL;
    if (values[0] == NULL) {
        PyErr_SetString(PyExc_TypeError, "from_cdr() needs octets");
        return NULL;
    }
    const captain_ros2 *ros2 = ros2_of(self, values[1]);
    if (ros2 == NULL || !octets_open(&cdr, values[0]))
        return NULL;
    int is_same = 0;
    if (values[2] != NULL && values[2] != Py_None)
        is_same = says_the_same(message_of(self)->message, ros2, &cdr, values[2]);
    if (is_same == 0)
        result = octets_from_cdr(ros2, &cdr);
    else if (is_same > 0)
        result = PyBytes_FromObject(values[2]);
    octets_close(&cdr);
    return result;
}

/* ---------------------------------------------------------------- names of the module */

bool ros2_add(PyObject *module)
{
    PyObject *members = Py_BuildValue("{sssiss}", "path", "", "octet", 0, "reason", "");
    CdrError = members == NULL ? NULL
                               : PyErr_NewExceptionWithDoc("captain_messages.CdrError",
                                                           "Octets that are no such ROS 2 message: path of the field, its octet, the reason.",
                                                           PyExc_ValueError, members);
    Py_XDECREF(members);
    LeftOut = PyStructSequence_NewType(&LEFT_OUT);
    return CdrError != NULL && LeftOut != NULL && PyModule_AddObjectRef(module, "CdrError", CdrError) == 0
        && PyModule_AddObjectRef(module, "LeftOut", (PyObject *)LeftOut) == 0;
}

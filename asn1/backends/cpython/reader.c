/* Readers: return the values at some paths of a message, without creating the enclosing views and dicts. */
#include "decode.h"
#include "errors.h"
#include "message.h"
#include "view.h"
#include "walk.h"

#include <string.h>

typedef enum step_kind { PLAIN, COMPONENT, ALTERNATIVE, ELEMENT } step_kind;

/* One step from a value to an inner one. Consecutive components that are always present form a single step. */
typedef struct step {
    step_kind kind;
    uint32_t number;  /* PLAIN: offset in octets; ALTERNATIVE: from 1; ELEMENT: from 0 */
    const slot *slot; /* COMPONENT, ALTERNATIVE */
    size_t size;      /* ELEMENT: octets of one element */
} step;

typedef struct path {
    const shape *shape; /* shape of the value at its end */
    step *steps;
    size_t count;
} path;

typedef struct reader {
    PyObject_HEAD
    const message *message; /* held */
    Py_ssize_t count;
    path paths[];
} reader;

static PyTypeObject *Reader;

/* ---------------------------------------------------------------- reading */

/* Return the inner value; NULL if it is absent. */
static inline const unsigned char *stepped(const step *step, const unsigned char *value)
{
    switch (step->kind) {
    case PLAIN:
        return value + step->number;
    case COMPONENT:
        if (slot_is_absent(step->slot, value))
            return step->slot->has_default ? step->slot->field->default_value : NULL;
        return slot_value(step->slot, value);
    case ALTERNATIVE:
        return AT(uint32_t, value) == step->number ? slot_value(step->slot, value) : NULL;
    default:
        return step->number < AT(captain_list, value).count
                   ? (const unsigned char *)AT(captain_list, value).items + step->number * step->size
                   : NULL;
    }
}

static inline PyObject *value_at(const path *path, const unsigned char *value)
{
    for (const step *step = path->steps, *end = step + path->count; step < end && value != NULL; step++)
        value = stepped(step, value);
    return value == NULL ? Py_NewRef(Py_None) : quick_value(path->shape, value);
}

static PyObject *values_of(const reader *reader, const unsigned char *value)
{
    PyObject *values = PyTuple_New(reader->count);
    for (Py_ssize_t index = 0; values != NULL && index < reader->count; index++) {
        PyObject *one = value_at(&reader->paths[index], value);
        if (one == NULL)
            Py_CLEAR(values);
        else
            TUPLE_SET(values, index, one);
    }
    return values != NULL ? values : raise_unheld();
}

static PyObject *reader_read(PyObject *self, PyObject *source)
{
    const reader *reader = (const struct reader *)(const void *)self;
    const view *view = PyBytes_CheckExact(source) ? NULL : view_check(source);
    if (view != NULL && view->shape == reader->message->shape)
        return values_of(reader, view->value);
    decoded decoded;
    if (!decoded_open(&decoded, reader->message->message, source))
        return NULL;
    PyObject *values = values_of(reader, decoded.value);
    decoded_close(&decoded);
    return values;
}

/* ---------------------------------------------------------------- paths */

static bool refuse_path(PyObject *text, PyObject *why)
{
    if (why != NULL)
        PyErr_Format(PyExc_ValueError, "path %R: %U", text, why);
    Py_XDECREF(why);
    return false;
}

static void add_plain(path *path, uint32_t octets)
{
    step *last = path->count > 0 ? &path->steps[path->count - 1] : NULL;
    if (last != NULL && last->kind == PLAIN)
        last->number += octets;
    else
        path->steps[path->count++] = (step){.kind = PLAIN, .number = octets};
}

/* Parse a component of a SEQUENCE or an alternative of a CHOICE. */
static bool enter_name(path *path, PyObject *text, const char *name, size_t length)
{
    const shape *shape = path->shape;
    bool is_choice = shape->op == OP_CHOICE;
    if (shape->op != OP_SEQUENCE && !is_choice)
        return refuse_path(text, PyUnicode_FromFormat("%s has no components", captain_type_text(shape->type)));
    PyObject *key = PyUnicode_FromStringAndSize(name, (Py_ssize_t)length);
    Py_ssize_t index = key == NULL ? -1 : slot_find_attribute(shape, key);
    if (key != NULL && index < 0) {
        PyObject *nearest = suggestion(shape->type, key);
        const char *what = is_choice ? "alternative" : "component";
        if (nearest != NULL)
            refuse_path(text, PyUnicode_FromFormat("%s has no %s '%U'%U", captain_type_text(shape->type), what, key, nearest));
        Py_XDECREF(nearest);
    }
    Py_XDECREF(key);
    if (index < 0)
        return false;
    const slot *slot = &shape->slots[index];
    if (is_choice)
        path->steps[path->count++] = (step){.kind = ALTERNATIVE, .number = (uint32_t)index + 1, .slot = slot};
    else if (slot->is_plain)
        add_plain(path, slot->offset);
    else
        path->steps[path->count++] = (step){.kind = COMPONENT, .slot = slot};
    path->shape = slot->shape;
    return true;
}

/* Parse "[12]": an element of a SEQUENCE OF. */
static bool enter_element(path *path, PyObject *text, const char *digits, size_t length)
{
    const shape *shape = path->shape;
    uint32_t number = 0;
    if (shape->op != OP_LIST)
        return refuse_path(text, PyUnicode_FromFormat("%s has no elements", captain_type_text(shape->type)));
    bool is_number = 0 < length && length <= 9 && digits[length] == ']';
    for (size_t index = 0; is_number && index < length; index++) {
        is_number = '0' <= digits[index] && digits[index] <= '9';
        number = 10 * number + (uint32_t)(digits[index] - '0');
    }
    if (!is_number)
        return refuse_path(text, PyUnicode_FromString("an element is a number from 0 on in brackets, as in intersections[0]"));
    path->steps[path->count++] = (step){.kind = ELEMENT, .number = number, .size = shape->element->type->size};
    path->shape = shape->element;
    return true;
}

/* Parse a path: name.name[0].name */
static bool path_parse(path *path, PyObject *text)
{
    Py_ssize_t octets = 0;
    const char *next = PyUnicode_Check(text) ? PyUnicode_AsUTF8AndSize(text, &octets) : NULL;
    if (next == NULL || strlen(next) != (size_t)octets)
        return PyErr_Occurred() ? false : refuse_path(text, PyUnicode_FromString("a path is a str without NUL"));
    path->steps = PyMem_Malloc((size_t)(octets + 1) * sizeof *path->steps); /* a step has at least one character */
    if (path->steps == NULL) {
        PyErr_NoMemory();
        return false;
    }
    bool is_good = true;
    for (const char *start = next; is_good && (next == start || *next != '\0');) {
        bool is_element = *next == '[', is_joined = next != start && !is_element && *next == '.';
        if (next != start && !is_element && !is_joined)
            return refuse_path(text, PyUnicode_FromString("a component behind an element is joined by '.'"));
        next += is_element || is_joined;
        size_t length = strcspn(next, is_element ? "]" : ".[");
        is_good = is_element ? enter_element(path, text, next, length) : enter_name(path, text, next, length);
        next += length + (is_element && next[length] == ']');
    }
    return is_good;
}

/* ---------------------------------------------------------------- objects */

static void reader_dealloc(PyObject *self)
{
    reader *reader = (struct reader *)(void *)self;
    PyTypeObject *class = Py_TYPE(self);
    for (Py_ssize_t index = 0; index < reader->count; index++)
        PyMem_Free(reader->paths[index].steps);
    Py_XDECREF((PyObject *)(void *)reader->message);
    PyObject_Free(self);
    Py_DECREF(class);
}

static PyMethodDef READ = {"read", reader_read, METH_O, "Octets or a view to the values at the reader's paths, None where nothing is."};

/* A function in place of a callable object, whose call costs 20 ns more. */
PyObject *message_reader(PyObject *self, PyObject *paths)
{
    Py_ssize_t count = TUPLE_COUNT(paths);
    if (count == 0) {
        PyErr_SetString(PyExc_ValueError, "a reader reads one path at least, such as 'header.stationID'");
        return NULL;
    }
    reader *new = PyObject_Malloc(sizeof *new + (size_t)count * sizeof *new->paths);
    if (new == NULL)
        return PyErr_NoMemory();
    PyObject_Init((PyObject *)(void *)new, Reader);
    new->message = (const message *)(void *)Py_NewRef(self);
    bool is_good = true;
    for (new->count = 0; is_good && new->count < count; new->count++) {
        path *path = &new->paths[new->count];
        *path = (struct path){.shape = new->message->shape};
        is_good = path_parse(path, TUPLE_ITEM(paths, new->count));
    }
    PyObject *read = is_good ? PyCFunction_New(&READ, (PyObject *)(void *)new) : NULL;
    Py_DECREF((PyObject *)(void *)new);
    return read;
}

static PyType_Slot SLOTS[] = {{Py_tp_dealloc, reader_dealloc}, {Py_tp_doc, "What a reader's function knows."}, {0}};
static PyType_Spec SPEC = {.name = "captain_messages.Reader", .basicsize = (int)sizeof(reader),
                           .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_IMMUTABLETYPE | Py_TPFLAGS_DISALLOW_INSTANTIATION,
                           .slots = SLOTS};

bool readers_add(void)
{
    Reader = (PyTypeObject *)PyType_FromSpec(&SPEC);
    return Reader != NULL;
}

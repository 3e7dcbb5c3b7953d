#include "message.h"
#include "decode.h"
#include "view.h"
#include "walk.h"

#include <stdlib.h>

/* ---------------------------------------------------------------- octets to a value in memory */

captain_status decode_octets(const captain_type *type, void *value, const octets *octets, captain_arena *arena)
{
    captain_status status;
    if (octets->count <= LARGE || !octets->is_constant)
        return captain_decode_exact(type, value, octets->data, octets->count, arena);
    Py_BEGIN_ALLOW_THREADS
    status = captain_decode_exact(type, value, octets->data, octets->count, arena);
    Py_END_ALLOW_THREADS
    return status;
}

bool decoded_open(decoded *decoded, const captain_type *type, PyObject *source)
{
    memory *memory = &decoded->memory;
    if (!octets_open(&decoded->octets, source))
        return false;
    size_t count = decoded->octets.count;
    memory_open(memory, decoded->first, sizeof decoded->first, DECODE_BUDGET(type, count));
    decoded->type = type;
    decoded->value = captain_arena_take(&memory->arena, type->size);
    captain_status status = CAPTAIN_NO_MEMORY;
    if (decoded->value != NULL)
        status = decode_octets(type, decoded->value, &decoded->octets, &memory->arena);
    if (status == CAPTAIN_OK)
        return true;
    raise_decode(type, decoded->octets.data, count, status, memory);
    decoded_close(decoded);
    return false;
}

void decoded_close(decoded *decoded)
{
    memory_close(&decoded->memory);
    octets_close(&decoded->octets);
}

static const message *of(PyObject *self)
{
    return (const message *)(const void *)self;
}

static PyObject *message_decode(PyObject *self, PyObject *source)
{
    decoded decoded;
    if (!decoded_open(&decoded, of(self)->message->pdu, source))
        return NULL;
    PyObject *dict = python_value(of(self)->shape, decoded.value);
    decoded_close(&decoded);
    return dict != NULL ? dict : raise_unheld();
}

static PyObject *message_view(PyObject *self, PyObject *source)
{
    const captain_type *type = of(self)->message->pdu;
    octets octets;
    PyObject *view = NULL;
    if (!octets_open(&octets, source))
        return NULL;
    storage *storage = storage_new(type, octets.count);
    if (storage != NULL) {
        void *value = captain_arena_take(&storage->memory.arena, type->size);
        captain_status status = decode_octets(type, value, &octets, &storage->memory.arena);
        view = status == CAPTAIN_OK ? view_new(of(self)->shape, value, storage)
                                    : raise_decode(type, octets.data, octets.count, status, &storage->memory);
        storage_release(storage);
    }
    octets_close(&octets);
    return view;
}

/* ---------------------------------------------------------------- a value in memory to octets */

static PyObject *encoded_bytes(const unsigned char *octets, size_t bits)
{
    return PyBytes_FromStringAndSize((const char *)octets, bits == 0 ? 1 : (Py_ssize_t)octets_of_bits(bits));
}

static captain_status encode_large(const captain_type *type, const void *value, PyObject **result)
{
    captain_status status = CAPTAIN_NO_SPACE;
    for (size_t room = (size_t)1 << 16; status == CAPTAIN_NO_SPACE && room < SIZE_MAX / 16; room *= 8) {
        size_t bits;
        unsigned char *octets = malloc(room);
        if (octets == NULL) {
            PyErr_NoMemory();
            return CAPTAIN_NO_MEMORY;
        }
        Py_BEGIN_ALLOW_THREADS
        status = captain_encode(type, value, octets, room, &bits);
        Py_END_ALLOW_THREADS
        if (status == CAPTAIN_OK)
            *result = encoded_bytes(octets, bits);
        free(octets);
    }
    return status;
}

PyObject *encoded(const captain_type *type, const void *value)
{
    unsigned char octets[LARGE];
    size_t bits;
    PyObject *result = NULL;
    captain_status status = captain_encode(type, value, octets, sizeof octets, &bits);
    if (status == CAPTAIN_OK)
        return encoded_bytes(octets, bits);
    if (status == CAPTAIN_NO_SPACE)
        status = encode_large(type, value, &result);
    if (status == CAPTAIN_OK || PyErr_Occurred())
        return result;
    captain_report report = {.status = status};
    if (captain_explain_value(type, value, false, &report) == CAPTAIN_OK)
        report = (captain_report){.status = status};
    return raise_report(EncodeError, &report);
}

/* The struct that a dict or a view stands for; NULL and `error`. */
static const void *struct_of(maker *maker, const shape *shape, PyObject *value, PyObject *error)
{
    const view *view = view_check(value);
    if (view != NULL && view->shape == shape)
        return view->value;
    void *struct_ = maker_take(maker, shape->type->size);
    if (struct_ != NULL && value_from(maker, shape, value, struct_))
        return struct_;
    maker_raise(maker, error);
    return NULL;
}

static PyObject *message_encode(PyObject *self, PyObject *value)
{
    maker maker;
    _Alignas(max_align_t) unsigned char first[SCRATCH];
    maker_open(&maker, first, sizeof first);
    const void *struct_ = struct_of(&maker, of(self)->shape, value, EncodeError);
    PyObject *octets = struct_ == NULL ? NULL : encoded(of(self)->message->pdu, struct_);
    maker_close(&maker);
    return octets;
}

/* ---------------------------------------------------------------- validate */

static PyObject *validated(const captain_type *type, const void *value)
{
    captain_status status = captain_validate(type, value);
    if (status == CAPTAIN_OK)
        Py_RETURN_NONE;
    captain_report report = {.status = status};
    if (captain_explain_value(type, value, true, &report) == CAPTAIN_OK)
        report = (captain_report){.status = status};
    return raise_report(ValidateError, &report);
}

static PyObject *validate_octets(const captain_type *type, PyObject *source)
{
    decoded decoded;
    if (!decoded_open(&decoded, type, source))
        return NULL;
    PyObject *result = validated(type, decoded.value);
    decoded_close(&decoded);
    return result;
}

static PyObject *message_validate(PyObject *self, PyObject *value)
{
    maker maker;
    _Alignas(max_align_t) unsigned char first[SCRATCH];
    if (PyBytes_Check(value) || PyByteArray_Check(value) || PyMemoryView_Check(value))
        return validate_octets(of(self)->message->pdu, value);
    maker_open(&maker, first, sizeof first);
    const void *struct_ = struct_of(&maker, of(self)->shape, value, ValidateError);
    PyObject *result = struct_ == NULL ? NULL : validated(of(self)->message->pdu, struct_);
    maker_close(&maker);
    return result;
}

/* ---------------------------------------------------------------- the class */

static PyMethodDef METHODS[] = {
    {"decode", message_decode, METH_O, "Octets to a dict. Raises DecodeError."},
    {"view", message_view, METH_O, "Octets to a view, whose values are made when they are touched. Raises DecodeError."},
    {"encode", message_encode, METH_O, "A dict or view to octets. Raises EncodeError."},
    {"validate", message_validate, METH_O, "Every constraint of the standard on a dict, view or octets. Raises ValidateError."},
    {"to_json", message_to_json, METH_O, "Octets to JSON (X.697). Raises DecodeError."},
    {"from_json", message_from_json, METH_O, "JSON (X.697) to octets. Raises EncodeError."},
    {"text", message_text, METH_O, "Octets to an indented tree with units and meanings. Raises DecodeError."},
    {"explain", message_explain, METH_O, "Octets to a list of Step, bit by bit, as far as they decode."},
    {"type_tree", message_type_tree, METH_NOARGS, "The PDU's Type."},
    {0},
};

#define MEMBER(index, name) {name, T_OBJECT, (Py_ssize_t)(offsetof(message, members) + (index) * sizeof(PyObject *)), READONLY, NULL}
static PyMemberDef ATTRIBUTES[] = {
    MEMBER(0, "name"), MEMBER(1, "type"), MEMBER(2, "release"), MEMBER(3, "standard"), MEMBER(4, "module"), MEMBER(5, "pdu"),
    MEMBER(6, "ids"), MEMBER(7, "versions"), MEMBER(8, "btp_port"), MEMBER(9, "rank"), MEMBER(10, "is_experimental"), {0},
};

static PyObject *message_repr(PyObject *self)
{
    return PyUnicode_FromFormat("<message %s of %s>", of(self)->message->name, of(self)->message->standard);
}

static void message_dealloc(PyObject *self)
{
    PyTypeObject *class = Py_TYPE(self);
    for (int index = 0; index < MEMBERS; index++)
        Py_XDECREF(((message *)self)->members[index]);
    PyObject_Free(self);
    Py_DECREF(class);
}

static PyType_Slot SLOTS[] = {{Py_tp_dealloc, message_dealloc}, {Py_tp_repr, message_repr}, {Py_tp_methods, METHODS},
                              {Py_tp_members, ATTRIBUTES}, {Py_tp_doc, "One PDU of one edition of a standard."}, {0}};
static PyType_Spec SPEC = {.name = "captain_messages.Message", .basicsize = (int)sizeof(message),
                           .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_DISALLOW_INSTANTIATION, .slots = SLOTS};

static PyObject *numbers(const uint8_t *list, uint8_t count)
{
    PyObject *tuple = PyTuple_New(count);
    for (uint8_t index = 0; tuple != NULL && index < count; index++)
        TUPLE_SET(tuple, index, PyLong_FromLong(list[index]));
    return tuple;
}

static PyObject *message_new(PyTypeObject *class, const captain_message *description)
{
    message *new = PyObject_New(message, class);
    if (new == NULL)
        return NULL;
    PyObject *const members[MEMBERS] = {
        PyUnicode_InternFromString(description->name), PyUnicode_InternFromString(description->type),
        PyLong_FromLong(description->release), PyUnicode_FromString(description->standard),
        PyUnicode_FromString(description->module), PyUnicode_FromString(captain_type_text(description->pdu)),
        numbers(description->ids, description->ids_count), numbers(description->versions, description->versions_count),
        PyLong_FromLong(description->btp_port), PyLong_FromLong(description->rank), PyBool_FromLong(description->is_experimental),
    };
    bool is_good = true;
    for (int index = 0; index < MEMBERS; index++) {
        new->members[index] = members[index];
        is_good = is_good && members[index] != NULL;
    }
    new->message = description;
    new->shape = is_good ? shape_of(description->pdu) : NULL;
    if (new->shape == NULL)
        Py_CLEAR(new);
    return (PyObject *)new;
}

/* ---------------------------------------------------------------- all of them */

static PyObject *messages; /* tuple, in the order of captain_messages */

static PyObject *module_all(PyObject *module, PyObject *unused)
{
    (void)module, (void)unused;
    return Py_NewRef(messages);
}

static PyObject *refuse_name(PyObject *name)
{
    PyObject *there = PyUnicode_FromString("");
    for (size_t index = 0; there != NULL && index < captain_messages_count; index++) {
        PyObject *more = PyUnicode_FromFormat(index == 0 ? "%U%s" : "%U, %s", there, captain_messages[index]->name);
        Py_DECREF(there);
        there = more;
    }
    PyObject *text = there == NULL ? NULL : PyUnicode_FromFormat("no message %R; there is %U", name, there);
    if (text != NULL)
        PyErr_SetObject(PyExc_KeyError, text);
    Py_XDECREF(there);
    Py_XDECREF(text);
    return NULL;
}

static PyObject *module_find(PyObject *module, PyObject *name)
{
    (void)module;
    const char *text = PyUnicode_Check(name) ? PyUnicode_AsUTF8AndSize(name, NULL) : NULL;
    if (text == NULL && !PyErr_Occurred())
        PyErr_SetString(PyExc_TypeError, "the name of a message is a str");
    if (text == NULL)
        return NULL;
    const captain_message *found = captain_find_message(text);
    for (size_t index = 0; found != NULL && index < captain_messages_count; index++)
        if (captain_messages[index] == found)
            return Py_NewRef(TUPLE_ITEM(messages, (Py_ssize_t)index));
    return refuse_name(name);
}

static PyMethodDef FUNCTIONS[] = {
    {"all", module_all, METH_NOARGS, "Every message of the library, by type and rank."},
    {"find", module_find, METH_O, "The message of a name: 'cam-1.4.1', or 'cam' for the preferred edition. Raises KeyError."},
    {0},
};

bool messages_add(PyObject *module)
{
    PyObject *class = PyType_FromSpec(&SPEC);
    if (class == NULL || PyModule_AddObjectRef(module, "Message", class) < 0 || PyModule_AddFunctions(module, FUNCTIONS) < 0)
        return false;
    messages = PyTuple_New((Py_ssize_t)captain_messages_count);
    for (size_t index = 0; messages != NULL && index < captain_messages_count; index++) {
        PyObject *new = message_new((PyTypeObject *)class, captain_messages[index]);
        if (new == NULL)
            Py_CLEAR(messages);
        else
            TUPLE_SET(messages, (Py_ssize_t)index, new);
    }
    return messages != NULL;
}

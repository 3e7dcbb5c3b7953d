/* Methods of a message: octets to dicts and views, and back. */
#include "message.h"
#include "decode.h"
#include "view.h"

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

bool decoded_open(decoded *decoded, const captain_message *message, PyObject *source)
{
    const captain_type *type = message->pdu;
    memory *memory = &decoded->memory;
    if (!octets_open(&decoded->octets, source))
        return false;
    size_t count = decoded->octets.count;
    memory_open(memory, decoded->first, sizeof decoded->first, decode_budget(message, count));
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

PyObject *message_decode(PyObject *self, PyObject *source)
{
    decoded decoded;
    if (!decoded_open(&decoded, message_of(self)->message, source))
        return NULL;
    PyObject *dict = python_value(message_of(self)->shape, decoded.value);
    decoded_close(&decoded);
    return dict != NULL ? dict : raise_unheld();
}

PyObject *message_view(PyObject *self, PyObject *source)
{
    const captain_type *type = message_of(self)->message->pdu;
    octets octets;
    PyObject *view = NULL;
    if (!octets_open(&octets, source))
        return NULL;
    storage *storage = storage_new(message_of(self)->message, octets.count);
    if (storage != NULL) {
        void *value = captain_arena_take(&storage->memory.arena, type->size);
        captain_status status = decode_octets(type, value, &octets, &storage->memory.arena);
        view = status == CAPTAIN_OK ? view_new(message_of(self)->shape, value, storage)
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

/* Return the struct of a dict or view; NULL with an exception of class `error`. */
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

PyObject *message_encode(PyObject *self, PyObject *value)
{
    maker maker;
    _Alignas(max_align_t) unsigned char first[SCRATCH];
    maker_open(&maker, first, sizeof first);
    const void *struct_ = struct_of(&maker, message_of(self)->shape, value, EncodeError);
    PyObject *octets = struct_ == NULL ? NULL : encoded(message_of(self)->message->pdu, struct_);
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

static PyObject *validate_octets(const captain_message *message, PyObject *source)
{
    decoded decoded;
    if (!decoded_open(&decoded, message, source))
        return NULL;
    PyObject *result = validated(message->pdu, decoded.value);
    decoded_close(&decoded);
    return result;
}

PyObject *message_validate(PyObject *self, PyObject *value)
{
    maker maker;
    _Alignas(max_align_t) unsigned char first[SCRATCH];
    if (PyBytes_Check(value) || PyByteArray_Check(value) || PyMemoryView_Check(value))
        return validate_octets(message_of(self)->message, value);
    maker_open(&maker, first, sizeof first);
    const void *struct_ = struct_of(&maker, message_of(self)->shape, value, ValidateError);
    PyObject *result = struct_ == NULL ? NULL : validated(message_of(self)->message->pdu, struct_);
    maker_close(&maker);
    return result;
}

/* A SEQUENCE has few patterns of present components. For each one seen a `form` is kept: a finished dict with that pattern's
 * keys. Where the layout of dicts is known (CPython 3.11, full API; looked at once for every form), a new dict is a copy of
 * the form's table of keys, its values written straight into their places: no hashing, 40 ns against 75 to 120 ns for a dict of three
 * values, 50 against 170 to 400 for one of ten. Elsewhere, and for patterns beyond the eighth, keys are set one by one. */
#include "decode.h"

#include <string.h>

enum { MAX_FORMS = 8, MAX_MASK = 64 };

#if !defined(Py_LIMITED_API) && PY_VERSION_HEX >= 0x030B0000 && PY_VERSION_HEX < 0x030C0000
#define KNOWN_LAYOUT 1
#endif

/* ---------------------------------------------------------------- any Python */

static bool has_key(const slot *slot, const unsigned char *record)
{
    return slot->has_default || !slot_is_absent(slot, record);
}

static PyObject *slot_python(const slot *slot, const unsigned char *record)
{
    const unsigned char *value =
        slot->has_default && slot_is_absent(slot, record) ? slot->field->default_value : slot_value(slot, record);
    return quick_value(slot->shape, value);
}

static PyObject *by_items(const shape *shape, const unsigned char *record)
{
    PyObject *dict = DICT_NEW(shape->slots_count);
    for (uint16_t index = 0; dict != NULL && index < shape->slots_count; index++) {
        const slot *slot = &shape->slots[index];
        if (!has_key(slot, record))
            continue;
        PyObject *value = slot_python(slot, record);
        if (value == NULL || PyDict_SetItem(dict, slot->key, value) < 0)
            Py_CLEAR(dict);
        Py_XDECREF(value);
    }
    return dict;
}

/* ---------------------------------------------------------------- known layout */

#ifdef KNOWN_LAYOUT

/* Objects/dictobject.c and Include/internal/pycore_dict.h of CPython 3.11: the table of keys of a dict with str keys, its
 * indices, then its entries. */
typedef struct keys_table {
    Py_ssize_t references;
    uint8_t log2_size, log2_index_octets, kind;
    uint32_t version;
    Py_ssize_t usable, count;
    char indices[];
} keys_table;

typedef struct entry {
    PyObject *key, *value;
} entry;

enum { STR_KEYS = 1 };

typedef struct form {
    uint64_t mask; /* of the components that may be absent, in their order */
    struct form *next;
    PyObject *dict;
    const keys_table *keys;
    size_t entries; /* offset in the table */
    size_t octets;  /* of the table */
    uint16_t count;
    bool has_containers;
    const slot *slots[];
} form;

static uint64_t mask_of(const shape *shape, const unsigned char *record)
{
    uint64_t mask = 0;
    if (!shape->may_be_absent)
        return 0;
    for (uint16_t index = 0; index < shape->slots_count; index++) {
        const slot *slot = &shape->slots[index];
        if (slot->present != CAPTAIN_NOWHERE && !slot->has_default)
            mask |= (uint64_t)*(const bool *)(record + slot->present) << index;
    }
    return mask;
}

static entry *entries_of(const form *form, keys_table *keys)
{
    return (entry *)(void *)((char *)keys + form->entries);
}

/* Whether the form's dict lies in memory as this file believes. */
static bool is_as_believed(const form *form)
{
    const PyDictObject *dict = (const PyDictObject *)form->dict;
    const keys_table *keys = form->keys;
    if (dict->ma_values != NULL || dict->ma_used != form->count || keys->references != 1 || keys->kind != STR_KEYS
        || keys->count != form->count || keys->version != 0
        || keys->usable + keys->count != ((Py_ssize_t)2 << keys->log2_size) / 3)
        return false;
    const entry *entries = entries_of(form, (keys_table *)(uintptr_t)keys);
    for (uint16_t index = 0; index < form->count; index++)
        if (entries[index].key != form->slots[index]->key || entries[index].value != Py_None)
            return false;
    return true;
}

/* NULL: no memory, or not as believed; then the dict is made the plain way. */
static form *form_new(const shape *shape, uint64_t mask)
{
    form *form = PyMem_Calloc(1, sizeof *form + shape->slots_count * sizeof *form->slots);
    if (form == NULL)
        return NULL;
    form->mask = mask;
    for (uint16_t index = 0; index < shape->slots_count; index++) {
        const slot *slot = &shape->slots[index];
        if (slot->present != CAPTAIN_NOWHERE && !slot->has_default && !(mask >> index & 1))
            continue;
        form->slots[form->count++] = slot;
        form->has_containers = form->has_containers || slot->shape->op >= OP_SEQUENCE;
    }
    form->dict = _PyDict_NewPresized(form->count);
    for (uint16_t index = 0; form->dict != NULL && index < form->count; index++)
        if (PyDict_SetItem(form->dict, form->slots[index]->key, Py_None) < 0)
            Py_CLEAR(form->dict);
    if (form->dict != NULL) {
        form->keys = (const keys_table *)(const void *)((PyDictObject *)form->dict)->ma_keys;
        form->entries = sizeof(keys_table) + ((size_t)1 << form->keys->log2_index_octets);
        form->octets = form->entries + (size_t)(form->keys->usable + form->keys->count) * sizeof(entry);
    }
    if (form->dict == NULL || !is_as_believed(form)) {
        PyErr_Clear();
        Py_CLEAR(form->dict);
        PyMem_Free(form);
        return NULL;
    }
    return form;
}

static const form *find_form(const shape *shape, uint64_t mask)
{
    int count = 0;
    for (const form *form = shape->forms; form != NULL; form = form->next, count++)
        if (form->mask == mask)
            return form;
    if (count >= MAX_FORMS || shape->slots_count == 0 || shape->slots_count > MAX_MASK)
        return NULL;
    form *form = form_new(shape, mask);
    if (form != NULL) {
        form->next = shape->forms;
        ((struct shape *)(uintptr_t)shape)->forms = form;
    }
    return form;
}

/* An empty dict whose shared table of no keys is replaced by a copy of the form's; its values are still the form's None. */
static PyDictObject *dict_with_keys(const form *form, keys_table **keys)
{
    PyDictObject *dict = (PyDictObject *)PyDict_New();
    if (dict == NULL)
        return NULL;
    *keys = PyObject_Malloc(form->octets);
    if (*keys == NULL) {
        Py_DECREF(dict);
        PyErr_NoMemory();
        return NULL;
    }
    memcpy(*keys, form->keys, form->octets);
    ((keys_table *)(void *)dict->ma_keys)->references--;
    dict->ma_keys = (PyDictKeysObject *)(void *)*keys;
    dict->ma_used = form->count;
    return dict;
}

static PyObject *by_form(const form *form, const unsigned char *record)
{
    keys_table *keys;
    PyDictObject *dict = dict_with_keys(form, &keys);
    if (dict == NULL)
        return NULL;
    entry *entries = entries_of(form, keys);
    bool is_good = true;
    for (uint16_t index = 0; index < form->count; index++) {
        PyObject *value = is_good ? slot_python(form->slots[index], record) : NULL;
        is_good = value != NULL;
        entries[index].value = is_good ? value : Py_NewRef(Py_None);
        Py_INCREF(entries[index].key);
    }
    if (!is_good)
        Py_CLEAR(dict);
    else if (form->has_containers)
        PyObject_GC_Track(dict);
    return (PyObject *)dict;
}

static PyObject *components(const shape *shape, const unsigned char *record)
{
    const form *form = find_form(shape, mask_of(shape, record));
    return form != NULL ? by_form(form, record) : by_items(shape, record);
}

#else
#define components by_items
#endif

/* ---------------------------------------------------------------- what no edition knows */

static bool put(PyObject *dict, PyObject *key, PyObject *value)
{
    bool is_good = key != NULL && value != NULL && PyDict_SetItem(dict, key, value) == 0;
    Py_XDECREF(key);
    Py_XDECREF(value);
    return is_good;
}

static bool put_additions(PyObject *dict, const shape *shape, const captain_additions *additions)
{
    for (uint32_t index = 0; index < additions->count; index++) {
        const captain_addition *addition = &additions->unknown[index];
        if (!put(dict, index_name(addition->index), octets_value(addition->octets)))
            return false;
    }
    if (additions->bits == shape->type->additions_count)
        return true;
    return put(dict, PyUnicode_FromString("[]"), PyLong_FromUnsignedLong(additions->bits));
}

PyObject *record_dict(const shape *shape, const unsigned char *record)
{
    PyObject *dict = components(shape, record);
    uint32_t place = shape->type->additions;
    if (place == CAPTAIN_NOWHERE || dict == NULL)
        return dict;
    const captain_additions *additions = *(const captain_additions *const *)(const void *)(record + place);
    if (additions != NULL && !put_additions(dict, shape, additions))
        Py_CLEAR(dict);
    return dict;
}

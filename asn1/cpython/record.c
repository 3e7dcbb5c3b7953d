/* A SEQUENCE has few patterns of present components. For each one seen a `form` is kept: a finished dict with that pattern's
 * keys. Where the layout of dicts is known a new dict is a copy of the form's table of keys, its values written straight into
 * their places: no hashing, 40 ns against 75 to 120 ns for a dict of three values, 50 against 170 to 400 for one of ten.
 * Elsewhere, and for patterns beyond the eighth, keys are set one by one. */
#include "decode.h"
#include "dict_layout.h"

#include <string.h>

enum { MAX_FORMS = 8, MAX_MASK = 64 };

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
    PyObject *dict = PyDict_New();
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

#ifdef MAY_KNOW_DICTS

/* Where a value of the form lies, and what it is. */
typedef struct part {
    const slot *slot;
    const shape *shape;
    uint32_t offset;
    bool is_plain; /* not behind a pointer, no default */
} part;

typedef struct form {
    uint64_t mask; /* of the components that may be absent, by their number */
    struct form *next;
    PyObject *dict; /* all values are None */
    const keys_table *table;
    size_t entries; /* offset in the table */
    size_t octets;  /* of the table */
    uint16_t count;
    bool has_containers;
    part parts[];
} form;

static bool may_be_absent(const slot *slot)
{
    return slot->present != CAPTAIN_NOWHERE && !slot->has_default;
}

static uint64_t mask_of(const shape *shape, const unsigned char *record)
{
    uint64_t mask = 0;
    if (!shape->may_be_absent)
        return 0;
    for (uint16_t index = 0; index < shape->slots_count; index++) {
        const slot *slot = &shape->slots[index];
        if (may_be_absent(slot))
            mask |= (uint64_t)*(const bool *)(record + slot->present) << index;
    }
    return mask;
}

static void add_part(form *form, const slot *slot)
{
    form->parts[form->count++] = (part){
        .slot = slot, .shape = slot->shape, .offset = slot->offset, .is_plain = !slot->is_pointer && !slot->has_default};
    form->has_containers = form->has_containers || slot->shape->op >= OP_SEQUENCE;
}

/* NULL: no memory; then the dict is made the plain way. */
static form *form_new(const shape *shape, uint64_t mask)
{
    form *form = PyMem_Calloc(1, sizeof *form + shape->slots_count * sizeof *form->parts);
    if (form == NULL)
        return NULL;
    form->mask = mask;
    for (uint16_t index = 0; index < shape->slots_count; index++)
        if (!may_be_absent(&shape->slots[index]) || (mask >> index & 1))
            add_part(form, &shape->slots[index]);
    form->dict = PyDict_New(); /* not presized: that makes a table for keys of any class */
    for (uint16_t index = 0; form->dict != NULL && index < form->count; index++)
        if (PyDict_SetItem(form->dict, form->parts[index].slot->key, Py_None) < 0)
            Py_CLEAR(form->dict);
    if (form->dict == NULL || form->count == 0) {
        PyErr_Clear();
        Py_CLEAR(form->dict);
        PyMem_Free(form);
        return NULL;
    }
    form->table = table_of(form->dict);
    form->entries = entries_offset(form->table);
    form->octets = form->entries + (size_t)(form->table->usable + form->table->count) * sizeof(entry);
    return form;
}

static const form *find_form(const shape *shape, uint64_t mask)
{
    int count = 0;
    for (const form *form = shape->forms; form != NULL; form = form->next, count++)
        if (form->mask == mask)
            return form;
    if (!dicts_are_known || count >= MAX_FORMS)
        return NULL;
    form *form = form_new(shape, mask);
    if (form != NULL) {
        form->next = shape->forms;
        ((struct shape *)(uintptr_t)shape)->forms = form;
    }
    return form;
}

/* An empty dict whose shared table of no keys is replaced by a copy of the form's. */
static PyObject *dict_with_keys(const form *form, entry **entries)
{
    PyDictObject *dict = (PyDictObject *)PyDict_New();
    if (dict == NULL)
        return NULL;
    keys_table *table = PyObject_Malloc(form->octets);
    if (table == NULL) {
        Py_DECREF(dict);
        return PyErr_NoMemory();
    }
    memcpy(table, form->table, form->octets);
    ((keys_table *)(void *)dict->ma_keys)->references--;
    dict->ma_keys = (PyDictKeysObject *)(void *)table;
    dict->ma_used = form->count;
    *entries = (entry *)(void *)((char *)table + form->entries);
    return (PyObject *)dict;
}

static PyObject *part_python(const part *part, const unsigned char *record)
{
    return part->is_plain ? quick_value(part->shape, record + part->offset) : slot_python(part->slot, record);
}

static PyObject *by_form(const form *form, const unsigned char *record)
{
    entry *entries = NULL;
    PyObject *dict = dict_with_keys(form, &entries);
    if (dict == NULL)
        return NULL;
    bool is_good = true;
    for (uint16_t index = 0; index < form->count; index++) {
        PyObject *value = is_good ? part_python(&form->parts[index], record) : NULL;
        is_good = value != NULL;
        entries[index].value = is_good ? value : Py_NewRef(Py_None);
        Py_INCREF(entries[index].key);
    }
    if (!is_good)
        Py_CLEAR(dict);
    else if (form->has_containers)
        PyObject_GC_Track(dict);
    return dict;
}

static PyObject *components(const shape *shape, const unsigned char *record)
{
    if (shape->slots_count > MAX_MASK)
        return by_items(shape, record);
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

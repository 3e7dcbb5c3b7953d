/* Dicts from SEQUENCEs, by the forms of form.h. Without known layout of dicts, and beyond the eighth pattern of components,
 * dicts are filled key by key. */
#include "decode.h"
#include "form.h"

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

static inline uint64_t mask_of(const shape *shape, const unsigned char *record)
{
    uint64_t mask = 0;
    for (uint16_t index = 0; index < shape->optionals_count; index++)
        mask |= (uint64_t)*(const bool *)(record + shape->optionals[index]) << index;
    return mask;
}

static void add_part(form *form, const slot *slot)
{
    form->parts[form->count++] = (part){
        .slot = slot, .shape = slot->shape, .offset = slot->offset, .is_plain = !slot->is_pointer && !slot->has_default};
    form->has_containers = form->has_containers || slot->op >= OP_SEQUENCE;
    form->has_early = form->has_early || slot->is_early;
}

/* Copy the keys of a dict to a table that dicts can share, and to which no key can be added. NULL if memory is exhausted. */
static keys_table *shared_keys(PyObject *dict)
{
    keys_table *table = table_of(dict);
    size_t octets = entries_offset(table) + (size_t)table->count * sizeof(entry);
    keys_table *shared = PyObject_Malloc(octets);
    if (shared == NULL)
        return NULL;
    memcpy(shared, table, octets);
    shared->kind = SHARED_KEYS;
    shared->usable = 0;
    for (Py_ssize_t index = 0; index < shared->count; index++) {
        Py_INCREF(entries_of(shared)[index].key);
        entries_of(shared)[index].value = NULL;
    }
    return shared;
}

static void set_keys(form *form)
{
    PyObject *dict = form->count == 0 || form->count > MAX_SHARED ? NULL : PyDict_New(); /* not presized: see OTHER_KEYS */
    for (uint16_t index = 0; dict != NULL && index < form->count; index++)
        if (PyDict_SetItem(dict, form->parts[index].slot->key, Py_None) < 0)
            Py_CLEAR(dict);
    form->keys = dict == NULL ? NULL : shared_keys(dict);
    Py_XDECREF(dict);
    PyErr_Clear();
}

static void set_prefix(form *form)
{
    form->prefix_octets = prefix_octets(form->count);
    if (form->prefix_octets > MAX_PREFIX)
        return;
    unsigned char *end = form->prefix + form->prefix_octets;
    end[-1] = (unsigned char)form->prefix_octets;
    end[-2] = (unsigned char)form->count;
    for (uint16_t index = 0; index < form->count; index++)
        end[-3 - index] = (unsigned char)index;
}

/* Return NULL if memory is exhausted; then the dict is filled key by key. */
static form *form_new(const shape *shape, uint64_t mask)
{
    form *form = PyMem_Calloc(1, sizeof *form + shape->slots_count * sizeof *form->parts);
    if (form == NULL)
        return NULL;
    form->mask = mask;
    for (uint16_t index = 0, bit = 0; index < shape->slots_count; index++)
        if (!is_optional(&shape->slots[index]) || (mask >> bit++ & 1))
            add_part(form, &shape->slots[index]);
    set_keys(form);
    set_prefix(form);
    return form;
}

static NEVER_INLINE const form *further_form(const shape *shape, uint64_t mask)
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

static inline const form *find_form(const shape *shape, uint64_t mask)
{
    const form *first = shape->forms;
    return first != NULL && first->mask == mask ? first : further_form(shape, mask);
}

/* Allocate the values with their prefix, which begins at *memory. */
static inline PyObject **values_new(const form *form, unsigned char **memory)
{
    *memory = PyMem_Malloc(form->prefix_octets + form->count * sizeof(PyObject *));
    if (*memory == NULL)
        return NULL;
    for (size_t at = 0; at < form->prefix_octets; at += sizeof(uint64_t))
        memcpy(*memory + at, form->prefix + at, sizeof(uint64_t));
    return (PyObject **)(void *)(*memory + form->prefix_octets);
}

/* Create an empty dict and replace its table of keys by the form's. Takes ownership of the values. */
static inline PyObject *dict_with(const form *form, PyObject **values)
{
    PyDictObject *dict = (PyDictObject *)PyDict_New();
    if (dict == NULL)
        return NULL;
    table_of((PyObject *)dict)->references--;
    form->keys->references++;
    dict->ma_keys = (PyDictKeysObject *)(void *)form->keys;
    dict->ma_values = (PyDictValues *)(void *)values;
    dict->ma_used = form->count;
    if (form->has_containers)
        PyObject_GC_Track(dict);
    return (PyObject *)dict;
}

static inline PyObject *part_python(const part *part, const unsigned char *record)
{
    return part->is_plain ? quick_value(part->shape, record + part->offset) : slot_python(part->slot, record);
}

static PyObject *by_form(const form *form, const unsigned char *record)
{
    unsigned char *memory;
    PyObject **values = values_new(form, &memory), **at = values;
    if (values == NULL)
        return PyErr_NoMemory();
    const part *part = form->parts, *end = part + form->count;
    while (part != end && (*at = part_python(part, record)) != NULL)
        part++, at++;
    PyObject *dict = part != end ? NULL : dict_with(form, values);
    if (dict == NULL) {
        while (at != values)
            Py_DECREF(*--at);
        PyMem_Free(memory);
    }
    return dict;
}

static PyObject *components(const shape *shape, const unsigned char *record)
{
    if (shape->optionals_count > MAX_MASK)
        return by_items(shape, record);
    const form *form = find_form(shape, mask_of(shape, record));
    return form != NULL && form->keys != NULL ? by_form(form, record) : by_items(shape, record);
}

#else
#define components by_items
#endif

/* ---------------------------------------------------------------- unknown additions */

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

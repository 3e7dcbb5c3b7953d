/* Dicts to a SEQUENCE, fast way. A dict in ASN.1 order with interned keys, as from decode or a literal, costs one comparison of
 * pointers per component. All other dicts take the general way of record_any.c. */
#include "encode.h"
#include "form.h"

#include <string.h>

bool leave_out(const slot *slot, unsigned char *record)
{
    if (slot->present != CAPTAIN_NOWHERE)
        PUT(bool, record + slot->present, false);
    else if (slot->has_default)
        memcpy(record + slot->offset, slot->field->default_value, slot->shape->type->size);
    else
        return false;
    return true;
}

bool refuse_missing(maker *maker, const slot *slot)
{
    refuse(maker, "missing");
    return under_name(maker, slot->field->name);
}

static bool behind_pointer(maker *maker, const slot *slot, PyObject *value, unsigned char *at)
{
    void *memory = maker_take(maker, slot->shape->type->size);
    if (memory == NULL)
        return false;
    PUT(void *, at, memory);
    return value_from(maker, slot->shape, value, memory);
}

/* Convert a value other than a number, or a number that is out of range. */
static bool other_slot_from(maker *maker, const shape *shape, const slot *slot, PyObject *value, unsigned char *record)
{
    unsigned char *at = record + slot->offset;
    bool is_good = slot->is_pointer ? behind_pointer(maker, slot, value, at)
        : slot->op == OP_OPEN       ? open_from(maker, shape, slot, value, record)
                                    : quick_from(maker, slot->shape, value, at);
    return is_good || under_name(maker, slot->field->name);
}

#define NUMBER(type)                                                                     \
    if (!small_integer(value, &number) || number < slot->low || number > slot->high) \
        break;                                                                       \
    PUT(type, record + slot->offset, number);                                        \
    return true

static ALWAYS_INLINE bool quick_slot_from(maker *maker, const shape *shape, const slot *slot, PyObject *value, unsigned char *record)
{
    int64_t number;
    if (slot->present != CAPTAIN_NOWHERE)
        PUT(bool, record + slot->present, true);
    switch (slot->op) {
    case OP_U8:
    case OP_I8:
        NUMBER(uint8_t);
    case OP_U16:
    case OP_I16:
        NUMBER(uint16_t);
    case OP_U32:
    case OP_I32:
        NUMBER(uint32_t);
    case OP_U64:
    case OP_I64:
        NUMBER(uint64_t);
    default:
        break;
    }
    return other_slot_from(maker, shape, slot, value, record);
}

bool slot_from(maker *maker, const shape *shape, const slot *slot, PyObject *value, unsigned char *record)
{
    return quick_slot_from(maker, shape, slot, value, record);
}

/* Convert one key and value. *next: the expected slot. Result OTHER: the dict has another order. */
typedef enum step { GOOD, BAD, OTHER } step;

static ALWAYS_INLINE step take_pair(maker *maker, const shape *shape, PyObject *key, PyObject *value, const slot **next, unsigned char *record)
{
    const slot *slot = *next, *end = shape->slots + shape->slots_count;
    while (slot != end && slot->key != key && leave_out(slot, record))
        slot++;
    if (slot == end || slot->key != key || slot->is_early)
        return OTHER;
    *next = slot + 1;
    return quick_slot_from(maker, shape, slot, value, record) ? GOOD : BAD;
}

static step each_pair(maker *maker, const shape *shape, PyObject *dict, const slot **next, unsigned char *record)
{
    Py_ssize_t position = 0;
    PyObject *key, *value;
    step step = GOOD;
    while (step == GOOD && PyDict_Next(dict, &position, &key, &value))
        step = take_pair(maker, shape, key, value, next, record);
    return step;
}

#ifdef MAY_KNOW_DICTS

/* Read the entries directly, unless code of a value has run: 1 ns each, in place of 5. */
static step each_entry(maker *maker, const shape *shape, keys_table *table, const slot **next, unsigned char *record)
{
    unsigned foreign = maker->foreign;
    const entry *entry = entries_of(table), *end = entry + table->count;
    for (; entry != end; entry++) {
        if (entry->value == NULL)
            continue;
        step step = take_pair(maker, shape, entry->key, entry->value, next, record);
        if (step != GOOD)
            return step;
        if (maker->foreign != foreign)
            return OTHER;
    }
    return GOOD;
}

/* Do the same with the values of a dict from decode, whose keys are known. */
static step each_part(maker *maker, const shape *shape, const form *form, PyObject *dict, const slot **next, unsigned char *record)
{
    unsigned foreign = maker->foreign;
    PyObject *const *value = values_of(dict);
    const part *part = form->parts, *end = part + form->count;
    for (uint16_t index = 0; index < shape->optionals_count; index++)
        PUT(bool, record + shape->optionals[index], false);
    for (; part != end; part++, value++) {
        if (!quick_slot_from(maker, shape, part->slot, *value, record))
            return BAD;
        if (maker->foreign != foreign)
            return OTHER;
    }
    *next = shape->slots + shape->slots_count;
    return GOOD;
}

static inline step pairs(maker *maker, const shape *shape, PyObject *dict, const slot **next, unsigned char *record)
{
    if (!dicts_are_known || table_of(dict)->kind == OTHER_KEYS)
        return each_pair(maker, shape, dict, next, record);
    if (values_of(dict) == NULL)
        return each_entry(maker, shape, table_of(dict), next, record);
    const form *form = form_of(shape, dict);
    return form != NULL ? each_part(maker, shape, form, dict, next, record) : each_pair(maker, shape, dict, next, record);
}

#else
#define pairs each_pair
#endif

static bool in_order(maker *maker, const shape *shape, PyObject *dict, unsigned char *record)
{
    const slot *next = shape->slots, *end = next + shape->slots_count;
    step step = pairs(maker, shape, dict, &next, record);
    if (step != GOOD)
        return step == OTHER && any_order(maker, shape, dict, record);
    for (; next != end; next++)
        if (!leave_out(next, record))
            return refuse_missing(maker, next);
    return true;
}

bool record_from(maker *maker, const shape *shape, PyObject *value, unsigned char *at)
{
    if (!PyDict_Check(value))
        return view_from(maker, shape, value, at);
    if (++maker->depth > CAPTAIN_MAX_DEPTH)
        return refuse(maker, "nested deeper than %d", (int)CAPTAIN_MAX_DEPTH);
    if (shape->type->additions != CAPTAIN_NOWHERE)
        PUT(const captain_additions *, at + shape->type->additions, NULL);
    Py_INCREF(value);
    bool is_good = in_order(maker, shape, value, at);
    Py_DECREF(value);
    maker->depth--;
    return is_good;
}

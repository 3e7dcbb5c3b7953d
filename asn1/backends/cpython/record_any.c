/* Dicts to a SEQUENCE, general way: keys in any order, equal keys that are other objects, unknown additions. */
#include "encode.h"
#include "walk.h"

#include <stdlib.h>
#include <string.h>

/* ---------------------------------------------------------------- unknown additions */

typedef struct unknowns {
    captain_addition *list;
    Py_ssize_t room;
    uint32_t count, bits;
    bool has_bits;
} unknowns;

static bool bits_from(maker *maker, PyObject *value, unknowns *unknowns)
{
    int overflow;
    long bits = PyLong_Check(value) ? PyLong_AsLongAndOverflow(value, &overflow) : -1;
    if (bits < 1 || bits > CAPTAIN_WALK_ADDITIONS) {
        refuse(maker, "the length of a bitmap is an int in 1..%d", (int)CAPTAIN_WALK_ADDITIONS);
        return under_name(maker, "[]");
    }
    unknowns->bits = (uint32_t)bits;
    unknowns->has_bits = true;
    return true;
}

static bool unknown_from(maker *maker, const shape *shape, PyObject *dict, PyObject *key, PyObject *value, unknowns *unknowns)
{
    uint32_t index;
    const captain_type *type = shape->type;
    if (type->additions == CAPTAIN_NOWHERE || !PyUnicode_Check(key))
        return refuse_name(maker, key, "component", type);
    if (PyUnicode_CompareWithASCIIString(key, "[]") == 0)
        return bits_from(maker, value, unknowns);
    if (!index_of(key, &index) || index < type->additions_count)
        return refuse_name(maker, key, "component", type);
    if (unknowns->list == NULL) {
        unknowns->room = PyDict_Size(dict);
        unknowns->list = maker_take(maker, (size_t)unknowns->room * sizeof *unknowns->list);
        if (unknowns->list == NULL)
            return false;
    }
    if (unknowns->count >= unknowns->room)
        return refuse(maker, "the dict changed while it was encoded");
    captain_addition *addition = &unknowns->list[unknowns->count++];
    addition->index = index;
    return octets_from(maker, value, &addition->octets) || under_addition(maker, index);
}

static int by_index(const void *left, const void *right)
{
    uint32_t one = ((const captain_addition *)left)->index, other = ((const captain_addition *)right)->index;
    return (one > other) - (one < other);
}

static bool keep_additions(maker *maker, const captain_type *type, unknowns *unknowns, unsigned char *record)
{
    if (unknowns->count == 0 && !unknowns->has_bits)
        return true;
    uint32_t needed = 0;
    if (unknowns->count > 0) {
        qsort(unknowns->list, unknowns->count, sizeof *unknowns->list, by_index);
        needed = unknowns->list[unknowns->count - 1].index + 1;
    }
    for (uint32_t index = 1; index < unknowns->count; index++)
        if (unknowns->list[index].index == unknowns->list[index - 1].index)
            return refuse(maker, "the dict changed while it was encoded");
    if (unknowns->has_bits && unknowns->bits < needed)
        return refuse(maker, "a bitmap of %u has no addition [%u]", (unsigned)unknowns->bits, (unsigned)(needed - 1));
    captain_additions *additions = maker_take(maker, sizeof *additions);
    if (additions == NULL)
        return false;
    if (!unknowns->has_bits)
        unknowns->bits = needed > type->additions_count ? needed : type->additions_count;
    *additions = (captain_additions){.bits = unknowns->bits, .count = unknowns->count, .unknown = unknowns->list};
    *(const captain_additions **)(void *)(record + type->additions) = additions;
    return true;
}

/* ---------------------------------------------------------------- any order */

/* Open types are converted last, because the identifier that selects their type must be known. */
static bool pass(maker *maker, const shape *shape, PyObject *dict, unsigned char *record, bool is_open_pass, bool *seen,
                 unknowns *unknowns) {
    Py_ssize_t position = 0, expected = 0;
    PyObject *key, *value;
    while (PyDict_Next(dict, &position, &key, &value)) {
        Py_ssize_t index = slot_find(shape, key, expected);
        if (index < 0) {
            if (!is_open_pass && !unknown_from(maker, shape, dict, key, value, unknowns))
                return false;
            continue;
        }
        expected = index + 1;
        const slot *slot = &shape->slots[index];
        if ((slot->shape->op == OP_OPEN) != is_open_pass)
            continue;
        if (is_open_pass && !seen[slot->shape->type->selector] && !shape->slots[slot->shape->type->selector].has_default)
            return refuse_missing(maker, &shape->slots[slot->shape->type->selector]);
        if (!slot_from(maker, shape, slot, value, record))
            return false;
        seen[index] = true;
    }
    return true;
}

bool any_order(maker *maker, const shape *shape, PyObject *dict, unsigned char *record)
{
    unknowns unknowns = {0};
    bool has_open = false;
    bool *seen = maker_take(maker, shape->slots_count * sizeof *seen);
    if (seen == NULL)
        return false;
    for (uint16_t index = 0; index < shape->slots_count; index++) {
        seen[index] = leave_out(&shape->slots[index], record) && shape->slots[index].present == CAPTAIN_NOWHERE;
        has_open = has_open || shape->slots[index].shape->op == OP_OPEN;
    }
    if (!pass(maker, shape, dict, record, false, seen, &unknowns))
        return false;
    if (has_open && !pass(maker, shape, dict, record, true, seen, &unknowns))
        return false;
    for (uint16_t index = 0; index < shape->slots_count; index++)
        if (!seen[index] && shape->slots[index].present == CAPTAIN_NOWHERE)
            return refuse_missing(maker, &shape->slots[index]);
    return keep_additions(maker, shape->type, &unknowns, record);
}

/* Comparison of values: two are equal if their encodings are. */
#include "walk.h"

#include <string.h>

static bool values_are_equal(const captain_type *type, const void *left, const void *right, unsigned depth);

static bool octets_are_equal(captain_octets left, captain_octets right)
{
    return left.count == right.count && (left.count == 0 || memcmp(left.octets, right.octets, left.count) == 0);
}

static bool bits_are_equal(const captain_type *type, const void *left, const void *right)
{
    uint32_t count = captain_walk_bits(type, left);
    if (count != captain_walk_bits(type, right))
        return false;
    for (uint32_t i = 0; i < count; i++)
        if (captain_walk_bit(type, left, i) != captain_walk_bit(type, right, i))
            return false;
    return true;
}

/* Return the kept length of the bitmap; 0 if it is the type's own and an addition is present, so that it says nothing. */
static uint32_t unusual_bitmap(const captain_type *type, const void *structure, const captain_additions *additions)
{
    uint32_t bits = captain_walk_bitmap(additions);
    for (unsigned i = type->root_count; bits == type->additions_count && i < type->fields_count; i++)
        if (captain_walk_is_present(&type->fields[i], structure))
            return 0;
    return bits;
}

static bool additions_are_equal(const captain_type *type, const void *left, const void *right)
{
    static const captain_additions nothing = {0, 0, NULL};
    const captain_additions *a = captain_walk_additions(type, left), *b = captain_walk_additions(type, right);
    if (unusual_bitmap(type, left, a) != unusual_bitmap(type, right, b))
        return false;
    a = a == NULL ? &nothing : a;
    b = b == NULL ? &nothing : b;
    if (a->count != b->count)
        return false;
    for (uint32_t i = 0; i < a->count; i++)
        if (a->unknown[i].index != b->unknown[i].index || !octets_are_equal(a->unknown[i].octets, b->unknown[i].octets))
            return false;
    return true;
}

static bool sequences_are_equal(const captain_type *type, const void *left, const void *right, unsigned depth)
{
    for (unsigned i = 0; i < type->fields_count; i++) {
        const captain_field *field = &type->fields[i];
        const void *a = captain_walk_effective(field, left), *b = captain_walk_effective(field, right);
        if ((a == NULL) != (b == NULL) || (a != NULL && !values_are_equal(field->type, a, b, depth)))
            return false;
    }
    return additions_are_equal(type, left, right);
}

static bool choices_are_equal(const captain_type *type, const void *left, const void *right, unsigned depth)
{
    uint32_t choice = *(const uint32_t *)left;
    if (choice != *(const uint32_t *)right)
        return false;
    if (choice >= CAPTAIN_UNKNOWN) {
        return octets_are_equal(*captain_walk_unknown(type, left), *captain_walk_unknown(type, right));
    }
    if (choice == 0 || choice > type->fields_count)
        return true;
    const captain_field *field = &type->fields[choice - 1];
    const void *a = captain_walk_field(field, left), *b = captain_walk_field(field, right);
    return a == b || (a != NULL && b != NULL && values_are_equal(field->type, a, b, depth));
}

static bool lists_are_equal(const captain_type *type, captain_list left, captain_list right, unsigned depth)
{
    if (left.count != right.count)
        return false;
    size_t size = type->element->size;
    for (uint32_t i = 0; i < left.count; i++)
        if (!values_are_equal(type->element, (char *)left.items + i * size, (char *)right.items + i * size, depth))
            return false;
    return true;
}

static bool opens_are_equal(const captain_open *left, const captain_open *right, unsigned depth)
{
    if (left->type != right->type)
        return false;
    if (left->type == NULL)
        return octets_are_equal(left->octets, right->octets);
    return left->value == right->value
           || (left->value != NULL && right->value != NULL && values_are_equal(left->type, left->value, right->value, depth));
}

static bool values_are_equal(const captain_type *type, const void *left, const void *right, unsigned depth)
{
    if (depth >= CAPTAIN_WALK_DEPTH)
        return false;
    switch (type->kind) {
    case CAPTAIN_BOOLEAN: return *(const bool *)left == *(const bool *)right;
    case CAPTAIN_NULL: return true;
    case CAPTAIN_INTEGER:
    case CAPTAIN_ENUMERATED: return captain_walk_number(type, left) == captain_walk_number(type, right);
    case CAPTAIN_SMALL_BITS:
    case CAPTAIN_BIT_STRING: return bits_are_equal(type, left, right);
    case CAPTAIN_FIXED_OCTETS: return memcmp(left, right, type->size) == 0;
    case CAPTAIN_SEQUENCE: return sequences_are_equal(type, left, right, depth + 1);
    case CAPTAIN_CHOICE: return choices_are_equal(type, left, right, depth + 1);
    case CAPTAIN_LIST: return lists_are_equal(type, captain_walk_list(left), captain_walk_list(right), depth + 1);
    case CAPTAIN_OPEN: return opens_are_equal(left, right, depth + 1);
    default: return octets_are_equal(captain_walk_octets(left), captain_walk_octets(right));
    }
}

bool captain_equal(const captain_type *type, const void *left, const void *right)
{
    return values_are_equal(type, left, right, 0);
}

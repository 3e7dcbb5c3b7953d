/* Fewest bits of a type's values. A count of elements is accepted only if the octets can contain so many. */
#include "explain.h"

/* A number takes at least a length octet and another one (11.7, 11.8). Larger numbers count the same, with or without an
 * extension bit. */
enum { NUMBER_BITS = 16 };

typedef struct trail {
    const captain_type *type;
    const struct trail *before;
} trail;

static uint64_t smaller(uint64_t left, uint64_t right) { return left < right ? left : right; }

static uint64_t least(const captain_type *type, const trail *before);

static uint64_t of_sequence(const captain_type *type, const trail *before)
{
    uint64_t bits = 0;
    for (unsigned i = 0; i < type->root_count; i++) {
        bool is_optional = (type->fields[i].flags & (CAPTAIN_OPTIONAL | CAPTAIN_DEFAULT)) != 0;
        bits += is_optional ? 1 : least(type->fields[i].type, before);
    }
    return bits;
}

static uint64_t of_choice(const captain_type *type, const trail *before)
{
    uint64_t bits = UINT64_MAX;
    for (unsigned i = 0; i < type->root_count; i++)
        bits = smaller(bits, least(type->fields[i].type, before));
    return type->root_count > 0 ? bits + captain_explain_width(type->root_count - 1u) : 0;
}

static uint64_t of_size(const captain_type *type, const trail *before)
{
    bool is_bits = type->kind == CAPTAIN_BIT_STRING || type->kind == CAPTAIN_SMALL_BITS;
    uint64_t item = captain_walk_is_string(type) ? type->character_bits : is_bits ? 1 : 8;
    item = type->kind == CAPTAIN_LIST ? least(type->element, before) : item;
    uint64_t length = captain_explain_is_counted(type, true) ? captain_explain_width((uint64_t)(type->high - type->low)) : 8;
    return length + item * (uint64_t)type->low;
}

static uint64_t of_root(const captain_type *type, const trail *before)
{
    bool is_bounded = !(type->flags & (CAPTAIN_UNBOUNDED_LOW | CAPTAIN_UNBOUNDED_HIGH));
    unsigned number_bits = captain_explain_width((uint64_t)type->high - (uint64_t)type->low);
    switch (type->kind) {
    case CAPTAIN_BOOLEAN: return 1;
    case CAPTAIN_NULL: return 0;
    case CAPTAIN_INTEGER: return is_bounded ? smaller(NUMBER_BITS, number_bits) : NUMBER_BITS;
    case CAPTAIN_ENUMERATED: return captain_explain_width(type->root_count - 1u);
    case CAPTAIN_UTF8:
    case CAPTAIN_OID:
    case CAPTAIN_RELATIVE_OID:
    case CAPTAIN_OPEN: return 8;
    case CAPTAIN_SEQUENCE: return of_sequence(type, before);
    case CAPTAIN_CHOICE: return of_choice(type, before);
    default: return of_size(type, before);
    }
}

/* Fewest bits after an extension bit of 1: a small number (11.6) and an open type (23.8), a length, or a whole number. */
static uint64_t of_extension(const captain_type *type)
{
    switch (type->kind) {
    case CAPTAIN_INTEGER: return NUMBER_BITS;
    case CAPTAIN_ENUMERATED: return 7;
    case CAPTAIN_CHOICE: return 15;
    case CAPTAIN_SEQUENCE: return UINT64_MAX; /* its root is encoded as well */
    default: return 8;
    }
}

/* A type inside itself counts as 0. */
static uint64_t least(const captain_type *type, const trail *before)
{
    unsigned depth = 0;
    for (const trail *at = before; at != NULL; at = at->before)
        if (at->type == type || ++depth == CAPTAIN_MAX_DEPTH)
            return 0;
    const trail here = {type, before};
    uint64_t root = of_root(type, &here);
    return type->flags & CAPTAIN_EXTENSIBLE ? 1 + smaller(root, of_extension(type)) : root;
}

uint64_t captain_explain_least_bits(const captain_type *type)
{
    return least(type, NULL);
}

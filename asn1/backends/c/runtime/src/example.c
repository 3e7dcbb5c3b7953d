/* Examples: the simplest legal value of a type, and of a message. */
#include "place.h"

#include <string.h>

/* Limit of the combinations of optional components that are tried for a constraint on their presence. */
enum { COMBINATIONS = 64 };

/* ---------------------------------------------------------------- numbers and strings */

static bool is_no_value(const char *name)
{
    return strcmp(name, "unavailable") == 0 || strcmp(name, "unknown") == 0 || strcmp(name, "notAvailable") == 0;
}

/* Return the number of the item that says "no value" among the first `count` names, or `other`. */
static int64_t no_value(const captain_type *type, unsigned count, int64_t other)
{
    for (unsigned i = 0; i < count; i++) {
        int64_t number = type->names[i].value;
        bool is_allowed = type->kind == CAPTAIN_ENUMERATED
                       || (captain_walk_in_range(type, number) && !captain_walk_in_gap(type, number));
        if (is_no_value(type->names[i].name) && is_allowed)
            return number;
    }
    return other;
}

/* Return the smallest number of a range; without one, the number nearest to 0. */
static int64_t smallest(const captain_type *type)
{
    if (!(type->flags & CAPTAIN_UNBOUNDED_LOW))
        return type->low;
    return captain_walk_in_range(type, 0) ? 0 : type->high;
}

static char character(const captain_type *type)
{
    bool has_zero = type->kind == CAPTAIN_UTF8 || captain_walk_has_character(type, true, '0');
    return has_zero ? '0' : (char)captain_walk_character(type, true, 0);
}

/* The smallest size of a string; an object identifier has one octet, which is 0.0 or 0. */
static captain_status fill_string(const captain_type *type, void *value, captain_filling *in)
{
    bool is_oid = type->kind == CAPTAIN_OID || type->kind == CAPTAIN_RELATIVE_OID;
    uint32_t count = is_oid ? 1 : (uint32_t)type->low;
    size_t size = type->kind == CAPTAIN_BIT_STRING ? (count + 7) / 8 : count;
    uint8_t *octets = captain_arena_take(in->arena, size + 1);
    if (octets == NULL)
        return CAPTAIN_NO_MEMORY;
    memset(octets, captain_walk_is_string(type) ? character(type) : 0, size);
    octets[size] = 0;
    captain_octets string = {count, octets};
    memcpy(value, &string, sizeof string); /* captain_bits and captain_text have the same layout */
    return CAPTAIN_OK;
}

/* ---------------------------------------------------------------- components */

captain_status captain_place(const captain_field *field, void *structure, captain_filling *in, void **value)
{
    *value = (char *)structure + field->offset;
    if (!(field->flags & CAPTAIN_POINTER))
        return CAPTAIN_OK;
    void *pointed = captain_arena_take(in->arena, field->type->size);
    if (pointed == NULL)
        return CAPTAIN_NO_MEMORY;
    memcpy(*value, &pointed, sizeof pointed);
    *value = pointed;
    return CAPTAIN_OK;
}

captain_status captain_place_example(const captain_field *field, void *structure, captain_filling *in)
{
    void *value;
    TRY(captain_place(field, structure, in, &value));
    if (field->present != CAPTAIN_NOWHERE)
        *(bool *)((char *)structure + field->present) = true;
    if (field->type->kind != CAPTAIN_OPEN)
        return captain_example_value(field->type, value, in);
    *(captain_open *)value = (captain_open){.type = NULL};
    return CAPTAIN_OK;
}

captain_status captain_place_row(const captain_type *holder, const captain_field *open, const captain_row *row, void *structure,
                                 captain_filling *in)
{
    const captain_field *selector = &holder->fields[open->type->selector];
    TRY(captain_place_example(selector, structure, in));
    captain_walk_set_number(selector->type, (char *)structure + selector->offset, row->id);
    void *value = captain_arena_take(in->arena, row->type->size);
    if (value == NULL)
        return CAPTAIN_NO_MEMORY;
    *(captain_open *)(void *)((char *)structure + open->offset) = (captain_open){.type = row->type, .value = value};
    return captain_example_value(row->type, value, in);
}

/* ---------------------------------------------------------------- SEQUENCE */

/* Select the first row of each open type that is present. One without rows remains empty. */
static captain_status fill_opens(const captain_type *type, void *structure, captain_filling *in)
{
    for (unsigned i = 0; i < type->fields_count; i++) {
        const captain_field *field = &type->fields[i];
        if (field->type->kind == CAPTAIN_OPEN && field->type->rows_count > 0 && captain_walk_is_present(field, structure))
            TRY(captain_place_row(type, field, field->type->rows, structure, in));
    }
    return CAPTAIN_OK;
}

/* Fill the required components, and the optional ones of the root whose bits are set, from the lowest on. */
static captain_status fill_components(const captain_type *type, void *structure, captain_filling *in, unsigned optional)
{
    captain_init(type, structure);
    for (unsigned i = 0; i < type->root_count; i++) {
        const captain_field *field = &type->fields[i];
        bool is_chosen = true;
        if (field->present != CAPTAIN_NOWHERE) {
            is_chosen = !(field->flags & CAPTAIN_DEFAULT) && (optional & 1);
            optional >>= !(field->flags & CAPTAIN_DEFAULT);
        }
        if (is_chosen)
            TRY(captain_place_example(field, structure, in));
    }
    return fill_opens(type, structure, in);
}

static unsigned combinations(const captain_type *type)
{
    unsigned count = 1;
    for (unsigned i = 0; i < type->root_count && count < COMBINATIONS; i++)
        if (type->fields[i].present != CAPTAIN_NOWHERE && !(type->fields[i].flags & CAPTAIN_DEFAULT))
            count *= 2;
    return count;
}

/* A constraint may require optional components, as in DENM of Release 2. If no combination is valid, a constraint of the
 * enclosing types, or their validation, decides. */
static captain_status fill_sequence(const captain_type *type, void *structure, captain_filling *in)
{
    unsigned count = combinations(type);
    for (unsigned optional = 0; optional < count; optional++) {
        TRY(fill_components(type, structure, in, optional));
        if (captain_validate(type, structure) == CAPTAIN_OK)
            return CAPTAIN_OK;
    }
    return fill_components(type, structure, in, 0);
}

/* ---------------------------------------------------------------- other containers */

/* Choose the first alternative that does not contain itself. */
static captain_status fill_choice(const captain_type *type, void *structure, captain_filling *in)
{
    uint32_t index = 0;
    while (index + 1u < type->root_count && (type->fields[index].type->flags & CAPTAIN_RECURS))
        index++;
    memset(structure, 0, type->size);
    *(uint32_t *)structure = index + 1;
    return captain_place_example(&type->fields[index], structure, in);
}

static captain_status fill_list(const captain_type *type, void *value, captain_filling *in)
{
    captain_list list = {(uint32_t)type->low, NULL};
    size_t size = type->element->size;
    if (list.count > 0)
        list.items = captain_arena_take(in->arena, list.count * size);
    if (list.count > 0 && list.items == NULL)
        return CAPTAIN_NO_MEMORY;
    for (uint32_t i = 0; i < list.count; i++)
        TRY(captain_example_value(type->element, (char *)list.items + i * size, in));
    memcpy(value, &list, sizeof list);
    return CAPTAIN_OK;
}

static captain_status fill(const captain_type *type, void *value, captain_filling *in)
{
    switch (type->kind) {
    case CAPTAIN_INTEGER: captain_walk_set_number(type, value, no_value(type, type->names_count, smallest(type))); return CAPTAIN_OK;
    case CAPTAIN_ENUMERATED: captain_walk_set_number(type, value, no_value(type, type->root_count, type->names[0].value)); return CAPTAIN_OK;
    case CAPTAIN_BOOLEAN:
    case CAPTAIN_NULL:
    case CAPTAIN_SMALL_BITS:
    case CAPTAIN_FIXED_OCTETS: memset(value, 0, type->size); return CAPTAIN_OK;
    case CAPTAIN_SEQUENCE: return fill_sequence(type, value, in);
    case CAPTAIN_CHOICE: return fill_choice(type, value, in);
    case CAPTAIN_LIST: return fill_list(type, value, in);
    case CAPTAIN_OPEN: *(captain_open *)value = (captain_open){.type = NULL}; return CAPTAIN_OK;
    default: return fill_string(type, value, in);
    }
}

captain_status captain_example_value(const captain_type *type, void *value, captain_filling *in)
{
    if (in->depth == CAPTAIN_WALK_DEPTH)
        return CAPTAIN_DEPTH;
    in->depth++;
    TRY(fill(type, value, in));
    in->depth--;
    return CAPTAIN_OK;
}

/* ---------------------------------------------------------------- message */

/* Set a component of the ITS PDU header, in which Release 1 writes ID, and Release 2 Id. */
static void set_header(const captain_type *header, char *structure, const char *name, int64_t number)
{
    for (unsigned i = 0; i < header->root_count; i++) {
        const captain_field *field = &header->fields[i];
        if (captain_is_name(field->name, name, strlen(name)) && field->type->kind == CAPTAIN_INTEGER)
            captain_walk_set_number(field->type, structure + field->offset, number);
    }
}

captain_status captain_example(const captain_message *message, void *value, captain_arena *arena)
{
    const captain_type *pdu = message->pdu;
    captain_filling filling = {.arena = arena};
    TRY(captain_example_value(pdu, value, &filling));
    if (message->ids_count > 0 && message->versions_count > 0 && pdu->fields_count > 0
        && pdu->fields[0].type->kind == CAPTAIN_SEQUENCE) {
        const captain_type *header = pdu->fields[0].type;
        char *structure = (char *)value + pdu->fields[0].offset;
        set_header(header, structure, "protocolVersion", message->versions[0]);
        set_header(header, structure, "messageID", message->ids[0]);
        set_header(header, structure, "stationID", 1);
    }
    return captain_validate(pdu, value);
}

/* Values without names: what two editions of a message have in common where they read the same octets as the same values. */
#include "walk.h"

static void write_value(captain_out *out, const captain_type *type, const void *value, unsigned depth);

static void write_number(captain_out *out, char kind, int64_t number)
{
    char text[9] = {kind};
    for (unsigned i = 1; i < sizeof text; i++, number = (int64_t)((uint64_t)number >> 8))
        text[i] = (char)(unsigned char)(number & 0xff);
    captain_out_put(out, text, sizeof text);
}

static void write_octets(captain_out *out, char kind, captain_octets octets)
{
    write_number(out, kind, octets.count);
    if (octets.count > 0)
        captain_out_put(out, (const char *)octets.octets, octets.count);
}

/* The places of the bits that are set: named bits of one edition may be bits without names in another. */
static void write_bits(captain_out *out, const captain_type *type, const void *value)
{
    uint32_t count = captain_walk_bits(type, value);
    for (uint32_t i = 0; i < count; i++)
        if (captain_walk_bit(type, value, i))
            write_number(out, 'b', i);
    captain_out_character(out, 'B');
}

/* An item has the same index in every edition, and not always the same name. */
static int64_t item_index(const captain_type *type, const void *value)
{
    int64_t number = captain_walk_number(type, value);
    int32_t index = captain_walk_item(type, number);
    return index >= 0 ? index : number;
}

static void write_sequence(captain_out *out, const captain_type *type, const void *structure, unsigned depth)
{
    for (unsigned i = 0; i < type->fields_count; i++) {
        const void *value = captain_walk_shown(&type->fields[i], structure);
        if (value != NULL)
            write_value(out, type->fields[i].type, value, depth);
    }
    const captain_additions *additions = captain_walk_additions(type, structure);
    for (uint32_t i = 0; additions != NULL && i < additions->count; i++)
        write_octets(out, 'u', additions->unknown[i].octets);
}

/* A CHOICE says the same as a number before its alternative: causeCode was one until Release 2. */
static void write_choice(captain_out *out, const captain_type *type, const void *structure, unsigned depth)
{
    uint32_t choice = *(const uint32_t *)structure;
    if (choice >= CAPTAIN_UNKNOWN) {
        write_number(out, 'x', choice - CAPTAIN_UNKNOWN);
        write_octets(out, 'u', *captain_walk_unknown(type, structure));
    } else if (choice > 0 && choice <= type->fields_count) {
        const captain_field *field = &type->fields[choice - 1];
        const void *value = captain_walk_field(field, structure);
        write_number(out, 'n', (int64_t)choice - 1);
        if (value != NULL)
            write_value(out, field->type, value, depth);
    }
}

static void write_list(captain_out *out, const captain_type *element, captain_list list, unsigned depth)
{
    write_number(out, 'l', list.count);
    for (uint32_t i = 0; i < list.count && out->status == CAPTAIN_OK; i++)
        write_value(out, element, (const char *)list.items + (size_t)i * element->size, depth);
}

static void write_open(captain_out *out, const captain_open *open, unsigned depth)
{
    if (open->type == NULL)
        write_octets(out, 'u', open->octets);
    else if (open->value != NULL)
        write_value(out, open->type, open->value, depth);
}

static void write_value(captain_out *out, const captain_type *type, const void *value, unsigned depth)
{
    if (depth >= CAPTAIN_WALK_DEPTH) {
        out->status = CAPTAIN_DEPTH;
        return;
    }
    switch (type->kind) {
    case CAPTAIN_BOOLEAN: write_number(out, 'n', *(const bool *)value); return;
    case CAPTAIN_NULL: captain_out_character(out, '0'); return;
    case CAPTAIN_INTEGER: write_number(out, 'n', captain_walk_number(type, value)); return;
    case CAPTAIN_ENUMERATED: write_number(out, 'n', item_index(type, value)); return;
    case CAPTAIN_SMALL_BITS:
    case CAPTAIN_BIT_STRING: write_bits(out, type, value); return;
    case CAPTAIN_FIXED_OCTETS: write_octets(out, 's', (captain_octets){(uint32_t)type->high, value}); return;
    case CAPTAIN_SEQUENCE: write_sequence(out, type, value, depth + 1); return;
    case CAPTAIN_CHOICE: write_choice(out, type, value, depth + 1); return;
    case CAPTAIN_LIST: write_list(out, type->element, captain_walk_list(value), depth + 1); return;
    case CAPTAIN_OPEN: write_open(out, value, depth + 1); return;
    default: write_octets(out, 's', captain_walk_octets(value)); return;
    }
}

captain_status captain_leaves(const captain_type *type, const void *value, captain_sink sink, void *context)
{
    captain_out out;
    captain_out_start(&out, sink, context);
    write_value(&out, type, value, 0);
    return captain_out_end(&out);
}

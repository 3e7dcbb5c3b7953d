/* Values without field names, to compare what two editions decode. */
#include "walk.h"

#include <string.h>

typedef struct leaves {
    captain_out out;
    uint32_t unknown; /* number of additions, alternatives, items and open types that this edition does not know */
} leaves;

static void write_value(leaves *to, const captain_type *type, const void *value, unsigned depth);

static void write_number(leaves *to, char kind, int64_t number)
{
    char text[1 + sizeof number] = {kind};
    memcpy(text + 1, &number, sizeof number); /* native byte order, because values are compared on one machine only */
    captain_out *out = &to->out;
    if (sizeof out->text - out->count > sizeof text) {
        memcpy(out->text + out->count, text, sizeof text);
        out->count += sizeof text;
    } else {
        captain_out_put(out, text, sizeof text);
    }
}

static void write_octets(leaves *to, char kind, captain_octets octets)
{
    write_number(to, kind, octets.count);
    if (octets.count > 0)
        captain_out_put(&to->out, (const char *)octets.octets, octets.count);
}

static void write_unknown(leaves *to, captain_octets octets)
{
    to->unknown++;
    write_octets(to, 'u', octets);
}

/* Write the positions of set bits: named bits of one edition may be unnamed in another. */
static void write_bits(leaves *to, const captain_type *type, const void *value)
{
    uint32_t count = captain_walk_bits(type, value);
    for (uint32_t i = 0; i < count; i++)
        if (captain_walk_bit(type, value, i))
            write_number(to, 'b', i);
    captain_out_character(&to->out, 'B');
}

/* Write the index of an item. It is the same in every edition, unlike its name. */
static void write_item(leaves *to, const captain_type *type, int64_t number)
{
    int32_t index = captain_walk_item(type, number);
    to->unknown += index < 0;
    write_number(to, 'n', index >= 0 ? index : number);
}

/* Write a mark for an absent component of the root: if editions have different components, only the marks show which one is
 * present. An absent addition gets no mark, because an edition may not know it. A default gets none either: its value is
 * written. */
static void write_sequence(leaves *to, const captain_type *type, const void *structure, unsigned depth)
{
    for (unsigned i = 0; i < type->fields_count; i++) {
        const void *value = captain_walk_shown(&type->fields[i], structure);
        if (value != NULL)
            write_value(to, type->fields[i].type, value, depth);
        else if (type->fields[i].addition == 0)
            captain_out_character(&to->out, '-');
    }
    const captain_additions *additions = captain_walk_additions(type, structure);
    for (uint32_t i = 0; additions != NULL && i < additions->count; i++)
        write_unknown(to, additions->unknown[i].octets);
}

/* Write a CHOICE like a number before its alternative, because causeCode was a number before Release 2. */
static void write_choice(leaves *to, const captain_type *type, const void *structure, unsigned depth)
{
    uint32_t choice = *(const uint32_t *)structure;
    if (choice >= CAPTAIN_UNKNOWN) {
        write_number(to, 'x', choice - CAPTAIN_UNKNOWN);
        write_unknown(to, *captain_walk_unknown(type, structure));
    } else if (choice > 0 && choice <= type->fields_count) {
        const captain_field *field = &type->fields[choice - 1];
        const void *value = captain_walk_field(field, structure);
        write_number(to, 'n', (int64_t)choice - 1);
        if (value != NULL)
            write_value(to, field->type, value, depth);
    }
}

static void write_list(leaves *to, const captain_type *element, captain_list list, unsigned depth)
{
    write_number(to, 'l', list.count);
    for (uint32_t i = 0; i < list.count && to->out.status == CAPTAIN_OK; i++)
        write_value(to, element, (const char *)list.items + (size_t)i * element->size, depth);
}

static void write_open(leaves *to, const captain_open *open, unsigned depth)
{
    if (open->type == NULL)
        write_unknown(to, open->octets);
    else if (open->value != NULL)
        write_value(to, open->type, open->value, depth);
}

static void write_value(leaves *to, const captain_type *type, const void *value, unsigned depth)
{
    if (depth >= CAPTAIN_WALK_DEPTH) {
        to->out.status = CAPTAIN_DEPTH;
        return;
    }
    switch (type->kind) {
    case CAPTAIN_BOOLEAN: write_number(to, 'n', *(const bool *)value); return;
    case CAPTAIN_NULL: captain_out_character(&to->out, '0'); return;
    case CAPTAIN_INTEGER: write_number(to, 'n', captain_walk_number(type, value)); return;
    case CAPTAIN_ENUMERATED: write_item(to, type, captain_walk_number(type, value)); return;
    case CAPTAIN_SMALL_BITS:
    case CAPTAIN_BIT_STRING: write_bits(to, type, value); return;
    case CAPTAIN_FIXED_OCTETS: write_octets(to, 's', (captain_octets){(uint32_t)type->high, value}); return;
    case CAPTAIN_SEQUENCE: write_sequence(to, type, value, depth + 1); return;
    case CAPTAIN_CHOICE: write_choice(to, type, value, depth + 1); return;
    case CAPTAIN_LIST: write_list(to, type->element, captain_walk_list(value), depth + 1); return;
    case CAPTAIN_OPEN: write_open(to, value, depth + 1); return;
    default: write_octets(to, 's', captain_walk_octets(value)); return;
    }
}

captain_status captain_leaves(const captain_type *type, const void *value, captain_sink sink, void *context, uint32_t *unknown)
{
    leaves to = {.unknown = 0};
    captain_out_start(&to.out, sink, context);
    write_value(&to, type, value, 0);
    *unknown = to.unknown;
    return captain_out_end(&to.out);
}

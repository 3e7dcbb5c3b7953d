/* A value that is no container, as a line of text shows it. */
#include "walk.h"

/* Above it bit strings are hexadecimal. */
enum { BINARY_BITS = 64 };

static void put_name(captain_out *out, const char *name)
{
    if (name == NULL)
        return;
    captain_out_string(out, " (");
    captain_out_string(out, name);
    captain_out_character(out, ')');
}

static void put_item(captain_out *out, const captain_type *type, int64_t number)
{
    const char *name = captain_walk_name(type, number);
    if (name != NULL) {
        captain_out_string(out, name);
        captain_out_string(out, " (");
        captain_out_integer(out, number);
        captain_out_character(out, ')');
    } else {
        captain_out_character(out, '[');
        captain_out_integer(out, number >= CAPTAIN_UNKNOWN ? number - CAPTAIN_UNKNOWN : number);
        captain_out_string(out, "] (unknown)");
    }
}

static void put_bit_names(captain_out *out, const captain_type *type, const void *value, uint32_t count)
{
    const char *between = " (";
    for (unsigned i = 0; i < type->names_count; i++) {
        int64_t bit = type->names[i].value;
        if (bit < 0 || bit >= count || !captain_walk_bit(type, value, (uint32_t)bit))
            continue;
        captain_out_string(out, between);
        captain_out_string(out, type->names[i].name);
        between = ", ";
    }
    if (between[0] == ',')
        captain_out_character(out, ')');
}

static void put_bits(captain_out *out, const captain_type *type, const void *value)
{
    uint32_t count = type->kind == CAPTAIN_SMALL_BITS ? (uint32_t)type->high : ((const captain_bits *)value)->count;
    captain_out_character(out, '\'');
    if (count > BINARY_BITS)
        captain_out_bits_hex(out, type, value, count);
    else
        for (uint32_t i = 0; i < count; i++)
            captain_out_character(out, captain_walk_bit(type, value, i) ? '1' : '0');
    captain_out_string(out, count > BINARY_BITS ? "'H" : "'B");
    put_bit_names(out, type, value, count);
}

static void put_octets(captain_out *out, const uint8_t *octets, size_t count)
{
    captain_out_character(out, '\'');
    captain_out_hex(out, octets, count);
    captain_out_string(out, "'H");
}

void captain_out_value(captain_out *out, const captain_type *type, const void *value)
{
    captain_octets octets;
    switch (type->kind) {
    case CAPTAIN_BOOLEAN: captain_out_string(out, *(const bool *)value ? "true" : "false"); return;
    case CAPTAIN_NULL: captain_out_string(out, "null"); return;
    case CAPTAIN_INTEGER:
        captain_out_number(out, type, captain_walk_number(type, value));
        put_name(out, captain_walk_name(type, captain_walk_number(type, value)));
        return;
    case CAPTAIN_ENUMERATED: put_item(out, type, captain_walk_number(type, value)); return;
    case CAPTAIN_SMALL_BITS:
    case CAPTAIN_BIT_STRING: put_bits(out, type, value); return;
    case CAPTAIN_FIXED_OCTETS: put_octets(out, value, (size_t)type->high); return;
    default: break;
    }
    octets = captain_walk_octets(value);
    if (type->kind == CAPTAIN_OCTET_STRING)
        put_octets(out, octets.octets, octets.count);
    else if (type->kind == CAPTAIN_OID || type->kind == CAPTAIN_RELATIVE_OID)
        captain_out_oid(out, type->kind == CAPTAIN_RELATIVE_OID, &octets);
    else
        captain_out_quoted(out, (const char *)octets.octets, octets.count);
}

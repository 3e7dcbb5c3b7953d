/* Value other than a container, as one line of text. */
#include "walk.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/* Limit in bits; longer bit strings are printed in hexadecimal. */
enum { BINARY_BITS = 64 };

static void put_name(captain_out *out, const char *name)
{
    if (name == NULL)
        return;
    captain_out_string(out, " (");
    captain_out_string(out, name);
    captain_out_character(out, ')');
}

/* ---------------------------------------------------------------- numbers with a unit */

/* Value of 1 in a unit: digits / 10^places. */
typedef struct scale {
    uint64_t digits;
    unsigned places;
    const char *unit; /* NULL: the unit does not begin with a factor */
} scale;

enum { SCALE_PLACES = 18 };

/* Parse the factor of a unit: "0.01 m/s", "1e-7 degree", "256 ms", "0.01". "ms", "10^exponent Hz" and "360/65535 degree" have
 * none. */
static scale read_scale(const char *unit)
{
    scale of = {0};
    const char *at = unit;
    bool has_point = false;
    for (; (*at >= '0' && *at <= '9') || (*at == '.' && !has_point && at > unit); at++) {
        if (at - unit > SCALE_PLACES)
            return of;
        if (*at == '.') {
            has_point = true;
            continue;
        }
        of.digits = 10 * of.digits + (uint64_t)(*at - '0');
        of.places += has_point;
    }
    if (at > unit && at[0] == 'e' && at[1] == '-' && at[2] >= '1' && at[2] <= '9') {
        of.places += (unsigned)(at[2] - '0');
        at += 3;
    }
    if (at > unit && (*at == ' ' || *at == 0) && of.places <= SCALE_PLACES)
        of.unit = *at == ' ' ? at + 1 : at;
    return of;
}

/* Write a scaled number exactly, with the decimal places of the factor: 2028 of "0.01 m/s" is 20.28 m/s. False above 64 bits. */
static bool put_scaled(captain_out *out, scale of, bool is_negative, uint64_t magnitude)
{
    char digits[24], text[2 * SCALE_PLACES + 8];
    if (of.digits > 0 && magnitude > UINT64_MAX / of.digits)
        return false;
    snprintf(digits, sizeof digits, "%0*" PRIu64, (int)of.places + 1, magnitude * of.digits);
    int whole = (int)(strlen(digits) - of.places);
    snprintf(text, sizeof text, "%s%.*s%s%s", is_negative ? "-" : "", whole, digits, of.places > 0 ? "." : "", digits + whole);
    captain_out_string(out, " (");
    captain_out_string(out, text);
    captain_out_string(out, *of.unit != 0 ? " " : "");
    captain_out_string(out, of.unit);
    captain_out_character(out, ')');
    return true;
}

static void put_unit(captain_out *out, const captain_type *type, const char *unit, int64_t number)
{
    bool is_negative = number < 0 && !captain_walk_is_unsigned64(type);
    uint64_t magnitude = is_negative ? 0 - (uint64_t)number : (uint64_t)number;
    scale of = read_scale(unit);
    if (of.unit != NULL && put_scaled(out, of, is_negative, magnitude))
        return;
    captain_out_character(out, ' ');
    captain_out_string(out, unit);
}

/* A number with a name has no unit: 16383 (unavailable). */
static void put_number(captain_out *out, const captain_type *type, const char *unit, int64_t number)
{
    const char *name = captain_walk_name(type, number);
    captain_out_number(out, type, number);
    put_name(out, name);
    if (name == NULL && unit != NULL)
        put_unit(out, type, unit, number);
}

/* ---------------------------------------------------------------- the others */

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

void captain_out_value(captain_out *out, const captain_type *type, const char *unit, const void *value)
{
    captain_octets octets;
    switch (type->kind) {
    case CAPTAIN_BOOLEAN: captain_out_string(out, *(const bool *)value ? "true" : "false"); return;
    case CAPTAIN_NULL: captain_out_string(out, "null"); return;
    case CAPTAIN_INTEGER:
        put_number(out, type, unit != NULL ? unit : type->unit, captain_walk_number(type, value));
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

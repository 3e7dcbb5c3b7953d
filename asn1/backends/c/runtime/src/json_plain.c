/* Values from JSON of the plain dialect: numbers in SI units, special values and bits by name. */
#include "json.h"

#include <stdio.h>
#include <string.h>

/* ---------------------------------------------------------------- INTEGER */

static captain_status refuse_range(json *from, const captain_type *type, captain_plain of, const char *before, const char *after)
{
    char number[JSON_FOUND], low[PLAIN_TEXT], high[PLAIN_TEXT];
    from->next = before;
    captain_json_found(from, number);
    size_t length = (size_t)(after - from->next);
    if (length < sizeof number - 8)
        number[length] = 0;
    bool has_low = captain_plain_low(type, of, low), has_high = captain_plain_high(type, of, high);
    return captain_walk_refuse(from->report, &from->path, 0, CAPTAIN_RANGE, "%s is not in %s..%s%s%s", number,
                               has_low ? low : "MIN", has_high ? high : "MAX", *of.unit != 0 ? " " : "", of.unit);
}

static captain_status refuse_special(json *from, const captain_type *type, const char *name)
{
    char text[256], shown[JSON_MAX_NAME];
    size_t used = (size_t)snprintf(text, sizeof text, "%.40s is no special value of %.60s; a number",
                                   captain_json_show(name, shown), captain_type_text(type));
    for (unsigned i = 0; i < type->names_count && used < sizeof text - 32; i++)
        if (captain_plain_is_special(type->names[i].name))
            used += (size_t)snprintf(text + used, sizeof text - used, " or %.24s", type->names[i].name);
    snprintf(text + used, sizeof text - used, " is expected");
    return captain_json_refuse(from, CAPTAIN_SYNTAX, text);
}

static captain_status read_special(json *from, const captain_type *type, void *value)
{
    json_string string;
    char name[JSON_MAX_NAME];
    TRY(captain_json_take_string(from, &string, "the name of a special value"));
    captain_json_copy_name(&string, name);
    for (unsigned i = 0; i < type->names_count; i++) {
        if (strcmp(type->names[i].name, name) != 0 || !captain_plain_is_special(name))
            continue;
        TRY(captain_check_number(type, type->names[i].value, from->report, &from->path));
        captain_walk_set_number(type, value, type->names[i].value);
        return CAPTAIN_OK;
    }
    return refuse_special(from, type, name);
}

captain_status captain_json_read_plain_integer(json *from, const captain_type *type, const char *unit, void *value)
{
    int64_t number;
    bool is_small;
    if (captain_json_is(from, '"'))
        return read_special(from, type, value);
    captain_plain of = captain_plain_of(type, unit);
    const char *before = from->next;
    TRY(captain_json_scaled(from, &of, captain_walk_is_unsigned64(type), &number, &is_small));
    if (!is_small || !captain_plain_in_range(type, number))
        return refuse_range(from, type, of, before, from->next);
    captain_walk_set_number(type, value, number);
    return CAPTAIN_OK;
}

/* ---------------------------------------------------------------- BIT STRING */

/* Limit of positions: 64 KiB of memory for a few characters. */
enum { MAX_BITS = 1 << 19 };

/* Read the position of one bit: "brakePedalEngaged", or "[7]" for a bit without a name. */
static captain_status read_bit(json *from, const captain_type *type, int64_t *bit)
{
    json_string string;
    char name[JSON_MAX_NAME], shown[JSON_MAX_NAME], text[256];
    TRY(captain_json_take_string(from, &string, "the name of a bit in quotes"));
    captain_json_copy_name(&string, name);
    *bit = captain_json_bracket(name);
    for (unsigned i = 0; i < type->names_count; i++)
        if (strcmp(type->names[i].name, name) == 0)
            *bit = type->names[i].value;
    bool is_bounded = !(type->flags & (CAPTAIN_EXTENSIBLE | CAPTAIN_UNBOUNDED_HIGH));
    if (*bit >= 0 && *bit < (is_bounded ? type->high : MAX_BITS))
        return CAPTAIN_OK;
    const char *near = captain_walk_nearest(name, type->names, sizeof *type->names, type->names_count);
    snprintf(text, sizeof text, "%.60s is no bit of %.60s%s%.60s%s", captain_json_show(name, shown), captain_type_text(type),
             near != NULL ? "; did you mean " : "", near != NULL ? near : "", near != NULL ? "?" : "");
    return captain_json_refuse(from, CAPTAIN_ALTERNATIVE, text);
}

/* Read the list twice: without octets it returns the number of bits, with octets it sets them. */
static captain_status read_bits(json *from, const captain_type *type, uint8_t *octets, int64_t *count)
{
    bool is_more;
    int64_t bit;
    TRY(captain_json_open(from, '[', "a list of the bits that are set", &is_more));
    for (uint64_t i = 0; is_more; i++) {
        size_t path = captain_path_push_index(&from->path, i);
        TRY(read_bit(from, type, &bit));
        uint8_t mask = (uint8_t)(0x80 >> (bit % 8));
        if (octets != NULL && octets[bit / 8] & mask)
            return captain_json_refuse(from, CAPTAIN_SYNTAX, "the bit is there twice");
        if (octets != NULL)
            octets[bit / 8] |= mask;
        captain_path_pop(&from->path, path);
        *count = bit >= *count ? bit + 1 : *count;
        TRY(captain_json_more(from, '[', &is_more));
    }
    return CAPTAIN_OK;
}

captain_status captain_json_read_named_bits(json *from, const captain_type *type, void *value)
{
    void *memory;
    int64_t count = type->low;
    captain_json_blanks(from);
    const char *before = from->next;
    TRY(read_bits(from, type, NULL, &count));
    TRY(captain_check_size(type, (uint64_t)count, from->report, &from->path));
    TRY(captain_json_take_memory(from, (size_t)count / 8 + 1, &memory));
    memset(memory, 0, (size_t)count / 8 + 1);
    from->next = before;
    TRY(read_bits(from, type, memory, &count));
    captain_json_store_bits(type, value, memory, (uint32_t)count);
    return CAPTAIN_OK;
}

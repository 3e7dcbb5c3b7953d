/* Strings from JSON: bits, octets, characters, and object identifiers. */
#include "json.h"

#include <stdio.h>
#include <string.h>

/* ---------------------------------------------------------------- hexadecimal text */

/* Scan a string of hexadecimal digits: an even number, without escapes. */
static captain_status take_hex(json *from, json_string *string, size_t *octets)
{
    captain_json_blanks(from);
    const char *before = from->next;
    TRY(captain_json_take_string(from, string, "hexadecimal text in quotes"));
    bool is_hex = string->octets % 2 == 0;
    for (size_t i = 0; is_hex && i < string->octets; i++)
        is_hex = captain_json_hex(string->from[i]) >= 0;
    *octets = string->octets / 2;
    if (is_hex)
        return CAPTAIN_OK;
    from->next = before;
    return captain_json_refuse_found(from, CAPTAIN_SYNTAX, "hexadecimal text, two digits an octet,");
}

static void copy_hex(const json_string *string, uint8_t *octets)
{
    for (size_t i = 0; i < string->octets / 2; i++)
        octets[i] = (uint8_t)(captain_json_hex(string->from[2 * i]) << 4 | captain_json_hex(string->from[2 * i + 1]));
}

static captain_status store_hex(json *from, const json_string *string, captain_octets *octets)
{
    void *memory = NULL;
    size_t count = string->octets / 2;
    if (count > UINT32_MAX)
        return captain_json_refuse(from, CAPTAIN_SIZE, "a string has at most 4294967295 octets");
    if (count > 0)
        TRY(captain_json_take_memory(from, count, &memory));
    copy_hex(string, memory);
    *octets = (captain_octets){(uint32_t)count, memory};
    return CAPTAIN_OK;
}

captain_status captain_json_octets(json *from, captain_octets *octets)
{
    json_string string;
    size_t count;
    TRY(take_hex(from, &string, &count));
    return store_hex(from, &string, octets);
}

captain_status captain_json_read_octets(json *from, const captain_type *type, void *value)
{
    json_string string;
    size_t count;
    TRY(take_hex(from, &string, &count));
    TRY(captain_check_size(type, count, from->report, &from->path));
    if (type->kind == CAPTAIN_FIXED_OCTETS) {
        copy_hex(&string, value);
        return CAPTAIN_OK;
    }
    captain_octets octets;
    TRY(store_hex(from, &string, &octets));
    memcpy(value, &octets, sizeof octets);
    return CAPTAIN_OK;
}

/* ---------------------------------------------------------------- BIT STRING */

/* {"value": hex, "length": bits}, in either order. */
static captain_status take_bits(json *from, json_string *string, size_t *octets, int64_t *bits)
{
    bool is_more, has_value = false;
    char name[JSON_MAX_NAME];
    *bits = -1;
    TRY(captain_json_open(from, '{', "an object with value and length", &is_more));
    while (is_more) {
        TRY(captain_json_name(from, name));
        bool is_value = strcmp(name, "value") == 0, is_length = strcmp(name, "length") == 0;
        if (!is_value && !is_length)
            return captain_json_refuse(from, CAPTAIN_SYNTAX, "a bit string has only the members value and length");
        if (is_value ? has_value : *bits >= 0)
            return captain_json_refuse(from, CAPTAIN_SYNTAX, "a member of the bit string is there twice");
        if (is_value)
            TRY(take_hex(from, string, octets));
        else
            TRY(captain_json_integer(from, false, bits));
        has_value |= is_value;
        if (*bits < -1 || (is_length && *bits < 0) || *bits > UINT32_MAX)
            return captain_json_refuse(from, CAPTAIN_RANGE, "the length of a bit string is in 0..4294967295");
        TRY(captain_json_more(from, '{', &is_more));
    }
    if (!has_value || *bits < 0)
        return captain_json_refuse(from, CAPTAIN_PRESENCE, "a bit string has the members value and length");
    return CAPTAIN_OK;
}

captain_status captain_json_read_bits(json *from, const captain_type *type, void *value)
{
    json_string string;
    size_t octets = 0;
    int64_t bits = type->high;
    bool is_fixed = captain_walk_is_fixed(type);
    if (is_fixed)
        TRY(take_hex(from, &string, &octets));
    else
        TRY(take_bits(from, &string, &octets, &bits));
    bool is_filled = (type->flags & CAPTAIN_NAMED_BITS) && bits < type->low; /* encode adds the missing zeros (16.3) */
    TRY(captain_check_size(type, (uint64_t)(is_filled ? type->low : bits), from->report, &from->path));
    if (octets != ((uint64_t)bits + 7) / 8) {
        char text[96];
        snprintf(text, sizeof text, "%lld bits take %lld octets, %zu are there", (long long)bits, (long long)(bits + 7) / 8,
                 octets);
        return captain_json_refuse(from, CAPTAIN_SIZE, text);
    }
    unsigned unused = (unsigned)(octets * 8 - (uint64_t)bits);
    if (octets > 0 && captain_json_hex(string.from[2 * octets - 1]) & ((1 << (unused < 4 ? unused : 4)) - 1))
        return captain_json_refuse(from, CAPTAIN_SIZE, "bits behind the end of the string are not zero");
    if (unused > 4 && captain_json_hex(string.from[2 * octets - 2]) & ((1 << (unused - 4)) - 1))
        return captain_json_refuse(from, CAPTAIN_SIZE, "bits behind the end of the string are not zero");
    if (type->kind == CAPTAIN_SMALL_BITS) {
        uint8_t memory[8] = {0};
        copy_hex(&string, memory);
        captain_json_store_bits(type, value, memory, (uint32_t)bits);
        return CAPTAIN_OK;
    }
    captain_octets stored;
    TRY(store_hex(from, &string, &stored));
    captain_json_store_bits(type, value, stored.octets, (uint32_t)bits);
    return CAPTAIN_OK;
}

void captain_json_store_bits(const captain_type *type, void *value, const uint8_t *octets, uint32_t count)
{
    uint64_t number = 0;
    if (type->kind != CAPTAIN_SMALL_BITS) {
        *(captain_bits *)value = (captain_bits){count, octets};
        return;
    }
    for (uint32_t i = 0; i < (count + 7) / 8; i++)
        number = number << 8 | octets[i];
    captain_walk_set_number(type, value, (int64_t)(number >> ((8 - count % 8) % 8)));
}

/* ---------------------------------------------------------------- character strings */

/* Copy text to the arena, terminated by 0. */
static captain_status take_text(json *from, captain_text *text, const char *expected)
{
    json_string string;
    void *memory;
    TRY(captain_json_take_string(from, &string, expected));
    if (string.octets > UINT32_MAX)
        return captain_json_refuse(from, CAPTAIN_SIZE, "a string has at most 4294967295 octets");
    TRY(captain_json_take_memory(from, string.octets + 1, &memory));
    captain_json_copy(&string, memory);
    ((char *)memory)[string.octets] = 0;
    *text = (captain_text){(uint32_t)string.octets, memory};
    return CAPTAIN_OK;
}

captain_status captain_json_read_text(json *from, const captain_type *type, captain_text *value)
{
    TRY(take_text(from, value, "text in quotes"));
    if (type->kind != CAPTAIN_UTF8) /* PER ignores its size (30.6) */
        TRY(captain_check_size(type, value->count, from->report, &from->path));
    bool in_root = captain_walk_in_size(type, value->count);
    return captain_check_text(type, in_root, value->text, value->count, from->report, &from->path);
}

/* ---------------------------------------------------------------- object identifiers (X.690 8.19, 8.20) */

static bool take_arc(const char **at, uint64_t *arc)
{
    const char *start = *at;
    for (*arc = 0; **at >= '0' && **at <= '9'; ++*at) {
        unsigned digit = (unsigned)(**at - '0');
        if (*arc > (UINT64_MAX - digit) / 10)
            return false;
        *arc = *arc * 10 + digit;
    }
    return *at > start && (*start != '0' || *at == start + 1);
}

/* Write an arc with seven bits per octet, in at most ten octets. */
static uint8_t *put_arc(uint8_t *to, uint64_t arc)
{
    unsigned more = 0;
    while (more < 9 && arc >> (7 * (more + 1)) != 0)
        more++;
    for (;; more--) {
        *to++ = (uint8_t)((arc >> (7 * more) & 0x7f) | (more > 0 ? 0x80 : 0));
        if (more == 0)
            return to;
    }
}

/* Convert "1.2.840". An arc has no more octets than digits with its point. Returns the octets; 0 if invalid. */
static size_t arcs_to_octets(const char *at, bool is_relative, uint8_t *to)
{
    uint8_t *start = to;
    uint64_t arc, second;
    if (!is_relative) {
        if (!take_arc(&at, &arc) || arc > 2 || *at++ != '.' || !take_arc(&at, &second) || (arc < 2 && second > 39)
            || second > UINT64_MAX - 80)
            return 0;
        to = put_arc(to, 40 * arc + second);
        if (*at == 0)
            return (size_t)(to - start);
        if (*at++ != '.')
            return 0;
    }
    for (;;) {
        if (!take_arc(&at, &arc))
            return 0;
        to = put_arc(to, arc);
        if (*at == 0)
            return (size_t)(to - start);
        if (*at++ != '.')
            return 0;
    }
}

/* Convert "[2a8648]": octets that are not a printable identifier. */
static size_t brackets_to_octets(const captain_text *text, uint8_t *to)
{
    size_t digits = text->count - 2, count = digits / 2;
    if (text->text[text->count - 1] != ']' || digits % 2 != 0)
        return SIZE_MAX;
    for (size_t i = 0; i < digits; i++)
        if (captain_json_hex(text->text[1 + i]) < 0)
            return SIZE_MAX;
    json_string string = {text->text + 1, text->text + 1 + digits, digits};
    copy_hex(&string, to);
    return count;
}

size_t captain_json_oid(const captain_text *text, bool is_relative, uint8_t *octets)
{
    if (text->count >= 2 && text->text[0] == '[')
        return brackets_to_octets(text, octets);
    size_t count = strlen(text->text) == text->count ? arcs_to_octets(text->text, is_relative, octets) : 0;
    return count == 0 ? SIZE_MAX : count;
}

captain_status captain_json_read_oid(json *from, const captain_type *type, void *value)
{
    captain_text text = {0, NULL};
    void *memory;
    TRY(take_text(from, &text, "an object identifier in quotes"));
    TRY(captain_json_take_memory(from, text.count + 2u, &memory));
    size_t count = captain_json_oid(&text, type->kind == CAPTAIN_RELATIVE_OID, memory);
    if (count == SIZE_MAX)
        return captain_json_refuse(from, CAPTAIN_SYNTAX, "numbers with points between them are expected, as 1.2.840");
    captain_octets octets = {(uint32_t)count, memory};
    if (!captain_walk_is_oid(&octets))
        return captain_json_refuse(from, CAPTAIN_RANGE, "the octets are no object identifier");
    memcpy(value, &octets, sizeof octets);
    return CAPTAIN_OK;
}

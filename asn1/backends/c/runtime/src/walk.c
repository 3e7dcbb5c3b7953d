/* Access to values in memory through the tables. */
#include "walk.h"
#include "characters.h"

#include <string.h>

/* ---------------------------------------------------------------- numbers */

#define READ(TYPE) do { TYPE number_; memcpy(&number_, value, sizeof number_); return (int64_t)number_; } while (0)
#define WRITE(TYPE) do { TYPE number_ = (TYPE)number; memcpy(value, &number_, sizeof number_); return; } while (0)

static bool is_signed(const captain_type *type)
{
    return type->kind == CAPTAIN_ENUMERATED || (type->flags & CAPTAIN_SIGNED) != 0;
}

int64_t captain_walk_number(const captain_type *type, const void *value)
{
    unsigned width = type->kind == CAPTAIN_ENUMERATED ? 4u : type->width;
    if (is_signed(type)) {
        switch (width) {
        case 1: READ(int8_t);
        case 2: READ(int16_t);
        case 4: READ(int32_t);
        default: READ(int64_t);
        }
    }
    switch (width) {
    case 1: READ(uint8_t);
    case 2: READ(uint16_t);
    case 4: READ(uint32_t);
    default: READ(uint64_t);
    }
}

void captain_walk_set_number(const captain_type *type, void *value, int64_t number)
{
    switch (type->kind == CAPTAIN_ENUMERATED ? 4u : type->width) {
    case 1: WRITE(uint8_t);
    case 2: WRITE(uint16_t);
    case 4: WRITE(uint32_t);
    default: WRITE(uint64_t);
    }
}

bool captain_walk_is_unsigned64(const captain_type *type)
{
    return type->width == 8 && !is_signed(type);
}

bool captain_walk_in_range(const captain_type *type, int64_t number)
{
    bool is_unsigned = captain_walk_is_unsigned64(type);
    if (!(type->flags & CAPTAIN_UNBOUNDED_LOW)
        && (is_unsigned ? (uint64_t)number < (uint64_t)type->low : number < type->low))
        return false;
    return (type->flags & CAPTAIN_UNBOUNDED_HIGH)
           || (is_unsigned ? (uint64_t)number <= (uint64_t)type->high : number <= type->high);
}

bool captain_walk_in_size(const captain_type *type, uint64_t count)
{
    return count >= (uint64_t)type->low && ((type->flags & CAPTAIN_UNBOUNDED_HIGH) || count <= (uint64_t)type->high);
}

bool captain_walk_in_gap(const captain_type *type, int64_t number)
{
    for (unsigned i = 0; i < type->gaps_count; i++)
        if (number >= type->gaps[i].low && number <= type->gaps[i].high)
            return true;
    return false;
}

bool captain_walk_is_fixed(const captain_type *type)
{
    return !(type->flags & (CAPTAIN_EXTENSIBLE | CAPTAIN_UNBOUNDED_HIGH)) && type->low == type->high;
}

/* ---------------------------------------------------------------- characters */

bool captain_walk_is_string(const captain_type *type)
{
    return type->kind >= CAPTAIN_IA5 && type->kind <= CAPTAIN_UTF8;
}

int32_t captain_walk_character(const captain_type *type, bool in_root, uint32_t n)
{
    captain_characters set = in_root ? captain_alphabet(type) : captain_whole_alphabet(type);
    for (unsigned i = 0; i < set.count; i++) {
        uint32_t length = (uint32_t)(set.ranges[i].high - set.ranges[i].low + 1);
        if (n < length)
            return (int32_t)(set.ranges[i].low + n);
        n -= length;
    }
    return -1;
}

bool captain_walk_has_character(const captain_type *type, bool in_root, uint32_t code)
{
    captain_characters set = in_root ? captain_alphabet(type) : captain_whole_alphabet(type);
    return code <= 0xff && captain_code_of(&set, (unsigned char)code) >= 0;
}

bool captain_walk_is_oid(const captain_octets *oid)
{
    return captain_is_oid(oid->octets, oid->count);
}

bool captain_utf8_feed(captain_utf8 *state, uint8_t octet)
{
    if (state->left > 0) {
        if ((octet & 0xc0) != 0x80)
            return false;
        state->code = state->code << 6 | (octet & 0x3fu);
        if (--state->left > 0)
            return true;
        bool is_surrogate = state->code >= 0xd800 && state->code <= 0xdfff;
        return state->code >= state->least && state->code <= 0x10ffff && !is_surrogate;
    }
    if (octet < 0x80) {
        state->code = octet;
        return true;
    }
    if (octet < 0xc2 || octet > 0xf4)
        return false;
    state->left = octet < 0xe0 ? 1 : octet < 0xf0 ? 2 : 3;
    state->least = octet < 0xe0 ? 0x80 : octet < 0xf0 ? 0x800 : 0x10000;
    state->code = octet & (0x3fu >> state->left);
    return true;
}

bool captain_utf8_is_valid(const char *text, size_t octets)
{
    return captain_utf8_count((const unsigned char *)text, octets) != SIZE_MAX;
}

/* ---------------------------------------------------------------- components */

captain_octets captain_walk_octets(const void *value)
{
    captain_octets octets;
    memcpy(&octets, value, sizeof octets);
    return octets;
}

captain_list captain_walk_list(const void *value)
{
    captain_list list;
    memcpy(&list, value, sizeof list);
    return list;
}

captain_octets *captain_walk_unknown(const captain_type *type, const void *value)
{
    return (captain_octets *)((uintptr_t)value + type->fields[0].offset); /* all alternatives have the offset of the union */
}

const void *captain_walk_field(const captain_field *field, const void *structure)
{
    const void *value = (const char *)structure + field->offset;
    if (!(field->flags & CAPTAIN_POINTER))
        return value;
    void *pointer;
    memcpy(&pointer, value, sizeof pointer);
    return pointer;
}

bool captain_walk_is_present(const captain_field *field, const void *structure)
{
    if (field->present == CAPTAIN_NOWHERE)
        return true;
    return *(const bool *)((const char *)structure + field->present);
}

const void *captain_walk_effective(const captain_field *field, const void *structure)
{
    if (captain_walk_is_present(field, structure))
        return captain_walk_field(field, structure);
    return (field->flags & CAPTAIN_DEFAULT) ? field->default_value : NULL;
}

const void *captain_walk_shown(const captain_field *field, const void *structure)
{
    if (field->addition > 0 && !captain_walk_is_present(field, structure))
        return NULL;
    return captain_walk_effective(field, structure);
}

const captain_additions *captain_walk_additions(const captain_type *type, const void *structure)
{
    if (type->additions == CAPTAIN_NOWHERE)
        return NULL;
    void *pointer;
    memcpy(&pointer, (const char *)structure + type->additions, sizeof pointer);
    return pointer;
}

uint32_t captain_walk_bitmap(const captain_additions *additions)
{
    return additions == NULL ? 0 : additions->bits;
}

/* ---------------------------------------------------------------- names, rows, bits */

int32_t captain_walk_item(const captain_type *type, int64_t number)
{
    for (unsigned i = 0; i < type->names_count; i++)
        if (type->names[i].value == number)
            return (int32_t)i;
    return -1;
}

const char *captain_walk_name(const captain_type *type, int64_t number)
{
    int32_t item = captain_walk_item(type, number);
    return item < 0 ? NULL : type->names[item].name;
}

const captain_type *captain_walk_row(const captain_type *type, int64_t id)
{
    return captain_row_of(type, id);
}

bool captain_walk_bit(const captain_type *type, const void *value, uint32_t n)
{
    if (type->kind == CAPTAIN_SMALL_BITS)
        return ((uint64_t)captain_walk_number(type, value) >> ((uint64_t)type->high - 1 - n)) & 1;
    const captain_bits *bits = value;
    return (bits->octets[n / 8] >> (7 - n % 8)) & 1;
}

uint32_t captain_walk_bits(const captain_type *type, const void *value)
{
    if (type->kind == CAPTAIN_SMALL_BITS)
        return (uint32_t)type->high;
    uint32_t count = ((const captain_bits *)value)->count;
    if (type->flags & CAPTAIN_NAMED_BITS)
        while (count > 0 && !captain_walk_bit(type, value, count - 1))
            count--;
    return count;
}

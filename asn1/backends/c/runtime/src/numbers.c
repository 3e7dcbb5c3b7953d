/* Lengths, unbounded numbers, normally small numbers, enumeration items. */
#include "bits.h"

enum { FRAGMENT = 65536 }; /* octets or items of the largest fragment (11.9.3.8) */

size_t captain_get_length(captain_reader *reader, size_t at, uint32_t *length, bool *more)
{
    uint64_t bits;
    *more = false;
    if (reader->end - at < 8)
        return captain_fail(reader, at, CAPTAIN_TRUNCATED);
    bits = captain_peek(reader, at);
    if (bits >> 63 == 0) {
        *length = (uint32_t)(bits >> 56);
        return at + 8;
    }
    if (bits >> 62 == 2) {
        if (reader->end - at < 16)
            return captain_fail(reader, at, CAPTAIN_TRUNCATED);
        *length = (uint32_t)(bits >> 48) & 0x3fff;
        return at + 16;
    }
    *length = ((uint32_t)(bits >> 56) & 0x3f) << 14;
    *more = true;
    return *length == 0 || *length > 4u << 14 ? captain_fail(reader, at, CAPTAIN_LENGTH) : at + 8;
}

/* Read the 1 to 8 octets of a number, with the length before them. */
static size_t get_number(captain_reader *reader, size_t at, unsigned *octets, uint64_t *bits)
{
    uint32_t length = 0;
    bool more;
    size_t start = at;
    at = captain_get_length(reader, at, &length, &more);
    if (at == CAPTAIN_FAILED)
        return at;
    if (length == 0 || more)
        return captain_fail(reader, start, CAPTAIN_LENGTH);
    if (length > 8)
        return captain_fail(reader, start, CAPTAIN_RANGE);
    *octets = length;
    return captain_get_long(reader, at, length * 8, bits);
}

size_t captain_get_semi(captain_reader *reader, size_t at, int64_t low, int64_t *value)
{
    unsigned octets;
    uint64_t bits = 0;
    size_t start = at;
    at = get_number(reader, at, &octets, &bits);
    if (at != CAPTAIN_FAILED && bits > (uint64_t)INT64_MAX - (uint64_t)low)
        return captain_fail(reader, start, CAPTAIN_RANGE);
    *value = (int64_t)((uint64_t)low + bits);
    return at;
}

size_t captain_get_unconstrained(captain_reader *reader, size_t at, int64_t *value)
{
    unsigned octets = 8;
    uint64_t bits = 0, sign;
    at = get_number(reader, at, &octets, &bits);
    sign = UINT64_C(1) << (octets * 8 - 1);
    *value = (int64_t)((bits ^ sign) - sign);
    return at;
}

size_t captain_get_small(captain_reader *reader, size_t at, uint32_t *value)
{
    int64_t large = 0;
    size_t start = at;
    if (reader->end - at < 7)
        return captain_fail(reader, at, CAPTAIN_TRUNCATED);
    if (captain_peek(reader, at) >> 63 == 0) {
        *value = (uint32_t)(captain_peek(reader, at) >> 57);
        return at + 7;
    }
    at = captain_get_semi(reader, at + 1, 0, &large);
    if (at != CAPTAIN_FAILED && large >= CAPTAIN_UNKNOWN)
        return captain_fail(reader, start, CAPTAIN_RANGE);
    *value = (uint32_t)large;
    return at;
}

size_t captain_get_item(captain_reader *reader, size_t at, const captain_type *type, int32_t *value)
{
    uint32_t index = 0;
    at = captain_get_small(reader, at, &index);
    if (index < (uint32_t)(type->names_count - type->root_count))
        *value = (int32_t)type->names[type->root_count + index].value;
    else
        *value = CAPTAIN_UNKNOWN + (int32_t)index;
    return at;
}

size_t captain_put_length(captain_writer *writer, size_t at, size_t length)
{
    return length < 128 ? captain_put_bits(writer, at, length, 8) : captain_put_bits(writer, at, 0x8000u | length, 16);
}

size_t captain_put_fragment(captain_writer *writer, size_t at, size_t left, size_t *length, bool *more)
{
    *more = left >= 16384;
    *length = *more ? (left < FRAGMENT ? left & ~(size_t)16383 : FRAGMENT) : left;
    return *more ? captain_put_bits(writer, at, 0xc0u | *length >> 14, 8) : captain_put_length(writer, at, left);
}

static size_t put_number(captain_writer *writer, size_t at, unsigned octets, uint64_t bits)
{
    at = captain_put_bits(writer, at, octets, 8);
    return captain_put_long(writer, at, octets == 8 ? bits : bits & ((UINT64_C(1) << octets * 8) - 1), octets * 8);
}

size_t captain_put_semi(captain_writer *writer, size_t at, int64_t low, int64_t value)
{
    uint64_t bits = (uint64_t)value - (uint64_t)low;
    unsigned octets = 1;
    while (octets < 8 && bits >> octets * 8 != 0)
        octets++;
    return put_number(writer, at, octets, bits);
}

size_t captain_put_unconstrained(captain_writer *writer, size_t at, int64_t value)
{
    uint64_t magnitude = value < 0 ? ~(uint64_t)value : (uint64_t)value;
    unsigned octets = 1;
    while (octets < 8 && magnitude >> (octets * 8 - 1) != 0)
        octets++;
    return put_number(writer, at, octets, (uint64_t)value);
}

size_t captain_put_small(captain_writer *writer, size_t at, uint32_t value)
{
    return value < 64 ? captain_put_bits(writer, at, value, 7) : captain_put_semi(writer, captain_put_bits(writer, at, 1, 1), 0, value);
}

int32_t captain_item_index(const captain_type *type, int32_t value)
{
    for (int32_t i = 0; i < (int32_t)type->names_count; i++)
        if (type->names[i].value == value)
            return i;
    return -1;
}

size_t captain_encode_item(captain_writer *writer, size_t at, const captain_type *type, int32_t value)
{
    int32_t index = captain_item_index(type, value) - (int32_t)type->root_count;
    if (index < 0)
        index = value >= CAPTAIN_UNKNOWN ? value - CAPTAIN_UNKNOWN : -1;
    return index < 0 ? captain_refuse(writer, CAPTAIN_ALTERNATIVE) : captain_put_small(writer, at, (uint32_t)index);
}

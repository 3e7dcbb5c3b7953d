/* Octets and bits as 64-bit numbers. */
#include "cdr.h"
#include "walk.h"

static const captain_path NOWHERE; /* these checks write no report */

uint64_t captain_cdr_turn(uint64_t bits, unsigned size)
{
    uint64_t turned = 0;
    for (unsigned i = 0; i < size; i++, bits >>= 1)
        turned = turned << 1 | (bits & 1);
    return turned;
}

size_t captain_cdr_put_wide(captain_cdr_writer *w, size_t at, const uint8_t *octets, uint32_t count)
{
    at = captain_cdr_put(w, at, count, 4);
    for (uint32_t i = 0; i < count; i++)
        at = captain_cdr_put(w, at, octets[i], 8);
    return at;
}

size_t captain_cdr_get_wide(captain_cdr_reader *r, size_t at, captain_octets *octets, const captain_type *type, const char *name)
{
    at = captain_cdr_get_count(r, at, 8, &octets->count, name);
    if (at == CAPTAIN_FAILED)
        return at;
    if (captain_check_size(type, octets->count, NULL, &NOWHERE) != CAPTAIN_OK)
        return captain_cdr_bad_count(r, at - 4, octets->count, type, name);
    uint8_t *into = captain_arena_take(r->arena, octets->count + (size_t)1);
    if (into == NULL)
        return captain_cdr_no_memory(r, at, name);
    octets->octets = into;
    for (uint32_t i = 0; i < octets->count; i++) {
        at = captain_cdr_align(at, 8) + 8;
        if (at > r->size)
            return captain_cdr_cut(r, at - 8, name);
        uint64_t number = captain_cdr_load(r, at, 8);
        if (number > 255)
            return captain_cdr_bad_octet(r, at - 8, (int64_t)number, name);
        into[i] = (uint8_t)number;
    }
    return at;
}

static unsigned length_of(uint64_t number)
{
    unsigned length = 0;
    for (; number != 0; number >>= 1)
        length++;
    return length;
}

static uint64_t least_of(const captain_type *type, uint64_t number)
{
    uint64_t length = length_of(number);
    return length < (uint64_t)type->low ? (uint64_t)type->low : length;
}

uint64_t captain_cdr_bits_number(captain_cdr_writer *w, const captain_type *type, const captain_bits *bits)
{
    uint64_t number = 0;
    for (uint32_t i = 0; i < bits->count && i < 64; i++)
        number |= (uint64_t)(bits->octets[i / 8] >> (7 - i % 8) & 1) << i;
    bool is_whole = type->flags & CAPTAIN_NAMED_BITS ? captain_walk_bits(type, bits) <= 64 : bits->count == least_of(type, number);
    if (!is_whole)
        captain_cdr_leave(w, type, bits);
    return number;
}

size_t captain_cdr_number_bits(captain_cdr_reader *r, size_t at, captain_bits *bits, const captain_type *type, const char *name)
{
    uint64_t number = captain_cdr_load(r, at, 8), count = least_of(type, number);
    uint8_t *octets = captain_arena_take(r->arena, count / 8 + 1);
    if (octets == NULL)
        return captain_cdr_no_memory(r, at, name);
    memset(octets, 0, count / 8 + 1);
    for (unsigned i = 0; i < 64; i++)
        if (number >> i & 1)
            octets[i / 8] |= (uint8_t)(0x80 >> i % 8);
    *bits = (captain_bits){(uint32_t)count, octets};
    return captain_check_size(type, count, NULL, &NOWHERE) == CAPTAIN_OK ? at : captain_cdr_bad_bits(r, at - 8, (int64_t)number, type, name);
}

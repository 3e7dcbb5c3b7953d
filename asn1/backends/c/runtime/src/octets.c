/* Strings of bits and octets, contiguous or in fragments. */
#include "bits.h"

/* Copy bits that are within `end`; the last octet is padded with zeros. */
static void copy_bits(const captain_reader *reader, size_t at, uint8_t *to, size_t bits)
{
    if ((at & 7) == 0 && bits >= 8) {
        memcpy(to, reader->octets + at / 8, bits / 8);
        to += bits / 8;
        at += bits & ~(size_t)7;
        bits &= 7;
    }
    for (; bits >= 32; bits -= 32, at += 32, to += 4) {
        uint64_t word = captain_load(reader, at);
        to[0] = (uint8_t)(word >> 56);
        to[1] = (uint8_t)(word >> 48);
        to[2] = (uint8_t)(word >> 40);
        to[3] = (uint8_t)(word >> 32);
    }
    for (; bits != 0; at += 8, to++) {
        size_t part = bits < 8 ? bits : 8;
        *to = (uint8_t)((captain_peek(reader, at) >> 56) & (0xff00u >> part));
        bits -= part;
    }
}

size_t captain_get_octets(captain_reader *reader, size_t at, uint8_t *octets, size_t count)
{
    if ((reader->end - at) / 8 < count)
        return captain_fail(reader, at, CAPTAIN_TRUNCATED);
    copy_bits(reader, at, octets, count * 8);
    return at + count * 8;
}

size_t captain_get_units(captain_reader *reader, size_t at, unsigned unit, size_t *count)
{
    uint32_t length = 0;
    bool more;
    *count = 0;
    do {
        at = captain_get_length(reader, at, &length, &more);
        if (at == CAPTAIN_FAILED || !captain_is_believed(reader, at, unit == 0 ? *count + length : length, unit))
            return CAPTAIN_FAILED;
        *count += length;
        at += (size_t)length * unit;
    } while (more);
    return at;
}

/* Read the string a second time, now into memory. Fragments except the last are whole octets. A zero octet is appended for
 * texts. */
static const uint8_t *copy_units(captain_reader *reader, size_t at, unsigned unit, size_t bits)
{
    uint32_t length = 0;
    bool more;
    uint8_t *octets = captain_take(reader, at, (bits + 7) / 8 + 1);
    uint8_t *to = octets;
    if (octets == NULL)
        return NULL;
    octets[(bits + 7) / 8] = 0;
    do {
        at = captain_get_length(reader, at, &length, &more);
        copy_bits(reader, at, to, (size_t)length * unit);
        to += (size_t)length * unit / 8;
        at += (size_t)length * unit;
    } while (more);
    return octets;
}

size_t captain_get_string(captain_reader *reader, size_t at, unsigned unit, size_t *count, const uint8_t **octets)
{
    size_t start = at;
    at = captain_get_units(reader, at, unit, count);
    *octets = NULL;
    if (at == CAPTAIN_FAILED)
        return at;
    *octets = copy_units(reader, start, unit, *count * unit);
    return *octets == NULL ? CAPTAIN_FAILED : at;
}

size_t captain_get_sized(captain_reader *reader, size_t at, size_t bits, const uint8_t **octets)
{
    uint8_t *to = NULL;
    if (reader->end - at < bits)
        return captain_fail(reader, at, CAPTAIN_TRUNCATED);
    if (bits != 0) {
        to = captain_take(reader, at, (bits + 7) / 8);
        if (to == NULL)
            return CAPTAIN_FAILED;
        copy_bits(reader, at, to, bits);
    }
    *octets = to;
    return at + bits;
}

size_t captain_put_sized(captain_writer *writer, size_t at, const uint8_t *octets, size_t bits)
{
    for (; bits >= 32; bits -= 32, octets += 4)
        at = captain_put(writer, at, (uint32_t)octets[0] << 24 | (uint32_t)octets[1] << 16 | (uint32_t)octets[2] << 8 | octets[3], 32);
    for (; bits >= 8; bits -= 8, octets++)
        at = captain_put_bits(writer, at, *octets, 8);
    return bits == 0 ? at : captain_put_bits(writer, at, (uint64_t)*octets >> (8 - bits), (unsigned)bits);
}

size_t captain_put_octets(captain_writer *writer, size_t at, const uint8_t *octets, size_t count)
{
    return captain_put_sized(writer, at, octets, count * 8);
}

/* Reader and writer of bits: cases that captain_load and captain_put do not handle. */
#include "bits.h"

size_t captain_fail(captain_reader *reader, size_t at, captain_status status)
{
    reader->status = status;
    reader->reached = at;
    return CAPTAIN_FAILED;
}

/* Load within eight octets of the end. Bits after the end read as zero. */
uint64_t captain_load_end(const captain_reader *reader, size_t at)
{
    uint64_t word = 0;
    size_t octet = at >> 3;
    for (unsigned shift = 64; shift != 0 && octet < reader->size; octet++) {
        shift -= 8;
        word |= (uint64_t)reader->octets[octet] << shift;
    }
    return word << (at & 7);
}

uint64_t captain_peek(const captain_reader *reader, size_t at)
{
    return captain_load(reader, at);
}

size_t captain_get_long(captain_reader *reader, size_t at, unsigned count, uint64_t *bits)
{
    if (reader->end - at < count)
        return captain_fail(reader, at, CAPTAIN_TRUNCATED);
    if (count <= 32)
        *bits = captain_peek(reader, at) >> (64 - count);
    else
        *bits = (captain_peek(reader, at) >> 32) << (count - 32) | captain_peek(reader, at + 32) >> (96 - count);
    return at + count;
}

size_t captain_refuse(captain_writer *writer, captain_status status)
{
    writer->status = status;
    return CAPTAIN_FAILED;
}

/* Write within eight octets of the buffer's end. Only octets of these bits are written. */
size_t captain_put_end(captain_writer *writer, size_t at, uint64_t bits, unsigned count)
{
    size_t octet = at >> 3;
    unsigned used = (unsigned)(at & 7);
    uint64_t word = bits << (64 - count - used);
    at += count;
    if ((at + 7) >> 3 > writer->size) {
        writer->status = CAPTAIN_NO_SPACE;
        return at;
    }
    if (used != 0)
        word |= (uint64_t)(writer->octets[octet] & (0xff00u >> used)) << 56;
    for (; octet < (at + 7) >> 3; octet++, word <<= 8)
        writer->octets[octet] = (uint8_t)(word >> 56);
    return at;
}

size_t captain_put_bits(captain_writer *writer, size_t at, uint64_t bits, unsigned count)
{
    return captain_put(writer, at, bits, count);
}

size_t captain_put_long(captain_writer *writer, size_t at, uint64_t bits, unsigned count)
{
    if (count > 32) {
        at = captain_put_bits(writer, at, bits >> 32, count - 32);
        count = 32;
        bits &= 0xffffffffu;
    }
    return captain_put_bits(writer, at, bits, count);
}

/* Writing bits: what captain_put leaves over, numbers, lists, open types, extension additions. */
#include "bits.h"

enum { FRAGMENT = 65536 }; /* the largest (11.9.3.8) */

size_t captain_refuse(captain_writer *writer, captain_status status)
{
    writer->status = status;
    return CAPTAIN_FAILED;
}

/* Within eight octets of the buffer's end. The octets that the bits reach are written, none behind. */
size_t captain_put_end(captain_writer *writer, size_t at, uint64_t bits, unsigned count)
{
    size_t octet = at >> 3;
    unsigned used = (unsigned)(at & 7);
    uint64_t word = bits << (64 - count - used);
    if ((at + count + 7) >> 3 > writer->size)
        return captain_refuse(writer, CAPTAIN_NO_SPACE);
    if (used != 0)
        word |= (uint64_t)(writer->octets[octet] & (0xff00u >> used)) << 56;
    for (size_t last = (at + count - 1) >> 3; octet <= last; octet++, word <<= 8)
        writer->octets[octet] = (uint8_t)(word >> 56);
    return at + count;
}

size_t captain_put_long(captain_writer *writer, size_t at, uint64_t bits, unsigned count)
{
    if (count > 32) {
        at = captain_put(writer, at, bits >> 32, count - 32);
        count = 32;
        bits &= 0xffffffffu;
        if (at == CAPTAIN_FAILED)
            return at;
    }
    return captain_put(writer, at, bits, count);
}

/* 11.9.3.6, 11.9.3.7: below 16384. */
static size_t put_length(captain_writer *writer, size_t at, size_t length)
{
    return length < 128 ? captain_put(writer, at, length, 8) : captain_put(writer, at, 0x8000u | length, 16);
}

size_t captain_put_fragment(captain_writer *writer, size_t at, size_t left, size_t *length, bool *more)
{
    *more = left >= 16384;
    *length = *more ? (left < FRAGMENT ? left & ~(size_t)16383 : FRAGMENT) : left;
    return *more ? captain_put(writer, at, 0xc0u | *length >> 14, 8) : put_length(writer, at, left);
}

static size_t put_number(captain_writer *writer, size_t at, unsigned octets, uint64_t bits)
{
    at = captain_put(writer, at, octets, 8);
    return at == CAPTAIN_FAILED ? at : captain_put_long(writer, at, octets == 8 ? bits : bits & ((UINT64_C(1) << octets * 8) - 1), octets * 8);
}

size_t captain_put_semi(captain_writer *writer, size_t at, int64_t low, int64_t value)
{
    uint64_t bits = (uint64_t)value - (uint64_t)low;
    unsigned octets = 1;
    if (value < low)
        return captain_refuse(writer, CAPTAIN_RANGE);
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
    if (value < 64)
        return captain_put(writer, at, value, 7);
    at = captain_put(writer, at, 1, 1);
    return at == CAPTAIN_FAILED ? at : captain_put_semi(writer, at, 0, value);
}

int32_t captain_item_index(const captain_type *type, int32_t value)
{
    for (int32_t i = 0; i < (int32_t)type->names_count; i++)
        if (type->names[i].value == value)
            return i;
    return -1;
}

size_t captain_put_item(captain_writer *writer, size_t at, const captain_type *type, int32_t value)
{
    int32_t index = captain_item_index(type, value) - (int32_t)type->root_count;
    if (index < 0)
        index = value >= CAPTAIN_UNKNOWN ? value - CAPTAIN_UNKNOWN : -1;
    return index < 0 ? captain_refuse(writer, CAPTAIN_ALTERNATIVE) : captain_put_small(writer, at, (uint32_t)index);
}

/* ---------------------------------------------------------------- lists and octets */

size_t captain_encode_items(captain_writer *writer, size_t at, const void *items, uint32_t count, size_t size,
                            size_t (*item)(captain_writer *, size_t, const void *))
{
    const unsigned char *next = items;
    size_t left = count, length;
    bool more;
    do {
        at = captain_put_fragment(writer, at, left, &length, &more);
        left -= length;
        for (; length != 0 && at != CAPTAIN_FAILED; length--, next += size)
            at = item(writer, at, next);
    } while (more && at != CAPTAIN_FAILED);
    return at;
}

size_t captain_put_sized(captain_writer *writer, size_t at, const uint8_t *octets, size_t bits)
{
    for (; bits >= 32 && at != CAPTAIN_FAILED; bits -= 32, octets += 4)
        at = captain_put(writer, at, (uint32_t)octets[0] << 24 | (uint32_t)octets[1] << 16 | (uint32_t)octets[2] << 8 | octets[3], 32);
    for (; bits >= 8 && at != CAPTAIN_FAILED; bits -= 8, octets++)
        at = captain_put(writer, at, *octets, 8);
    if (bits != 0 && at != CAPTAIN_FAILED)
        at = captain_put(writer, at, (uint64_t)*octets >> (8 - bits), (unsigned)bits);
    return at;
}

size_t captain_put_octets(captain_writer *writer, size_t at, const uint8_t *octets, size_t count)
{
    return captain_put_sized(writer, at, octets, count * 8);
}

/* ---------------------------------------------------------------- open types */

/* Bits in the midst of others, within what has been written. */
static void patch(captain_writer *writer, size_t at, uint32_t bits, unsigned count)
{
    while (count-- != 0) {
        uint8_t mask = (uint8_t)(0x80u >> (at & 7));
        uint8_t *octet = &writer->octets[at++ >> 3];
        *octet = (uint8_t)(bits >> count & 1 ? *octet | mask : *octet & ~mask);
    }
}

/* The octets that some bits lie in, `octets` further on. What lies beside the bits in these octets is a length, patched later. */
static void move_bits(captain_writer *writer, size_t from, size_t bits, size_t octets)
{
    uint8_t *first = writer->octets + (from >> 3);
    memmove(first + octets, first, ((from + bits + 7) >> 3) - (from >> 3));
}

/* Content of 16384 octets and more: its fragments move from the last to the first, then the lengths go between them. */
static size_t close_fragments(captain_writer *writer, size_t start, size_t length)
{
    size_t whole = length / FRAGMENT, rest = length % FRAGMENT, tail = rest & 16383;
    size_t middle = rest - tail, tail_at = whole + (middle != 0), lengths = tail_at + (tail < 128 ? 1 : 2);
    size_t from = start + 8, end = from + (length + lengths - 1) * 8;
    if ((end + 7) >> 3 > writer->size)
        return captain_refuse(writer, CAPTAIN_NO_SPACE);
    move_bits(writer, from + (length - tail) * 8, tail * 8, lengths - 1);
    if (middle != 0)
        move_bits(writer, from + whole * FRAGMENT * 8, middle * 8, whole);
    for (size_t i = whole; i-- > 1;)
        move_bits(writer, from + i * FRAGMENT * 8, FRAGMENT * 8, i);
    for (size_t i = 0; i < whole; i++)
        patch(writer, start + i * (FRAGMENT + 1) * 8, 0xc4, 8);
    if (middle != 0)
        patch(writer, start + whole * (FRAGMENT + 1) * 8, 0xc0u | (uint32_t)(middle >> 14), 8);
    patch(writer, start + (length - tail + tail_at) * 8, tail < 128 ? (uint32_t)tail : 0x8000u | (uint32_t)tail, tail < 128 ? 8 : 16);
    return captain_put(writer, end - 1, writer->octets[(end - 1) >> 3] >> (7 - ((end - 1) & 7)) & 1u, 1);
}

size_t captain_open_close(captain_writer *writer, size_t start, size_t at)
{
    size_t length = (at - start - 1) / 8; /* the 8 bits of the length left out, rounded up */
    if (at == CAPTAIN_FAILED)
        return at;
    if (length == 0)
        length = 1; /* 11.1.3 */
    if (start + 8 + length * 8 != at)
        at = captain_put(writer, at, 0, (unsigned)(start + 8 + length * 8 - at));
    if (at == CAPTAIN_FAILED)
        return at;
    if (length >= 16384)
        return close_fragments(writer, start, length);
    if (length < 128) {
        patch(writer, start, (uint32_t)length, 8);
        return at;
    }
    if ((at + 8 + 7) >> 3 > writer->size)
        return captain_refuse(writer, CAPTAIN_NO_SPACE);
    move_bits(writer, start + 8, length * 8, 1);
    patch(writer, start, 0x8000u | (uint32_t)length, 16);
    return at + 8;
}

size_t captain_put_unknown(captain_writer *writer, size_t at, const captain_octets *octets)
{
    size_t done = 0, length;
    bool more;
    do {
        at = captain_put_fragment(writer, at, octets->count - done, &length, &more);
        if (at != CAPTAIN_FAILED)
            at = captain_put_octets(writer, at, octets->octets + done, length);
        done += length;
    } while (more && at != CAPTAIN_FAILED);
    return at;
}

static const captain_type *row_of(const captain_type *type, int64_t id)
{
    for (unsigned i = 0; i < type->rows_count; i++)
        if (type->rows[i].id == id)
            return type->rows[i].type;
    return NULL;
}

size_t captain_encode_open(captain_writer *writer, size_t at, const captain_type *type, int64_t id, const captain_open *value)
{
    size_t start = at;
    const captain_type *content = row_of(type, id);
    if (value->type == NULL)
        return captain_put_unknown(writer, at, &value->octets);
    if (value->type != content || value->value == NULL)
        return captain_refuse(writer, CAPTAIN_ALTERNATIVE);
    at = captain_open_put(writer, at);
    if (at != CAPTAIN_FAILED)
        at = content->encode(writer, at, value->value);
    return captain_open_close(writer, start, at);
}

captain_status captain_validate_open(const captain_type *type, int64_t id, const captain_open *value)
{
    if (value->type == NULL)
        return CAPTAIN_OK;
    if (value->type != row_of(type, id) || value->value == NULL)
        return CAPTAIN_ALTERNATIVE;
    return captain_validate(value->type, value->value);
}

/* ---------------------------------------------------------------- extension additions */

/* Length of the bitmap: as it was received, but for what a known addition asks for. */
static uint32_t bitmap_count(uint32_t count, uint64_t known, const captain_additions *additions)
{
    uint32_t bits = additions == NULL ? count : additions->bits;
    if (bits < count && (bits == 0 || (bits < 64 && known << bits != 0)))
        bits = count;
    for (uint32_t i = 0; additions != NULL && i < additions->count; i++)
        if (additions->unknown[i].index >= bits)
            bits = additions->unknown[i].index + 1;
    return bits;
}

size_t captain_put_bitmap(captain_writer *writer, size_t at, uint32_t count, uint64_t known, const captain_additions *additions)
{
    uint32_t bits = bitmap_count(count, known, additions), next = 0;
    if (bits > CAPTAIN_MAX_ADDITIONS)
        return captain_refuse(writer, CAPTAIN_SIZE);
    if (bits <= 64) {
        at = captain_put(writer, at, bits - 1, 7);
    } else {
        at = captain_put(writer, at, 1, 1);
        if (at != CAPTAIN_FAILED)
            at = put_length(writer, at, bits);
    }
    for (uint32_t i = 0; i < bits && at != CAPTAIN_FAILED; i++) {
        bool is_set = i < 64 && known << i >> 63 != 0;
        if (additions != NULL && next < additions->count && additions->unknown[next].index == i) {
            if (i < count)
                break;
            is_set = true;
            next++;
        }
        at = captain_put(writer, at, is_set, 1);
    }
    /* Unknown ones out of order, or known ones among them. */
    return additions != NULL && next != additions->count && at != CAPTAIN_FAILED ? captain_refuse(writer, CAPTAIN_PRESENCE) : at;
}

size_t captain_put_additions(captain_writer *writer, size_t at, const captain_additions *additions)
{
    for (uint32_t i = 0; additions != NULL && i < additions->count && at != CAPTAIN_FAILED; i++)
        at = captain_put_unknown(writer, at, &additions->unknown[i].octets);
    return at;
}

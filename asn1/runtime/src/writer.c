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

/* 11.9.3.6, 11.9.3.7: below 16384. */
static size_t put_length(captain_writer *writer, size_t at, size_t length)
{
    return length < 128 ? captain_put_bits(writer, at, length, 8) : captain_put_bits(writer, at, 0x8000u | length, 16);
}

size_t captain_put_fragment(captain_writer *writer, size_t at, size_t left, size_t *length, bool *more)
{
    *more = left >= 16384;
    *length = *more ? (left < FRAGMENT ? left & ~(size_t)16383 : FRAGMENT) : left;
    return *more ? captain_put_bits(writer, at, 0xc0u | *length >> 14, 8) : put_length(writer, at, left);
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
        for (; length != 0; length--, next += size) {
            at = item(writer, at, next);
            if (at == CAPTAIN_FAILED)
                return at;
        }
    } while (more);
    return at;
}

size_t captain_put_sized(captain_writer *writer, size_t at, const uint8_t *octets, size_t bits)
{
    for (; bits >= 32; bits -= 32, octets += 4)
        at = captain_put_bits(writer, at, (uint32_t)octets[0] << 24 | (uint32_t)octets[1] << 16 | (uint32_t)octets[2] << 8 | octets[3], 32);
    for (; bits >= 8; bits -= 8, octets++)
        at = captain_put_bits(writer, at, *octets, 8);
    return bits == 0 ? at : captain_put_bits(writer, at, (uint64_t)*octets >> (8 - bits), (unsigned)bits);
}

size_t captain_put_octets(captain_writer *writer, size_t at, const uint8_t *octets, size_t count)
{
    return captain_put_sized(writer, at, octets, count * 8);
}

/* ---------------------------------------------------------------- open types */

size_t captain_put_open(captain_writer *writer, size_t at)
{
    return captain_put_bits(writer, at, 0, 8);
}

/* Bits in the midst of others, within what has been written. */
static void patch(captain_writer *writer, size_t at, size_t bits, unsigned count)
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

/* Content of 16384 octets and more: whole fragments, a smaller one, the rest. They move from the last to the first, and then
 * the lengths go between them. */
static void put_fragments(captain_writer *writer, size_t start, size_t length)
{
    size_t whole = length / FRAGMENT, tail = length % 16384, middle = length % FRAGMENT - tail, before = whole + (middle != 0);
    size_t from = start + 8, behind = tail < 128 ? before : before + 1;
    move_bits(writer, from + (length - tail) * 8, tail * 8, behind);
    if (middle != 0)
        move_bits(writer, from + whole * FRAGMENT * 8, middle * 8, whole);
    for (size_t i = whole; i-- > 1;)
        move_bits(writer, from + i * FRAGMENT * 8, FRAGMENT * 8, i);
    for (size_t i = 0; i < whole; i++)
        patch(writer, start + i * (FRAGMENT + 1) * 8, 0xc4, 8);
    if (middle != 0)
        patch(writer, start + whole * (FRAGMENT + 1) * 8, 0xc0u | middle >> 14, 8);
    patch(writer, start + (length - tail + before) * 8, tail < 128 ? tail : 0x8000u | tail, tail < 128 ? 8 : 16);
}

size_t captain_put_close(captain_writer *writer, size_t start, size_t at)
{
    size_t length = at == start + 8 ? 1 : (at - start - 1) / 8; /* 11.1.3: nothing is one octet; the rest rounded up */
    size_t end = start + 8 + length * 8, more;
    if (end != at)
        at = captain_put_bits(writer, at, 0, (unsigned)(end - at));
    more = length < 128 ? 0 : length < 16384 ? 1 : (length + FRAGMENT - 1 - length % 16384) / FRAGMENT + (length % 16384 < 128 ? 0 : 1);
    if ((at + more * 8 + 7) >> 3 > writer->size)
        writer->status = CAPTAIN_NO_SPACE;
    if (writer->status != CAPTAIN_OK)
        return at + more * 8;
    if (length >= 16384) {
        put_fragments(writer, start, length);
    } else if (length >= 128) {
        move_bits(writer, start + 8, length * 8, 1);
        patch(writer, start, 0x8000u | length, 16);
    } else {
        patch(writer, start, length, 8);
    }
    at += more * 8;
    if ((at & 7) != 0)
        writer->octets[at >> 3] &= (uint8_t)(0xff00u >> (at & 7));
    return at;
}

size_t captain_put_unknown(captain_writer *writer, size_t at, const captain_octets *octets)
{
    size_t done = 0, length;
    bool more;
    do {
        at = captain_put_fragment(writer, at, octets->count - done, &length, &more);
        at = captain_put_octets(writer, at, octets->octets + done, length);
        done += length;
    } while (more);
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
    at = content->encode(writer, captain_put_open(writer, at), value->value);
    return at == CAPTAIN_FAILED ? at : captain_put_close(writer, start, at);
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

size_t captain_encode_bitmap(captain_writer *writer, size_t at, uint32_t count, uint64_t known, const captain_additions *additions)
{
    uint32_t bits = bitmap_count(count, known, additions), unknown = additions == NULL ? 0 : additions->count, next = 0;
    if (bits - 1 >= CAPTAIN_MAX_ADDITIONS)
        return captain_refuse(writer, CAPTAIN_SIZE);
    at = bits <= 64 ? captain_put_bits(writer, at, bits - 1, 7) : put_length(writer, captain_put_bits(writer, at, 1, 1), bits);
    for (uint32_t i = 0; i < bits; i++) {
        bool is_unknown = i >= count && next < unknown && additions->unknown[next].index == i;
        next += is_unknown;
        at = captain_put_bits(writer, at, is_unknown || (i < 64 && known << i >> 63 != 0), 1);
    }
    /* Unknown ones out of order, or known ones among them. */
    return next == unknown ? at : captain_refuse(writer, CAPTAIN_PRESENCE);
}

size_t captain_put_additions(captain_writer *writer, size_t at, const captain_additions *additions)
{
    for (uint32_t i = 0; additions != NULL && i < additions->count; i++)
        at = captain_put_unknown(writer, at, &additions->unknown[i].octets);
    return at;
}

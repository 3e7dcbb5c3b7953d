/* Reading bits: what captain_load leaves over, numbers, lists, open types, extension additions. */
#include "bits.h"

size_t captain_fail(captain_reader *reader, size_t at, captain_status status)
{
    reader->status = status;
    reader->reached = at;
    return CAPTAIN_FAILED;
}

/* Within eight octets of the end: what lies behind it reads as zero. */
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

/* 11.9.3.6 to 11.9.3.8. more: a fragment that another length follows. */
static size_t get_length(captain_reader *reader, size_t at, uint32_t *length, bool *more)
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

/* The octets of a number whose length goes before it: 1 to 8. */
static size_t get_number(captain_reader *reader, size_t at, unsigned *octets, uint64_t *bits)
{
    uint32_t length = 0;
    bool more;
    size_t start = at;
    at = get_length(reader, at, &length, &more);
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

/* ---------------------------------------------------------------- lists */

/* A count is believed when the octets can hold so many elements. */
static bool is_believed(captain_reader *reader, size_t at, size_t count, unsigned minimal)
{
    if (minimal == 0 && count > CAPTAIN_MAX_EMPTY)
        captain_fail(reader, at, CAPTAIN_SIZE);
    else if (minimal != 0 && count > (reader->end - at) / minimal)
        captain_fail(reader, at, CAPTAIN_TRUNCATED);
    else
        return true;
    return false;
}

void *captain_take(captain_reader *reader, size_t at, size_t octets)
{
    void *taken = captain_arena_take(reader->arena, octets);
    if (taken == NULL)
        captain_fail(reader, at, CAPTAIN_NO_MEMORY);
    return taken;
}

void *captain_take_items(captain_reader *reader, size_t at, uint32_t count, size_t size, unsigned minimal)
{
    return is_believed(reader, at, count, minimal) ? captain_take(reader, at, count * size) : NULL;
}

size_t captain_decode_items(captain_reader *reader, size_t at, captain_list *list, size_t size, unsigned minimal,
                            size_t (*item)(captain_reader *, size_t, void *))
{
    unsigned char *items = NULL;
    size_t count = 0, room = 0;
    uint32_t length = 0;
    bool more;
    do {
        at = get_length(reader, at, &length, &more);
        if (at == CAPTAIN_FAILED || !is_believed(reader, at, minimal == 0 ? count + length : length, minimal))
            return CAPTAIN_FAILED;
        if (length > room - count) {
            /* Twice the room each time: what fragments leave behind stays below four times the list. */
            unsigned char *larger;
            room = count == 0 ? length : 2 * (count + length);
            larger = captain_take(reader, at, room * size);
            if (larger == NULL)
                return CAPTAIN_FAILED;
            if (count != 0)
                memcpy(larger, items, count * size);
            items = larger;
        }
        for (; length != 0; length--) {
            at = item(reader, at, items + count++ * size);
            if (at == CAPTAIN_FAILED)
                return at;
        }
    } while (more);
    list->count = (uint32_t)count;
    list->items = items;
    return at;
}

/* ---------------------------------------------------------------- octets */

/* Bits that have been compared with `end`; the last octet is filled up with zeros. */
static void copy_bits(const captain_reader *reader, size_t at, uint8_t *to, size_t bits)
{
    for (; bits >= 32; bits -= 32, at += 32, to += 4) {
        uint64_t word = captain_peek(reader, at);
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
        at = get_length(reader, at, &length, &more);
        if (at == CAPTAIN_FAILED || !is_believed(reader, at, unit == 0 ? *count + length : length, unit))
            return CAPTAIN_FAILED;
        *count += length;
        at += (size_t)length * unit;
    } while (more);
    return at;
}

/* The same way again, now with memory. Fragments but for the last are whole octets. */
static const uint8_t *copy_units(captain_reader *reader, size_t at, unsigned unit, size_t bits)
{
    uint32_t length = 0;
    bool more;
    uint8_t *octets = captain_take(reader, at, (bits + 7) / 8);
    uint8_t *to = octets;
    if (octets == NULL)
        return NULL;
    do {
        at = get_length(reader, at, &length, &more);
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
    if (at == CAPTAIN_FAILED || *count == 0)
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

/* ---------------------------------------------------------------- open types */

size_t captain_open_begin(captain_reader *reader, size_t at, captain_outside *outside)
{
    uint32_t length = 0;
    bool more;
    size_t start = at;
    *outside = (captain_outside){reader->octets, reader->size, reader->end, 0, 0};
    at = get_length(reader, at, &length, &more);
    if (at == CAPTAIN_FAILED)
        return at;
    if (more) {
        /* Fragments: put together in the arena and read from there. */
        size_t count;
        const uint8_t *octets;
        outside->back = captain_get_string(reader, start, 8, &count, &octets);
        if (outside->back == CAPTAIN_FAILED)
            return CAPTAIN_FAILED;
        reader->octets = octets;
        reader->size = count;
        reader->end = count * 8;
        return 0;
    }
    if (length > (reader->end - at) / 8)
        return captain_fail(reader, at, CAPTAIN_TRUNCATED);
    if (length == 0)
        return captain_fail(reader, start, CAPTAIN_LENGTH); /* 11.1.3: nothing is one zero octet */
    outside->start = at;
    outside->back = at + (size_t)length * 8;
    reader->end = outside->back;
    return at;
}

size_t captain_open_end(captain_reader *reader, size_t at, const captain_outside *outside)
{
    size_t rest = reader->end - at;
    if (rest > 8 || (rest == 8 && at != outside->start))
        return captain_fail(reader, at, CAPTAIN_LENGTH);
    if (rest != 0 && captain_peek(reader, at) >> (64 - rest) != 0)
        return captain_fail(reader, at, CAPTAIN_LENGTH);
    reader->octets = outside->octets;
    reader->size = outside->size;
    reader->end = outside->end;
    return outside->back;
}

size_t captain_get_unknown(captain_reader *reader, size_t at, captain_octets *octets)
{
    size_t count;
    at = captain_get_string(reader, at, 8, &count, &octets->octets);
    octets->count = (uint32_t)count;
    return at;
}

static const captain_type *row_of(const captain_type *type, int64_t id)
{
    for (unsigned i = 0; i < type->rows_count; i++)
        if (type->rows[i].id == id)
            return type->rows[i].type;
    return NULL;
}

size_t captain_decode_open(captain_reader *reader, size_t at, const captain_type *type, int64_t id, captain_open *value)
{
    captain_outside outside;
    const captain_type *content = row_of(type, id);
    *value = (captain_open){content, NULL, {0, NULL}};
    if (content == NULL)
        return captain_get_unknown(reader, at, &value->octets);
    value->value = captain_take(reader, at, content->size);
    if (value->value == NULL)
        return CAPTAIN_FAILED;
    at = captain_open_begin(reader, at, &outside);
    if (at != CAPTAIN_FAILED)
        at = content->decode(reader, at, value->value);
    return at == CAPTAIN_FAILED ? at : captain_open_end(reader, at, &outside);
}

/* ---------------------------------------------------------------- extension additions */

size_t captain_get_bitmap(captain_reader *reader, size_t at, captain_bitmap *bitmap)
{
    bool more = false;
    size_t start = at;
    if (reader->end - at < 7)
        return captain_fail(reader, at, CAPTAIN_TRUNCATED);
    if (captain_peek(reader, at) >> 63 == 0) {
        bitmap->count = (uint32_t)(captain_peek(reader, at) >> 57) + 1;
        at += 7;
    } else {
        at = get_length(reader, at + 1, &bitmap->count, &more);
        if (at == CAPTAIN_FAILED)
            return at;
        if (more || bitmap->count == 0)
            return captain_fail(reader, start, CAPTAIN_LENGTH);
    }
    if (reader->end - at < bitmap->count)
        return captain_fail(reader, at, CAPTAIN_TRUNCATED);
    bitmap->at = at;
    if (bitmap->count > 32)
        bitmap->known = (captain_peek(reader, at) >> 32) << 32 | captain_peek(reader, at + 32) >> 32;
    else
        bitmap->known = captain_peek(reader, at);
    if (bitmap->count < 64)
        bitmap->known &= ~(UINT64_MAX >> bitmap->count);
    return at + bitmap->count;
}

static bool is_set(const captain_reader *reader, const captain_bitmap *bitmap, uint32_t index)
{
    size_t at = bitmap->at + index;
    return (reader->octets[at >> 3] >> (7 - (at & 7)) & 1) != 0;
}

size_t captain_get_additions(captain_reader *reader, size_t at, const captain_bitmap *bitmap, uint32_t count,
                             const captain_additions **additions)
{
    captain_additions *kept;
    captain_addition *unknown;
    uint32_t found = 0;
    for (uint32_t i = count; i < bitmap->count; i++)
        found += is_set(reader, bitmap, i);
    if (bitmap->count == count && bitmap->known != 0)
        return at;
    if (!is_believed(reader, at, found, 8))
        return CAPTAIN_FAILED;
    kept = captain_take(reader, at, sizeof *kept + found * sizeof *unknown);
    if (kept == NULL)
        return CAPTAIN_FAILED;
    unknown = (captain_addition *)(void *)(kept + 1);
    *kept = (captain_additions){bitmap->count, found, unknown};
    *additions = kept;
    for (uint32_t i = count; i < bitmap->count; i++) {
        if (!is_set(reader, bitmap, i))
            continue;
        unknown->index = i;
        at = captain_get_unknown(reader, at, &unknown->octets);
        if (at == CAPTAIN_FAILED)
            return at;
        unknown++;
    }
    return at;
}

size_t captain_get_all_additions(captain_reader *reader, size_t at, const captain_additions **additions)
{
    captain_bitmap bitmap;
    at = captain_get_bitmap(reader, at, &bitmap);
    return at == CAPTAIN_FAILED ? at : captain_get_additions(reader, at, &bitmap, 0, additions);
}

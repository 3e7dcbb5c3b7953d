/* Open types (11.2): contents with a length of their own. */
#include "bits.h"

enum { FRAGMENT = 65536 }; /* octets of the largest fragment (11.9.3.8) */

size_t captain_open_begin(captain_reader *reader, size_t at, captain_outside *outside)
{
    uint32_t length = 0;
    bool more;
    size_t start = at;
    *outside = (captain_outside){reader->octets, reader->size, reader->end, 0, 0};
    at = captain_get_length(reader, at, &length, &more);
    if (at == CAPTAIN_FAILED)
        return at;
    if (more) {
        /* Fragments are joined in the arena and read from there. */
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
        return captain_fail(reader, start, CAPTAIN_LENGTH); /* empty contents are one zero octet (11.1.3) */
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

size_t captain_put_open(captain_writer *writer, size_t at)
{
    return captain_put_bits(writer, at, 0, 8);
}

/* Overwrite bits within the written ones. */
static void patch(captain_writer *writer, size_t at, size_t bits, unsigned count)
{
    while (count-- != 0) {
        uint8_t mask = (uint8_t)(0x80u >> (at & 7));
        uint8_t *octet = &writer->octets[at++ >> 3];
        *octet = (uint8_t)(bits >> count & 1 ? *octet | mask : *octet & ~mask);
    }
}

/* Move bits `octets` further on, in whole octets. Neighbouring bits in these octets belong to a length, which is written later. */
static void move_bits(captain_writer *writer, size_t from, size_t bits, size_t octets)
{
    uint8_t *first = writer->octets + (from >> 3);
    memmove(first + octets, first, ((from + bits + 7) >> 3) - (from >> 3));
}

/* Contents of 16384 octets or more: full fragments, a smaller one, the rest. They are moved from the last to the first, and
 * their lengths are inserted. */
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
    size_t length = at == start + 8 ? 1 : (at - start - 1) / 8; /* empty contents are one octet (11.1.3) */
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
        if (length > 0) /* the pointer may be NULL for 0 octets */
            at = captain_put_octets(writer, at, octets->octets + done, length);
        done += length;
    } while (more);
    return at;
}

const captain_type *captain_row_of(const captain_type *type, int64_t id)
{
    for (unsigned i = 0; i < type->rows_count; i++)
        if (type->rows[i].id == id)
            return type->rows[i].type;
    return NULL;
}

size_t captain_decode_open(captain_reader *reader, size_t at, const captain_type *type, int64_t id, captain_open *value)
{
    captain_outside outside;
    const captain_type *content = captain_row_of(type, id);
    *value = (captain_open){content, NULL, {0, NULL}};
    if (content == NULL)
        return captain_get_unknown(reader, at, &value->octets);
    at = captain_open_begin(reader, at, &outside);
    if (at == CAPTAIN_FAILED)
        return at;
    value->value = captain_take(reader, at, content->size);
    if (value->value == NULL)
        return CAPTAIN_FAILED;
    at = content->decode(reader, at, value->value);
    return at == CAPTAIN_FAILED ? at : captain_open_end(reader, at, &outside);
}

size_t captain_encode_open(captain_writer *writer, size_t at, const captain_type *type, int64_t id, const captain_open *value)
{
    size_t start = at;
    const captain_type *content = captain_row_of(type, id);
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
    if (value->type != captain_row_of(type, id) || value->value == NULL)
        return CAPTAIN_ALTERNATIVE;
    return captain_validate(value->type, value->value);
}

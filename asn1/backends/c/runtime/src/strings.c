/* Strings of variable size, by their tables (16, 17, 24, 25, 30). */
#include "characters.h"

static bool is_text(const captain_type *type)
{
    return type->kind >= CAPTAIN_IA5 && type->kind <= CAPTAIN_UTF8;
}

/* Strings whose size PER ignores have a general length (30.6, 24.2). */
static bool is_sized(const captain_type *type)
{
    return type->kind != CAPTAIN_UTF8 && type->kind != CAPTAIN_OID && type->kind != CAPTAIN_RELATIVE_OID;
}

/* A length is constrained if its upper bound is below 64K (11.9.4.1). */
static bool is_counted(const captain_type *type)
{
    return is_sized(type) && !(type->flags & CAPTAIN_UNBOUNDED_HIGH) && type->high < 65536;
}

static unsigned bits_of(uint64_t range)
{
    unsigned bits = 0;
    for (; range != 0; range >>= 1)
        bits++;
    return bits;
}

static bool in_root(const captain_type *type, size_t count)
{
    return !is_sized(type) || ((int64_t)count >= type->low && (type->flags & CAPTAIN_UNBOUNDED_HIGH || (int64_t)count <= type->high));
}

/* ---------------------------------------------------------------- decode */

static size_t get_characters(captain_reader *reader, size_t at, const captain_characters *set, size_t count, captain_text *text)
{
    char *to = captain_take(reader, at, count + 1);
    uint64_t word = 0;
    if (to == NULL)
        return CAPTAIN_FAILED;
    for (size_t i = 0; i < count; i++, at += set->bits) {
        /* one load has at least seven characters */
        word = i % 7 == 0 ? captain_load(reader, at) : word << set->bits;
        int point = captain_character(set, set->bits == 0 ? 0 : (unsigned)(word >> (64 - set->bits)));
        if (point < 0)
            return captain_fail(reader, at, CAPTAIN_ALPHABET);
        to[i] = (char)point;
    }
    to[count] = 0;
    *text = (captain_text){(uint32_t)count, to};
    return at;
}

/* Read a constrained length, after the extension bit. */
static size_t get_count(captain_reader *reader, size_t at, const captain_type *type, unsigned unit, size_t *count)
{
    unsigned width = bits_of((uint64_t)(type->high - type->low));
    uint64_t raw = 0;
    size_t start = at;
    if (width != 0)
        at = captain_get_long(reader, at, width, &raw);
    if (at == CAPTAIN_FAILED)
        return at;
    *count = (size_t)type->low + (size_t)raw;
    if (!in_root(type, *count))
        return captain_fail(reader, start, CAPTAIN_SIZE);
    return reader->end - at < *count * unit ? captain_fail(reader, at, CAPTAIN_TRUNCATED) : at;
}

static size_t decode_text(captain_reader *reader, size_t at, const captain_type *type, bool is_counted_, bool is_root, captain_text *text)
{
    captain_characters set = is_root ? captain_alphabet(type) : captain_whole_alphabet(type);
    captain_reader inside = *reader;
    const uint8_t *packed;
    size_t count = 0, start = at, behind;
    if (is_counted_) {
        at = get_count(reader, at, type, set.bits, &count);
        return at == CAPTAIN_FAILED ? at : get_characters(reader, at, &set, count, text);
    }
    behind = captain_get_string(reader, at, set.bits, &count, &packed);
    if (behind == CAPTAIN_FAILED)
        return behind;
    if (is_root && !in_root(type, count))
        return captain_fail(reader, start, CAPTAIN_SIZE);
    inside.octets = packed;
    inside.size = (count * set.bits + 7) / 8;
    if (get_characters(&inside, 0, &set, count, text) == CAPTAIN_FAILED)
        return captain_fail(reader, start, inside.status);
    return behind;
}

static size_t decode_utf8(captain_reader *reader, size_t at, captain_text *text)
{
    captain_octets octets = {0, NULL};
    size_t start = at;
    at = captain_get_unknown(reader, at, &octets);
    if (at != CAPTAIN_FAILED && captain_utf8_count(octets.octets, octets.count) == SIZE_MAX)
        return captain_fail(reader, start, CAPTAIN_ALPHABET);
    *text = (captain_text){octets.count, (const char *)octets.octets};
    return at;
}

static void set_string(const captain_type *type, void *value, size_t count, const uint8_t *octets)
{
    if (type->kind == CAPTAIN_BIT_STRING)
        *(captain_bits *)value = (captain_bits){(uint32_t)count, octets};
    else
        *(captain_octets *)value = (captain_octets){(uint32_t)count, octets};
}

size_t captain_decode_string(captain_reader *reader, size_t at, const captain_type *type, void *value)
{
    unsigned unit = type->kind == CAPTAIN_BIT_STRING ? 1 : 8;
    const uint8_t *octets = NULL;
    size_t count = 0, start = at;
    bool is_root = true, counted;
    if (type->kind == CAPTAIN_UTF8)
        return decode_utf8(reader, at, value);
    if (type->flags & CAPTAIN_EXTENSIBLE) {
        if (reader->end == at)
            return captain_fail(reader, at, CAPTAIN_TRUNCATED);
        is_root = captain_peek(reader, at++) >> 63 == 0;
    }
    counted = is_root && is_counted(type);
    if (is_text(type))
        return decode_text(reader, at, type, counted, is_root, value);
    if (counted) {
        at = get_count(reader, at, type, unit, &count);
        if (at != CAPTAIN_FAILED)
            at = captain_get_sized(reader, at, count * unit, &octets);
    } else {
        at = captain_get_string(reader, at, unit, &count, &octets);
    }
    if (at == CAPTAIN_FAILED)
        return at;
    if (is_root && !in_root(type, count))
        return captain_fail(reader, start, CAPTAIN_SIZE);
    if (type->kind >= CAPTAIN_OID && !captain_is_oid(octets, count))
        return captain_fail(reader, start, CAPTAIN_RANGE);
    set_string(type, value, count, octets);
    return at;
}

/* ---------------------------------------------------------------- encode */

/* Return the encoded size of named bits: trailing zeros are removed down to the least size, and added up to it (16.2, 16.3). */
static size_t named_count(const captain_type *type, const captain_bits *bits)
{
    size_t count = bits->count;
    while ((int64_t)count > type->low && (bits->octets[(count - 1) / 8] >> (7 - (count - 1) % 8) & 1) == 0)
        count--;
    return (int64_t)count > type->low ? count : (size_t)type->low;
}

/* Write bits of a string; after its end they are zeros. */
static size_t put_bits(captain_writer *writer, size_t at, const captain_bits *bits, size_t from, size_t count)
{
    size_t own = from < bits->count ? bits->count - from : 0;
    own = own < count ? own : count;
    if (own != 0)
        at = captain_put_sized(writer, at, bits->octets + from / 8, own);
    for (size_t left = count - own, part; left != 0; left -= part) {
        part = left < 32 ? left : 32;
        at = captain_put_bits(writer, at, 0, (unsigned)part);
    }
    return at;
}

static size_t put_characters(captain_writer *writer, size_t at, const captain_characters *set, const captain_text *text, size_t from, size_t count)
{
    uint64_t word = 0;
    unsigned held = 0; /* number of bits in it that are not yet written */
    for (size_t i = from; i < from + count; i++) {
        int code = captain_code_of(set, (unsigned char)text->text[i]);
        if (code < 0)
            return captain_refuse(writer, CAPTAIN_ALPHABET);
        if (held + set->bits > 56) {
            at = captain_put_bits(writer, at, word, held);
            word = held = 0;
        }
        word = word << set->bits | (uint64_t)code;
        held += set->bits;
    }
    return held == 0 ? at : captain_put_bits(writer, at, word, held);
}

static size_t put_units(captain_writer *writer, size_t at, const captain_type *type, const captain_characters *set, const void *value, size_t from, size_t count)
{
    if (count == 0)
        return at; /* the pointer may be NULL for 0 octets */
    if (is_text(type) && type->kind != CAPTAIN_UTF8)
        return put_characters(writer, at, set, value, from, count);
    if (type->kind == CAPTAIN_BIT_STRING)
        return put_bits(writer, at, value, from, count);
    if (type->kind == CAPTAIN_UTF8)
        return captain_put_sized(writer, at, (const uint8_t *)((const captain_text *)value)->text + from, count * 8);
    return captain_put_sized(writer, at, ((const captain_octets *)value)->octets + from, count * 8);
}

static size_t put_general(captain_writer *writer, size_t at, const captain_type *type, const captain_characters *set, const void *value, size_t count)
{
    size_t done = 0, length;
    bool more;
    do {
        at = captain_put_fragment(writer, at, count - done, &length, &more);
        at = put_units(writer, at, type, set, value, done, length);
        done += length;
    } while (more && at != CAPTAIN_FAILED);
    return at;
}

static size_t string_count(const captain_type *type, const void *value)
{
    if (type->kind == CAPTAIN_BIT_STRING)
        return type->flags & CAPTAIN_NAMED_BITS ? named_count(type, value) : ((const captain_bits *)value)->count;
    return is_text(type) ? ((const captain_text *)value)->count : ((const captain_octets *)value)->count;
}

size_t captain_encode_string(captain_writer *writer, size_t at, const captain_type *type, const void *value)
{
    size_t count = string_count(type, value);
    bool is_root = in_root(type, count);
    captain_characters set = is_root ? captain_alphabet(type) : captain_whole_alphabet(type);
    if (!is_root && !(type->flags & CAPTAIN_EXTENSIBLE))
        return captain_refuse(writer, CAPTAIN_SIZE);
    if (is_text(type) && type->kind != CAPTAIN_UTF8 && set.bits == 0 && count > CAPTAIN_MAX_EMPTY)
        return captain_refuse(writer, CAPTAIN_SIZE); /* the same limit as in decode */
    if (type->kind == CAPTAIN_UTF8 && captain_utf8_count((const unsigned char *)((const captain_text *)value)->text, count) == SIZE_MAX)
        return captain_refuse(writer, CAPTAIN_ALPHABET);
    if (type->kind >= CAPTAIN_OID && !captain_is_oid(((const captain_octets *)value)->octets, count))
        return captain_refuse(writer, CAPTAIN_RANGE);
    if (type->flags & CAPTAIN_EXTENSIBLE)
        at = captain_put_bits(writer, at, !is_root, 1);
    if (!is_root || !is_counted(type))
        return put_general(writer, at, type, &set, value, count);
    if (type->high != type->low)
        at = captain_put_bits(writer, at, (uint64_t)count - (uint64_t)type->low, bits_of((uint64_t)(type->high - type->low)));
    return put_units(writer, at, type, &set, value, 0, count);
}

/* ---------------------------------------------------------------- validate */

static bool in_gap(const captain_type *type, size_t count)
{
    for (unsigned i = 0; i < type->gaps_count; i++)
        if ((int64_t)count >= type->gaps[i].low && (int64_t)count <= type->gaps[i].high)
            return true;
    return false;
}

captain_status captain_validate_string(const captain_type *type, const void *value)
{
    size_t count = string_count(type, value);
    if (type->kind == CAPTAIN_UTF8) {
        count = captain_utf8_count((const unsigned char *)((const captain_text *)value)->text, count);
        if (count == SIZE_MAX)
            return CAPTAIN_ALPHABET;
    } else if (is_text(type)) {
        captain_characters set = captain_alphabet(type);
        const captain_text *text = value;
        for (size_t i = 0; i < count; i++)
            if (captain_code_of(&set, (unsigned char)text->text[i]) < 0)
                return CAPTAIN_ALPHABET;
        if (set.bits == 0 && count > CAPTAIN_MAX_EMPTY && in_root(type, count))
            return CAPTAIN_SIZE;
    } else if (type->kind >= CAPTAIN_OID) {
        return captain_is_oid(((const captain_octets *)value)->octets, count) ? CAPTAIN_OK : CAPTAIN_RANGE;
    }
    if (type->flags & CAPTAIN_EXTENSIBLE)
        return CAPTAIN_OK;
    if ((int64_t)count < type->low || (!(type->flags & CAPTAIN_UNBOUNDED_HIGH) && (int64_t)count > type->high))
        return CAPTAIN_SIZE;
    return in_gap(type, count) ? CAPTAIN_INNER : CAPTAIN_OK;
}

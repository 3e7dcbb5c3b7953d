/* Building blocks of generated code for ROS 2: numbers, strings and lists of XCDR1. Offsets count from the octet after the
 * encapsulation.
 *
 * A number is aligned to its size; padding is zero. A string is a uint32 with its length including a final zero, its octets,
 * and the zero. A list is a uint32 with the count of its elements, and the elements. A message is the sequence of its fields.
 *
 * Every function takes an offset and returns the one after what it wrote or read. Writing never fails: at the end of the buffer
 * it continues to count. Reading returns CAPTAIN_FAILED on failure, and each caller adds the name of its field to the path. */
#ifndef CAPTAIN_CDR_H
#define CAPTAIN_CDR_H

#include "bits.h"
#include <captain/ros2.h>

typedef struct captain_left {
    const captain_type *type; /* NULL: value is the captain_additions of a SEQUENCE */
    const void *value;
} captain_left;

/* Limit of the parts that are listed for one message; further ones are only counted. */
enum { CAPTAIN_LEFT_MAX = 256 };

struct captain_cdr_writer {
    uint8_t *octets;
    size_t size;
    size_t left_count;
    captain_left *left; /* array of CAPTAIN_LEFT_MAX entries, or NULL */
};

struct captain_cdr_reader {
    const uint8_t *octets;
    size_t size;
    captain_arena *arena;
    captain_report *report;
    captain_status status;
    bool takes_unknown;
    unsigned depth;
};

/* ---------------------------------------------------------------- the fields of a message, for what is absent */

typedef enum captain_cdr_kind { CAPTAIN_CDR_1, CAPTAIN_CDR_2, CAPTAIN_CDR_4, CAPTAIN_CDR_8, CAPTAIN_CDR_STRING, CAPTAIN_CDR_MESSAGE } captain_cdr_kind;

typedef struct captain_cdr_part {
    const char *name;
    const struct captain_cdr_shape *message; /* CAPTAIN_CDR_MESSAGE */
    uint8_t kind;
    bool is_list;
} captain_cdr_part;

/* spans: octets of the message with padding, by offset modulo 8; CAPTAIN_CDR_VARIES if they depend on lengths. empty: the same
 * with every list empty; CAPTAIN_CDR_VARIES with a string, whose encoding is never all zeros. */
enum { CAPTAIN_CDR_VARIES = 0xffff };
typedef struct captain_cdr_shape {
    const captain_cdr_part *parts;
    uint32_t parts_count;
    uint16_t spans[8], empty[8];
} captain_cdr_shape;

/* Write everything as zero, false or empty. */
CAPTAIN_HIDDEN size_t captain_cdr_put_none(captain_cdr_writer *w, size_t at, const captain_cdr_shape *shape);
/* Return whether everything is zero, false or empty; false if the octets end earlier. */
CAPTAIN_HIDDEN bool captain_cdr_is_none_part(const uint8_t *octets, size_t size, size_t at, const captain_cdr_part *part);
/* Skip a message. Returns the offset after it. */
CAPTAIN_HIDDEN size_t captain_cdr_walk(captain_cdr_reader *r, size_t at, const captain_cdr_shape *shape);
CAPTAIN_HIDDEN size_t captain_cdr_walk_part(captain_cdr_reader *r, size_t at, const captain_cdr_part *part);

enum { CAPTAIN_CDR_UNUSED_MAX = 8 }; /* for captain_cdr_bad_unused: any number of unused bits is allowed */

/* ---------------------------------------------------------------- failing */

CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_put_end(captain_cdr_writer *w, size_t at, uint64_t number, size_t size);
CAPTAIN_COLD CAPTAIN_HIDDEN void captain_cdr_leave(captain_cdr_writer *w, const captain_type *type, const void *value);

/* All return CAPTAIN_FAILED. name: name of the field, put before the path of the error. */
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_refuse(captain_cdr_reader *r, size_t at, captain_status status, const char *name, const char *text);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_in(captain_cdr_reader *r, const char *name);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_in_item(captain_cdr_reader *r, uint32_t index, const char *name);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_cut(captain_cdr_reader *r, size_t at, const char *name);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_bad_bool(captain_cdr_reader *r, size_t at, const char *name);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_bad_number(captain_cdr_reader *r, size_t at, int64_t number, const captain_type *type, const char *name);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_bad_item(captain_cdr_reader *r, size_t at, int64_t number, const captain_type *type, const char *name);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_bad_octet(captain_cdr_reader *r, size_t at, int64_t number, const char *name);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_bad_choice(captain_cdr_reader *r, size_t at, int64_t number, const char *name);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_bad_row(captain_cdr_reader *r, size_t at, int64_t id, const char *selector, const char *name);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_bad_count(captain_cdr_reader *r, size_t at, uint64_t count, const captain_type *type, const char *name);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_bad_unused(captain_cdr_reader *r, size_t at, uint8_t unused, unsigned wanted, const char *name);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_no_memory(captain_cdr_reader *r, size_t at, const char *name);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_too_deep(captain_cdr_reader *r, size_t at);

/* ---------------------------------------------------------------- numbers */

static inline size_t captain_cdr_align(size_t at, size_t size)
{
    return (at + size - 1) & ~(size - 1);
}

static inline uint64_t captain_cdr_order(uint64_t number, size_t size)
{
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    (void)size;
    return number;
#else
    return __builtin_bswap64(number) >> (64 - 8 * size);
#endif
}

/* Clears the padding before the number, up to seven octets. It writes eight octets if there is room. */
static inline size_t captain_cdr_put(captain_cdr_writer *w, size_t at, uint64_t number, size_t size)
{
    size_t to = captain_cdr_align(at, size);
    if (CAPTAIN_UNLIKELY(at + 16 > w->size))
        return captain_cdr_put_end(w, at, number, size);
    if (size > 1)
        memset(w->octets + at, 0, 8);
    if (size == 1) {
        w->octets[to] = (uint8_t)number;
    } else if (size == 2) {
        uint16_t word = (uint16_t)captain_cdr_order((uint16_t)number, 2);
        memcpy(w->octets + to, &word, 2);
    } else if (size == 4) {
        uint32_t word = (uint32_t)captain_cdr_order((uint32_t)number, 4);
        memcpy(w->octets + to, &word, 4);
    } else {
        uint64_t word = captain_cdr_order(number, 8);
        memcpy(w->octets + to, &word, 8);
    }
    return to + size;
}

/* Return the number that ends at an offset. */
static inline uint64_t captain_cdr_load(const captain_cdr_reader *r, size_t behind, size_t size)
{
    const uint8_t *octets = r->octets + behind - size;
    if (size == 1)
        return *octets;
    if (size == 2) {
        uint16_t word;
        memcpy(&word, octets, 2);
        return captain_cdr_order(word, 2);
    }
    if (size == 4) {
        uint32_t word;
        memcpy(&word, octets, 4);
        return captain_cdr_order(word, 4);
    }
    uint64_t word;
    memcpy(&word, octets, 8);
    return captain_cdr_order(word, 8);
}

/* ---------------------------------------------------------------- messages, lists, strings */

static inline size_t captain_cdr_none(captain_cdr_writer *w, size_t at, const captain_cdr_shape *shape)
{
    size_t span = shape->empty[at & 7];
    if (CAPTAIN_UNLIKELY(span == CAPTAIN_CDR_VARIES || at + span > w->size))
        return captain_cdr_put_none(w, at, shape);
    memset(w->octets + at, 0, span);
    return at + span;
}

static inline size_t captain_cdr_skip(captain_cdr_reader *r, size_t at, const captain_cdr_shape *shape, const char *name)
{
    size_t span = shape->spans[at & 7];
    if (CAPTAIN_UNLIKELY(span == CAPTAIN_CDR_VARIES)) {
        at = captain_cdr_walk(r, at, shape);
        return at == CAPTAIN_FAILED ? captain_cdr_in(r, name) : at;
    }
    return at + span <= r->size ? at + span : captain_cdr_cut(r, at, name);
}

/* Read the count of a list's elements, at `at`. It is accepted only if so many elements of at least `least` octets can follow. */
CAPTAIN_HIDDEN size_t captain_cdr_get_count(captain_cdr_reader *r, size_t at, size_t least, uint32_t *count, const char *name);
/* Allocate elements. Returns NULL if count is 0; otherwise NULL means that captain_cdr_no_memory must be called. */
static inline void *captain_cdr_take(captain_cdr_reader *r, uint32_t count, size_t size)
{
    return count > SIZE_MAX / size ? NULL : captain_arena_take(r->arena, count * size);
}

CAPTAIN_HIDDEN size_t captain_cdr_put_octets(captain_cdr_writer *w, size_t at, const uint8_t *octets, uint32_t count);
/* A text with a zero octet is written whole and reported as left out, because readers in ROS end a string there. */
CAPTAIN_HIDDEN size_t captain_cdr_put_text(captain_cdr_writer *w, size_t at, const captain_type *type, const captain_text *text);
CAPTAIN_HIDDEN size_t captain_cdr_put_oid(captain_cdr_writer *w, size_t at, const captain_type *type, const captain_octets *oid);
CAPTAIN_HIDDEN size_t captain_cdr_put_small_bits(captain_cdr_writer *w, size_t at, uint64_t bits, unsigned size);
/* Return the nearest number that the field can hold; report the original as left out if it differs. */
CAPTAIN_HIDDEN int64_t captain_cdr_fit(captain_cdr_writer *w, int64_t number, int64_t low, int64_t high, const captain_type *type, const void *value);

/* For profiles in which every number has 64 bits: an octet is a number, and bit i of a bit string counts 2**i. */
CAPTAIN_HIDDEN uint64_t captain_cdr_turn(uint64_t bits, unsigned size);
CAPTAIN_HIDDEN size_t captain_cdr_put_wide(captain_cdr_writer *w, size_t at, const uint8_t *octets, uint32_t count);
CAPTAIN_HIDDEN size_t captain_cdr_get_wide(captain_cdr_reader *r, size_t at, captain_octets *octets, const captain_type *type, const char *name);
/* Return as many bits as a number can hold. Report the string as left out if the number does not give its length. */
CAPTAIN_HIDDEN uint64_t captain_cdr_bits_number(captain_cdr_writer *w, const captain_type *type, const captain_bits *bits);
/* Read a number as bit string, up to its highest set bit, or to the shortest allowed size. */
CAPTAIN_HIDDEN size_t captain_cdr_number_bits(captain_cdr_reader *r, size_t at, captain_bits *bits, const captain_type *type, const char *name);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_cdr_bad_bits(captain_cdr_reader *r, size_t at, int64_t number, const captain_type *type, const char *name);

/* Octets of a list of uint8; they are not copied. */
CAPTAIN_HIDDEN size_t captain_cdr_get_octets(captain_cdr_reader *r, size_t at, captain_octets *octets, const char *name);
/* These functions check sizes and alphabets. encode would refuse violations, too, but without the names of ROS fields. */
CAPTAIN_HIDDEN size_t captain_cdr_get_string(captain_cdr_reader *r, size_t at, captain_octets *octets, const captain_type *type, const char *name);
CAPTAIN_HIDDEN size_t captain_cdr_get_fixed(captain_cdr_reader *r, size_t at, uint8_t *octets, const captain_type *type, const char *name);
CAPTAIN_HIDDEN size_t captain_cdr_get_text(captain_cdr_reader *r, size_t at, captain_text *text, const captain_type *type, const char *name);
CAPTAIN_HIDDEN size_t captain_cdr_get_oid(captain_cdr_reader *r, size_t at, captain_octets *oid, const captain_type *type, const char *name);
CAPTAIN_HIDDEN size_t captain_cdr_get_small_bits(captain_cdr_reader *r, size_t at, uint64_t *bits, const captain_type *type, const char *name);
/* Read the number of unused bits, which follows the octets and completes the bit string. */
CAPTAIN_HIDDEN size_t captain_cdr_get_unused(captain_cdr_reader *r, size_t at, captain_bits *bits, const captain_type *type, const char *name);
CAPTAIN_HIDDEN size_t captain_cdr_get_small_unused(captain_cdr_reader *r, size_t at, const captain_type *type, const char *name);

#endif

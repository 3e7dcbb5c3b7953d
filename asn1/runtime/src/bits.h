/* What generated code is made of: a reader and a writer of bits, and the rarer parts of X.691 as functions.
 *
 * Offsets count bits from the first octet. Every function takes the offset and returns the one behind what it read or
 * wrote, or CAPTAIN_FAILED with the reason in `status`. What is called captain_put_... does not fail: where the buffer
 * ends, it goes on counting and leaves CAPTAIN_NO_SPACE in `status`. Clauses are those of X.691 (02/2021).
 */
#ifndef CAPTAIN_BITS_H
#define CAPTAIN_BITS_H

#include <captain/runtime.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

#define CAPTAIN_COLD __attribute__((cold, noinline))
#define CAPTAIN_HIDDEN __attribute__((visibility("hidden")))
#define CAPTAIN_UNLIKELY(condition) __builtin_expect(!!(condition), 0)

/* A list whose elements take no bits is bounded by nothing in the octets. */
#define CAPTAIN_MAX_EMPTY 65536u
/* How many containers that contain themselves may stand within one another: each turn of IVIM's signs takes eight. The tables
 * count every container on the way, CAPTAIN_MAX_DEPTH in all. */
#define CAPTAIN_MAX_RECURSION 32u
/* A bitmap of additions is not longer than this: longer ones are fragmented (11.9.3.8), and no type has so many. */
#define CAPTAIN_MAX_ADDITIONS 16383u

struct captain_reader {
    const uint8_t *octets;
    size_t size; /* octets that may be read */
    size_t end;  /* bit offset behind the message, or behind the open type that is being read; at <= end always */
    captain_arena *arena;
    size_t reached; /* on failure */
    captain_status status;
    unsigned depth;
};

struct captain_writer {
    uint8_t *octets;
    size_t size; /* octets */
    captain_status status;
    unsigned depth;
};

CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_fail(captain_reader *reader, size_t at, captain_status status);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_refuse(captain_writer *writer, captain_status status);
CAPTAIN_COLD CAPTAIN_HIDDEN uint64_t captain_load_end(const captain_reader *reader, size_t at);
CAPTAIN_COLD CAPTAIN_HIDDEN size_t captain_put_end(captain_writer *writer, size_t at, uint64_t bits, unsigned count);

static inline uint64_t captain_big_endian(uint64_t word)
{
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    return __builtin_bswap64(word);
#else
    return word;
#endif
}

/* The bits from `at` on, left aligned; at least 57 of them are right. The caller has compared with `end`. */
static inline uint64_t captain_load(const captain_reader *reader, size_t at)
{
    uint64_t word;
    size_t octet = at >> 3;
    if (CAPTAIN_UNLIKELY(octet + 8 > reader->size))
        return captain_load_end(reader, at);
    memcpy(&word, reader->octets + octet, 8);
    return captain_big_endian(word) << (at & 7);
}

/* The lowest `count` bits of `bits` (1 to 57, nothing above them). Up to 8 octets behind are set to zero. */
static inline size_t captain_put(captain_writer *writer, size_t at, uint64_t bits, unsigned count)
{
    uint64_t word;
    size_t octet = at >> 3;
    unsigned used = (unsigned)(at & 7);
    if (CAPTAIN_UNLIKELY(octet + 8 > writer->size))
        return captain_put_end(writer, at, bits, count);
    word = bits << (64 - count - used) | (uint64_t)(writer->octets[octet] & (0xff00u >> used) & 0xffu) << 56;
    word = captain_big_endian(word);
    memcpy(writer->octets + octet, &word, 8);
    return at + count;
}

/* ---------------------------------------------------------------- numbers */

/* captain_load and captain_put as functions, where size counts for more. */
CAPTAIN_HIDDEN uint64_t captain_peek(const captain_reader *reader, size_t at);
CAPTAIN_HIDDEN size_t captain_put_bits(captain_writer *writer, size_t at, uint64_t bits, unsigned count);
/* 1 to 64 bits. */
CAPTAIN_HIDDEN size_t captain_get_long(captain_reader *reader, size_t at, unsigned count, uint64_t *bits);
CAPTAIN_HIDDEN size_t captain_put_long(captain_writer *writer, size_t at, uint64_t bits, unsigned count);
/* INTEGER without an upper bound or outside of its root: 11.7 with a lower bound, 11.8 without. */
CAPTAIN_HIDDEN size_t captain_get_semi(captain_reader *reader, size_t at, int64_t low, int64_t *value);
CAPTAIN_HIDDEN size_t captain_put_semi(captain_writer *writer, size_t at, int64_t low, int64_t value);
CAPTAIN_HIDDEN size_t captain_get_unconstrained(captain_reader *reader, size_t at, int64_t *value);
CAPTAIN_HIDDEN size_t captain_put_unconstrained(captain_writer *writer, size_t at, int64_t value);
/* Normally small number (11.6), at most CAPTAIN_UNKNOWN - 1. */
CAPTAIN_HIDDEN size_t captain_get_small(captain_reader *reader, size_t at, uint32_t *value);
CAPTAIN_HIDDEN size_t captain_put_small(captain_writer *writer, size_t at, uint32_t value);
/* ENUMERATED: the item of a root's index; what follows the extension bit; the index of an item, or -1. */
CAPTAIN_HIDDEN size_t captain_get_item(captain_reader *reader, size_t at, const captain_type *type, int32_t *value);
CAPTAIN_HIDDEN size_t captain_encode_item(captain_writer *writer, size_t at, const captain_type *type, int32_t value);
CAPTAIN_HIDDEN int32_t captain_item_index(const captain_type *type, int32_t value);

/* A general length (11.9.3.5 to 11.9.3.8). more: a fragment that another length follows. Below 16384: */
CAPTAIN_HIDDEN size_t captain_get_length(captain_reader *reader, size_t at, uint32_t *length, bool *more);
CAPTAIN_HIDDEN size_t captain_put_length(captain_writer *writer, size_t at, size_t length);

/* ---------------------------------------------------------------- strings */

/* With a general length: how many units of so many bits, put together in the arena or only counted. */
CAPTAIN_HIDDEN size_t captain_get_units(captain_reader *reader, size_t at, unsigned unit, size_t *count);
CAPTAIN_HIDDEN size_t captain_get_string(captain_reader *reader, size_t at, unsigned unit, size_t *count, const uint8_t **octets);
/* Of known size. */
CAPTAIN_HIDDEN size_t captain_get_sized(captain_reader *reader, size_t at, size_t bits, const uint8_t **octets);
CAPTAIN_HIDDEN size_t captain_put_sized(captain_writer *writer, size_t at, const uint8_t *octets, size_t bits);
/* The next fragment of the `left` units that are left: its length is written, its units come back; `more` follow it. */
CAPTAIN_HIDDEN size_t captain_put_fragment(captain_writer *writer, size_t at, size_t left, size_t *length, bool *more);

/* FIXED_OCTETS. */
CAPTAIN_HIDDEN size_t captain_get_octets(captain_reader *reader, size_t at, uint8_t *octets, size_t count);
CAPTAIN_HIDDEN size_t captain_put_octets(captain_writer *writer, size_t at, const uint8_t *octets, size_t count);
/* Everything that is a captain_bits, captain_octets or captain_text, by its table. */
CAPTAIN_HIDDEN size_t captain_decode_string(captain_reader *reader, size_t at, const captain_type *type, void *value);
CAPTAIN_HIDDEN size_t captain_encode_string(captain_writer *writer, size_t at, const captain_type *type, const void *value);
CAPTAIN_HIDDEN captain_status captain_validate_string(const captain_type *type, const void *value);

/* Characters of a UTF8String. */
CAPTAIN_HIDDEN size_t captain_text_count(const captain_text *text);

/* ---------------------------------------------------------------- lists */

/* A count is believed when the octets can hold so many elements. False: captain_fail has been called. */
CAPTAIN_HIDDEN bool captain_is_believed(captain_reader *reader, size_t at, size_t count, unsigned minimal);
/* Memory; NULL: captain_fail has been called. */
CAPTAIN_HIDDEN void *captain_take(captain_reader *reader, size_t at, size_t octets);
/* Memory for a list of which `count` (not 0) elements of at least `minimal` bits follow. NULL: captain_fail has been called. */
CAPTAIN_HIDDEN void *captain_take_items(captain_reader *reader, size_t at, uint32_t count, size_t size, unsigned minimal);
/* A list with a general length (11.9.3.5 to 11.9.3.8), in fragments where it is long. */
CAPTAIN_HIDDEN size_t captain_decode_items(captain_reader *reader, size_t at, captain_list *list, size_t size, unsigned minimal,
                                           size_t (*item)(captain_reader *, size_t, void *));
CAPTAIN_HIDDEN size_t captain_encode_items(captain_writer *writer, size_t at, const void *items, uint32_t count, size_t size,
                                           size_t (*item)(captain_writer *, size_t, const void *));

/* ---------------------------------------------------------------- open types (11.2) */

typedef struct captain_outside {
    const uint8_t *octets;
    size_t size, end;
    size_t start; /* of the content */
    size_t back;  /* where the message goes on */
} captain_outside;

/* Between these two only the content is seen. It has to fill its octets but for less than eight bits, all zero. */
CAPTAIN_HIDDEN size_t captain_open_begin(captain_reader *reader, size_t at, captain_outside *outside);
CAPTAIN_HIDDEN size_t captain_open_end(captain_reader *reader, size_t at, const captain_outside *outside);
/* The writer leaves 8 bits for the length and moves the content where that was not enough. */
CAPTAIN_HIDDEN size_t captain_put_open(captain_writer *writer, size_t at);
CAPTAIN_HIDDEN size_t captain_put_close(captain_writer *writer, size_t start, size_t at);
/* Of unknown content: its octets. */
CAPTAIN_HIDDEN size_t captain_get_unknown(captain_reader *reader, size_t at, captain_octets *octets);
CAPTAIN_HIDDEN size_t captain_put_unknown(captain_writer *writer, size_t at, const captain_octets *octets);
/* The type that an open type's identifier stands for, or NULL. */
CAPTAIN_HIDDEN const captain_type *captain_row_of(const captain_type *type, int64_t id);
/* A component of a class's type field: by the table of an OPEN and the identifier beside it. */
CAPTAIN_HIDDEN size_t captain_decode_open(captain_reader *reader, size_t at, const captain_type *type, int64_t id, captain_open *value);
CAPTAIN_HIDDEN size_t captain_encode_open(captain_writer *writer, size_t at, const captain_type *type, int64_t id, const captain_open *value);
CAPTAIN_HIDDEN captain_status captain_validate_open(const captain_type *type, int64_t id, const captain_open *value);

/* ---------------------------------------------------------------- extension additions (19.7 to 19.9) */

/* The bitmap of a SEQUENCE's additions: the first 64 bits stand left aligned in `known`. */
typedef struct captain_bitmap {
    uint64_t known;
    size_t at;
    uint32_t count;
} captain_bitmap;

CAPTAIN_HIDDEN size_t captain_get_bitmap(captain_reader *reader, size_t at, captain_bitmap *bitmap);
/* The additions that the type does not know (it knows `count`), and the bitmap's length where it has to be kept. */
CAPTAIN_HIDDEN size_t captain_get_additions(captain_reader *reader, size_t at, const captain_bitmap *bitmap, uint32_t count,
                                            const captain_additions **additions);
/* Of a type that knows no additions: both. */
CAPTAIN_HIDDEN size_t captain_get_all_additions(captain_reader *reader, size_t at, const captain_additions **additions);
/* known: as in captain_bitmap. The unknown ones follow by captain_put_additions. */
CAPTAIN_HIDDEN size_t captain_encode_bitmap(captain_writer *writer, size_t at, uint32_t count, uint64_t known,
                                            const captain_additions *additions);
CAPTAIN_HIDDEN size_t captain_put_additions(captain_writer *writer, size_t at, const captain_additions *additions);

/* Is there something kept that asks for the extension bit? */
static inline bool captain_is_extended(const captain_additions *additions)
{
    return additions != NULL && additions->bits != 0;
}

#ifdef __cplusplus
}
#endif
#endif

/* Building blocks of generated code: reader and writer of bits, and functions for the rarer parts of X.691.
 *
 * Offsets count bits from the first octet. Every function takes an offset and returns the one after what it read or wrote. On
 * failure it returns CAPTAIN_FAILED and sets `status`. Functions captain_put_... never fail: at the end of the buffer they
 * continue to count, and set `status` to CAPTAIN_NO_SPACE. Clauses are those of X.691 (02/2021). */
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

/* Limit for lists whose elements have no bits, because their octets do not limit the count. */
#define CAPTAIN_MAX_EMPTY 65536u
/* Limit for nested containers that contain themselves. Each level of IVIM's signs takes eight of them. The functions that walk
 * the tables limit all nested containers, to CAPTAIN_MAX_DEPTH. */
#define CAPTAIN_MAX_RECURSION 32u
/* Limit for a bitmap of additions. Longer ones are fragmented (11.9.3.8); no type has so many additions. */
#define CAPTAIN_MAX_ADDITIONS 16383u

struct captain_reader {
    const uint8_t *octets;
    size_t size; /* number of readable octets */
    size_t end;  /* bit offset of the end of the message, or of the open type that is being read; never below `at` */
    captain_arena *arena;
    size_t reached; /* offset reached, on failure */
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

/* Return the bits from `at` on, left-aligned; at least 57 of them are valid. The caller has checked `end`. */
static inline uint64_t captain_load(const captain_reader *reader, size_t at)
{
    uint64_t word;
    size_t octet = at >> 3;
    if (CAPTAIN_UNLIKELY(octet + 8 > reader->size))
        return captain_load_end(reader, at);
    memcpy(&word, reader->octets + octet, 8);
    return captain_big_endian(word) << (at & 7);
}

/* Write the lowest `count` bits of `bits` (1 to 57); higher bits must be zero. Clears up to 8 octets after them. */
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

/* captain_load and captain_put as functions, for places where code size matters more than speed. */
CAPTAIN_HIDDEN uint64_t captain_peek(const captain_reader *reader, size_t at);
CAPTAIN_HIDDEN size_t captain_put_bits(captain_writer *writer, size_t at, uint64_t bits, unsigned count);
/* For 1 to 64 bits. */
CAPTAIN_HIDDEN size_t captain_get_long(captain_reader *reader, size_t at, unsigned count, uint64_t *bits);
CAPTAIN_HIDDEN size_t captain_put_long(captain_writer *writer, size_t at, uint64_t bits, unsigned count);
/* INTEGER without an upper bound or outside its root: 11.7 with a lower bound, 11.8 without. */
CAPTAIN_HIDDEN size_t captain_get_semi(captain_reader *reader, size_t at, int64_t low, int64_t *value);
CAPTAIN_HIDDEN size_t captain_put_semi(captain_writer *writer, size_t at, int64_t low, int64_t value);
CAPTAIN_HIDDEN size_t captain_get_unconstrained(captain_reader *reader, size_t at, int64_t *value);
CAPTAIN_HIDDEN size_t captain_put_unconstrained(captain_writer *writer, size_t at, int64_t value);
/* Normally small number (11.6), at most CAPTAIN_UNKNOWN - 1. */
CAPTAIN_HIDDEN size_t captain_get_small(captain_reader *reader, size_t at, uint32_t *value);
CAPTAIN_HIDDEN size_t captain_put_small(captain_writer *writer, size_t at, uint32_t value);
/* ENUMERATED: get_item reads what follows an extension bit of 1; item_index returns an item's index, or -1. */
CAPTAIN_HIDDEN size_t captain_get_item(captain_reader *reader, size_t at, const captain_type *type, int32_t *value);
CAPTAIN_HIDDEN size_t captain_encode_item(captain_writer *writer, size_t at, const captain_type *type, int32_t value);
CAPTAIN_HIDDEN int32_t captain_item_index(const captain_type *type, int32_t value);

/* General length (11.9.3.5 to 11.9.3.8). more: another length follows this fragment. put_length: below 16384. */
CAPTAIN_HIDDEN size_t captain_get_length(captain_reader *reader, size_t at, uint32_t *length, bool *more);
CAPTAIN_HIDDEN size_t captain_put_length(captain_writer *writer, size_t at, size_t length);

/* ---------------------------------------------------------------- strings */

/* String with a general length, in units of `unit` bits: get_units only counts them, get_string collects them in the arena. */
CAPTAIN_HIDDEN size_t captain_get_units(captain_reader *reader, size_t at, unsigned unit, size_t *count);
CAPTAIN_HIDDEN size_t captain_get_string(captain_reader *reader, size_t at, unsigned unit, size_t *count, const uint8_t **octets);
/* String of known size. */
CAPTAIN_HIDDEN size_t captain_get_sized(captain_reader *reader, size_t at, size_t bits, const uint8_t **octets);
CAPTAIN_HIDDEN size_t captain_put_sized(captain_writer *writer, size_t at, const uint8_t *octets, size_t bits);
/* Write the length of the next fragment of the `left` remaining units. length: units in it; more: others follow. */
CAPTAIN_HIDDEN size_t captain_put_fragment(captain_writer *writer, size_t at, size_t left, size_t *length, bool *more);

/* FIXED_OCTETS. */
CAPTAIN_HIDDEN size_t captain_get_octets(captain_reader *reader, size_t at, uint8_t *octets, size_t count);
CAPTAIN_HIDDEN size_t captain_put_octets(captain_writer *writer, size_t at, const uint8_t *octets, size_t count);
/* Any captain_bits, captain_octets or captain_text, by its table. */
CAPTAIN_HIDDEN size_t captain_decode_string(captain_reader *reader, size_t at, const captain_type *type, void *value);
CAPTAIN_HIDDEN size_t captain_encode_string(captain_writer *writer, size_t at, const captain_type *type, const void *value);
CAPTAIN_HIDDEN captain_status captain_validate_string(const captain_type *type, const void *value);

/* Return the number of characters of a UTF8String. */
CAPTAIN_HIDDEN size_t captain_text_count(const captain_text *text);

/* ---------------------------------------------------------------- lists */

/* Accept a count only if the remaining octets can contain so many elements. If not, captain_fail has been called. */
CAPTAIN_HIDDEN bool captain_is_believed(captain_reader *reader, size_t at, size_t count, unsigned minimal);
/* Allocate; if the result is NULL, captain_fail has been called. */
CAPTAIN_HIDDEN void *captain_take(captain_reader *reader, size_t at, size_t octets);
/* Allocate a list of `count` (not 0) elements of at least `minimal` bits. If NULL, captain_fail has been called. */
CAPTAIN_HIDDEN void *captain_take_items(captain_reader *reader, size_t at, uint32_t count, size_t size, unsigned minimal);
/* List with a general length (11.9.3.5 to 11.9.3.8), in fragments if it is long. */
CAPTAIN_HIDDEN size_t captain_decode_items(captain_reader *reader, size_t at, captain_list *list, size_t size, unsigned minimal,
                                           size_t (*item)(captain_reader *, size_t, void *));
CAPTAIN_HIDDEN size_t captain_encode_items(captain_writer *writer, size_t at, const void *items, uint32_t count, size_t size,
                                           size_t (*item)(captain_writer *, size_t, const void *));

/* ---------------------------------------------------------------- open types (11.2) */

typedef struct captain_outside {
    const uint8_t *octets;
    size_t size, end;
    size_t start; /* start of the content */
    size_t back;  /* offset in the message after the open type */
} captain_outside;

/* Between begin and end, the reader is limited to the content. It must fill its octets except for up to 7 zero bits. */
CAPTAIN_HIDDEN size_t captain_open_begin(captain_reader *reader, size_t at, captain_outside *outside);
CAPTAIN_HIDDEN size_t captain_open_end(captain_reader *reader, size_t at, const captain_outside *outside);
/* put_open reserves 8 bits for the length; put_close moves the content if the length is longer. */
CAPTAIN_HIDDEN size_t captain_put_open(captain_writer *writer, size_t at);
CAPTAIN_HIDDEN size_t captain_put_close(captain_writer *writer, size_t start, size_t at);
/* Unknown content, as octets. */
CAPTAIN_HIDDEN size_t captain_get_unknown(captain_reader *reader, size_t at, captain_octets *octets);
CAPTAIN_HIDDEN size_t captain_put_unknown(captain_writer *writer, size_t at, const captain_octets *octets);
/* Return the type for an open type's identifier; NULL if unknown. */
CAPTAIN_HIDDEN const captain_type *captain_row_of(const captain_type *type, int64_t id);
/* Open type, by its table and the identifier in the selecting component. */
CAPTAIN_HIDDEN size_t captain_decode_open(captain_reader *reader, size_t at, const captain_type *type, int64_t id, captain_open *value);
CAPTAIN_HIDDEN size_t captain_encode_open(captain_writer *writer, size_t at, const captain_type *type, int64_t id, const captain_open *value);
CAPTAIN_HIDDEN captain_status captain_validate_open(const captain_type *type, int64_t id, const captain_open *value);

/* ---------------------------------------------------------------- extension additions (19.7 to 19.9) */

/* Bitmap of a SEQUENCE's additions. known: its first 64 bits, left-aligned. */
typedef struct captain_bitmap {
    uint64_t known;
    size_t at;
    uint32_t count;
} captain_bitmap;

CAPTAIN_HIDDEN size_t captain_get_bitmap(captain_reader *reader, size_t at, captain_bitmap *bitmap);
/* Read the additions that the type does not know (it knows `count`), and the length of the bitmap if that must be kept. */
CAPTAIN_HIDDEN size_t captain_get_additions(captain_reader *reader, size_t at, const captain_bitmap *bitmap, uint32_t count,
                                            const captain_additions **additions);
/* Read bitmap and additions of a type that knows none. */
CAPTAIN_HIDDEN size_t captain_get_all_additions(captain_reader *reader, size_t at, const captain_additions **additions);
/* known: as in captain_bitmap. captain_put_additions writes the unknown ones afterwards. */
CAPTAIN_HIDDEN size_t captain_encode_bitmap(captain_writer *writer, size_t at, uint32_t count, uint64_t known,
                                            const captain_additions *additions);
CAPTAIN_HIDDEN size_t captain_put_additions(captain_writer *writer, size_t at, const captain_additions *additions);

/* Return whether kept additions require the extension bit. */
static inline bool captain_is_extended(const captain_additions *additions)
{
    return additions != NULL && additions->bits != 0;
}

#ifdef __cplusplus
}
#endif
#endif

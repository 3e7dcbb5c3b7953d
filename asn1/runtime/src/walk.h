/* What the walkers of the tables share: how a value lies in memory, where a walk is, text that goes out. Not for users of the
 * library, and independent of the generated code: two ways to the same answer.
 *
 * Clauses are those of ITU-T X.691 (02/2021), X.680 (02/2021), X.690 (02/2021) and X.697 (02/2021) in all of src/.
 */
#ifndef CAPTAIN_WALK_H
#define CAPTAIN_WALK_H

#include <captain/runtime.h>

#pragma GCC visibility push(hidden)

#define TRY(CALL)                        \
    do {                                 \
        captain_status status_ = (CALL); \
        if (status_ != CAPTAIN_OK)       \
            return status_;              \
    } while (0)

/* ---------------------------------------------------------------- values in memory (walk.c) */

/* A number, an enumeration item or small bits, of type->width octets; of an unsigned type of 8 octets the same 64 bits. */
int64_t captain_walk_number(const captain_type *type, const void *value);
void captain_walk_set_number(const captain_type *type, void *value, int64_t number);
bool captain_walk_is_unsigned64(const captain_type *type);
/* Whether number, or the size count, lies in the root range. */
bool captain_walk_in_range(const captain_type *type, int64_t number);
bool captain_walk_in_size(const captain_type *type, uint64_t count);
/* Whether it lies in a gap of the union that the range was made of. */
bool captain_walk_in_gap(const captain_type *type, int64_t number);
/* Whether there is one size only, known from the type. */
bool captain_walk_is_fixed(const captain_type *type);

bool captain_walk_is_string(const captain_type *type); /* captain_text */
/* Of a character string other than UTF8String: the n-th character, -1 past the last; and whether one belongs to it,
 * outside the root of an extensible size to its whole string type (30.4). */
int32_t captain_walk_character(const captain_type *type, bool in_root, uint32_t n);
bool captain_walk_has_character(const captain_type *type, bool in_root, uint32_t code);

/* Extension additions of a SEQUENCE: above it the length of their bitmap would be fragmented (11.9.3.8), and no type has so many. */
enum { CAPTAIN_WALK_ADDITIONS = 16383 };

/* So many containers that contain themselves may stand within one another (CAPTAIN_RECURS). */
enum { CAPTAIN_WALK_RECURSION = 32 };

/* How deep a value in memory is followed: what decode gives is never deeper, a struct that points to itself is. */
enum { CAPTAIN_WALK_DEPTH = 2 * CAPTAIN_MAX_DEPTH };

/* Strings, object identifiers and lists: copies, because each list is a struct of its own. */
captain_octets captain_walk_octets(const void *value);
captain_list captain_walk_list(const void *value);
/* Of a CHOICE whose alternative is unknown: its open type. */
captain_octets *captain_walk_unknown(const captain_type *type, const void *value);

/* NULL where the pointer of a CAPTAIN_POINTER field is NULL. */
const void *captain_walk_field(const captain_field *field, const void *structure);
bool captain_walk_is_present(const captain_field *field, const void *structure);
/* The value, or the default of an absent one, or NULL. */
const void *captain_walk_effective(const captain_field *field, const void *structure);
/* The same, but NULL for an absent addition: its sender may not have known it. This is what text and JSON show. */
const void *captain_walk_shown(const captain_field *field, const void *structure);
const captain_additions *captain_walk_additions(const captain_type *type, const void *structure);
/* Length of the bitmap that is kept, 0 where none is. */
uint32_t captain_walk_bitmap(const captain_additions *additions);

/* Of an ENUMERATED: the item's index in names, or -1. */
int32_t captain_walk_item(const captain_type *type, int64_t number);
/* Of a number: its name or NULL. */
const char *captain_walk_name(const captain_type *type, int64_t number);
/* The type that an open type's identifier stands for, or NULL. */
const captain_type *captain_walk_row(const captain_type *type, int64_t id);

/* Of a value in memory: bit n of a bit string, and its length without trailing zeros where they do not count. */
bool captain_walk_bit(const captain_type *type, const void *value, uint32_t n);
uint32_t captain_walk_bits(const captain_type *type, const void *value);

/* Whether octets are the numbers of an object identifier (X.690 8.19.2). */
bool captain_walk_is_oid(const captain_octets *oid);

/* UTF-8, octet by octet: false where it is none. At the end `left` must be 0. */
typedef struct captain_utf8 {
    uint32_t code, least;
    unsigned left;
} captain_utf8;
bool captain_utf8_feed(captain_utf8 *state, uint8_t octet);
bool captain_utf8_is_valid(const char *text, size_t octets);

/* ---------------------------------------------------------------- where and why (report.c) */

#if defined(__GNUC__)
#define CAPTAIN_PRINTF(text, arguments) __attribute__((format(printf, text, arguments)))
#else
#define CAPTAIN_PRINTF(text, arguments)
#endif

typedef struct captain_path {
    size_t length;
    char text[sizeof(((captain_report *)0)->path)];
} captain_path;

/* Both give the length before, for captain_path_pop. A path that does not fit is cut. */
size_t captain_path_push(captain_path *path, const char *name);
size_t captain_path_push_index(captain_path *path, uint64_t index);
size_t captain_path_push_addition(captain_path *path, uint64_t index); /* ".[3]" */
void captain_path_pop(captain_path *path, size_t length);

/* report may be NULL. Gives status. */
captain_status captain_walk_refuse(captain_report *report, const captain_path *path, size_t bit, captain_status status,
                                   const char *format, ...) CAPTAIN_PRINTF(5, 6);
void captain_report_clear(captain_report *report);

enum { CAPTAIN_RANGE_TEXT = 64 };
/* "0..255", "5", "MIN..0": what is allowed, for a sentence. */
const char *captain_range_text(const captain_type *type, char text[CAPTAIN_RANGE_TEXT]);
/* "-5", or of an unsigned type of 8 octets "18446744073709551615". */
const char *captain_number_text(const captain_type *type, int64_t number, char text[CAPTAIN_RANGE_TEXT]);
/* "1..8 elements", "16 bits". */
const char *captain_size_text(const captain_type *type, char text[CAPTAIN_RANGE_TEXT]);
/* "bits", "octets", "characters", "elements" */
const char *captain_size_noun(const captain_type *type);
/* "INTEGER", "SEQUENCE OF", "open type" */
const char *captain_kind_text(const captain_type *type);
/* "SpeedValue", or of a type without a name what it is: "INTEGER". */
const char *captain_type_text(const captain_type *type);

/* The checks that encoding and JSON share: refused is what no encoding of the type can hold. */
captain_status captain_check_number(const captain_type *type, int64_t number, captain_report *report, const captain_path *path);
captain_status captain_check_size(const captain_type *type, uint64_t count, captain_report *report, const captain_path *path);
/* in_root: outside the root of an extensible size the alphabet is that of the whole string type (30.4). */
captain_status captain_check_text(const captain_type *type, bool in_root, const char *text, uint32_t octets,
                                  captain_report *report, const captain_path *path);
/* is_strict: a member that equals its default is there as well. */
captain_status captain_check_groups(const captain_type *type, const void *structure, bool is_strict, captain_report *report,
                                    captain_path *path);

/* The name nearest to this one, of `count` structs that begin with a name; NULL where none is near. */
const char *captain_walk_nearest(const char *name, const void *first, size_t stride, unsigned count);

/* ---------------------------------------------------------------- text (out.c, value_text.c) */

typedef struct captain_out {
    captain_sink sink;
    void *context;
    captain_status status; /* the first thing that went wrong */
    uint32_t count;
    char text[512];        /* collected, so that the sink is called seldom */
} captain_out;

void captain_out_start(captain_out *out, captain_sink sink, void *context);
captain_status captain_out_end(captain_out *out);
void captain_out_put(captain_out *out, const char *text, size_t octets);
void captain_out_string(captain_out *out, const char *text);
void captain_out_character(captain_out *out, char character);
void captain_out_blanks(captain_out *out, unsigned count);
void captain_out_integer(captain_out *out, int64_t number);
void captain_out_number(captain_out *out, const captain_type *type, int64_t number);
void captain_out_hex(captain_out *out, const uint8_t *octets, size_t count);
/* Hexadecimal text of a bit string in memory, the last octet filled up with zeros. */
void captain_out_bits_hex(captain_out *out, const captain_type *type, const void *value, uint32_t count);
/* In quotes, as JSON wants it. CAPTAIN_ALPHABET where it is not UTF-8. */
void captain_out_quoted(captain_out *out, const char *text, size_t octets);
/* "1.2.840", or "[2a8648]" where the octets are none or a number has more than 64 bits. */
void captain_out_oid(captain_out *out, bool is_relative, const captain_octets *oid);

/* A value that is no container, for people: 5 ms, 2028 (20.28 m/s), 0 (standstill), passengerCar (5), '1010'B, 'C0FFEE'H, "text".
 * unit: that of the component, NULL where it has none of its own. */
void captain_out_value(captain_out *out, const captain_type *type, const char *unit, const void *value);

#pragma GCC visibility pop

#endif

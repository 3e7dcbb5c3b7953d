/* Common parts of the functions that walk the tables: values in memory, paths of errors, output of text. This header is
 * internal. It is independent of the generated code, so that both can be compared.
 *
 * Clauses in all of src/ are those of ITU-T X.691 (02/2021), X.680 (02/2021), X.690 (02/2021) and X.697 (02/2021). */
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

/* Return a number, enumeration item or small bit string of type->width octets; for an unsigned type of 8 octets the same 64
 * bits. */
int64_t captain_walk_number(const captain_type *type, const void *value);
void captain_walk_set_number(const captain_type *type, void *value, int64_t number);
bool captain_walk_is_unsigned64(const captain_type *type);
/* Return whether a number, or the count of a size, lies in the root range. */
bool captain_walk_in_range(const captain_type *type, int64_t number);
bool captain_walk_in_size(const captain_type *type, uint64_t count);
/* Return whether it lies in a gap between the root's ranges. */
bool captain_walk_in_gap(const captain_type *type, int64_t number);
/* Return whether the type allows a single size only. */
bool captain_walk_is_fixed(const captain_type *type);

bool captain_walk_is_string(const captain_type *type); /* captain_text */
/* Character string other than UTF8String: return the n-th allowed character, -1 after the last; and whether a character is
 * allowed. Outside the root of an extensible size, the alphabet is that of the whole string type (30.4). */
int32_t captain_walk_character(const captain_type *type, bool in_root, uint32_t n);
bool captain_walk_has_character(const captain_type *type, bool in_root, uint32_t code);

/* Limit for extension additions of a SEQUENCE. Longer bitmaps are fragmented (11.9.3.8); no type has so many additions. */
enum { CAPTAIN_WALK_ADDITIONS = 16383 };

/* Limit for nested containers that contain themselves (CAPTAIN_RECURS). */
enum { CAPTAIN_WALK_RECURSION = 32 };

/* Limit for nested values in memory. Decoded values are never deeper, but a struct that points to itself would be. */
enum { CAPTAIN_WALK_DEPTH = 2 * CAPTAIN_MAX_DEPTH };

/* Strings, object identifiers and lists are returned as copies, because each list type is a struct of its own. */
captain_octets captain_walk_octets(const void *value);
captain_list captain_walk_list(const void *value);
/* Return the open type of a CHOICE's unknown alternative. */
captain_octets *captain_walk_unknown(const captain_type *type, const void *value);

/* Return NULL if the pointer of a CAPTAIN_POINTER field is NULL. */
const void *captain_walk_field(const captain_field *field, const void *structure);
bool captain_walk_is_present(const captain_field *field, const void *structure);
/* Return the value, or the default of an absent component; NULL if it has none. */
const void *captain_walk_effective(const captain_field *field, const void *structure);
/* The same, but NULL for an absent addition, because its sender may not have known it. Text and JSON show this. */
const void *captain_walk_shown(const captain_field *field, const void *structure);
const captain_additions *captain_walk_additions(const captain_type *type, const void *structure);
/* Return the kept length of the bitmap; 0 if none is kept. */
uint32_t captain_walk_bitmap(const captain_additions *additions);

/* Return the index of an ENUMERATED's item in names, or -1. */
int32_t captain_walk_item(const captain_type *type, int64_t number);
/* Return the name of a number, or NULL. */
const char *captain_walk_name(const captain_type *type, int64_t number);
/* Return the type for an open type's identifier, or NULL. */
const captain_type *captain_walk_row(const captain_type *type, int64_t id);

/* Return bit n of a bit string in memory, and its length, without trailing zeros if they are not significant. */
bool captain_walk_bit(const captain_type *type, const void *value, uint32_t n);
uint32_t captain_walk_bits(const captain_type *type, const void *value);

/* Return whether octets are a valid object identifier (X.690 8.19.2). */
bool captain_walk_is_oid(const captain_octets *oid);

/* Checker of UTF-8, octet by octet; false if invalid. At the end `left` must be 0. */
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

/* Both return the previous length, for captain_path_pop. A path that does not fit is cut. */
size_t captain_path_push(captain_path *path, const char *name);
size_t captain_path_push_index(captain_path *path, uint64_t index);
size_t captain_path_push_addition(captain_path *path, uint64_t index); /* ".[3]" */
void captain_path_pop(captain_path *path, size_t length);

/* Write a report and return status. report may be NULL. */
captain_status captain_walk_refuse(captain_report *report, const captain_path *path, size_t bit, captain_status status,
                                   const char *format, ...) CAPTAIN_PRINTF(5, 6);
void captain_report_clear(captain_report *report);

enum { CAPTAIN_RANGE_TEXT = 64 };
/* Return the allowed range for a sentence: "0..255", "5", "MIN..0". */
const char *captain_range_text(const captain_type *type, char text[CAPTAIN_RANGE_TEXT]);
/* Return a number: "-5", or for an unsigned type of 8 octets "18446744073709551615". */
const char *captain_number_text(const captain_type *type, int64_t number, char text[CAPTAIN_RANGE_TEXT]);
/* Return the allowed size: "1..8 elements", "16 bits". */
const char *captain_size_text(const captain_type *type, char text[CAPTAIN_RANGE_TEXT]);
/* "bits", "octets", "characters", "elements" */
const char *captain_size_noun(const captain_type *type);
/* "INTEGER", "SEQUENCE OF", "open type" */
const char *captain_kind_text(const captain_type *type);
/* Return the name of a type: "SpeedValue", or its kind if it has no name: "INTEGER". */
const char *captain_type_text(const captain_type *type);

/* Checks that encoding and JSON share. They refuse values that the encoding cannot represent. */
captain_status captain_check_number(const captain_type *type, int64_t number, captain_report *report, const captain_path *path);
captain_status captain_check_size(const captain_type *type, uint64_t count, captain_report *report, const captain_path *path);
/* in_root: False means outside the root of an extensible size, where the alphabet is that of the whole string type (30.4). */
captain_status captain_check_text(const captain_type *type, bool in_root, const char *text, uint32_t octets,
                                  captain_report *report, const captain_path *path);
/* is_strict: a member that equals its default counts as present. */
captain_status captain_check_groups(const captain_type *type, const void *structure, bool is_strict, captain_report *report,
                                    captain_path *path);

/* Return the nearest name among `count` structs that begin with a name; NULL if none is near. */
const char *captain_walk_nearest(const char *name, const void *first, size_t stride, unsigned count);

/* ---------------------------------------------------------------- text (out.c, value_text.c) */

typedef struct captain_out {
    captain_sink sink;
    void *context;
    captain_status status; /* first error */
    uint32_t count;
    char text[512];        /* buffer, so that the sink is called seldom */
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
/* Write a bit string in memory as hexadecimal text; the last octet is padded with zeros. */
void captain_out_bits_hex(captain_out *out, const captain_type *type, const void *value, uint32_t count);
/* Write text as a JSON string. CAPTAIN_ALPHABET for invalid UTF-8. */
void captain_out_quoted(captain_out *out, const char *text, size_t octets);
/* Write "1.2.840", or "[2a8648]" if the octets are invalid or a number has more than 64 bits. */
void captain_out_oid(captain_out *out, bool is_relative, const captain_octets *oid);

/* Write a value other than a container for people: 5 ms, 2028 (20.28 m/s), 0 (standstill), passengerCar (5), '1010'B,
 * 'C0FFEE'H, "text". unit: of the component; NULL to use that of the type. */
void captain_out_value(captain_out *out, const captain_type *type, const char *unit, const void *value);

#pragma GCC visibility pop

#endif

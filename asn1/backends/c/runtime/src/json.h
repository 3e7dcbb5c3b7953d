/* Strict reader of JSON (RFC 8259) in memory. Strings are copied only after their length is known. Its parts: json_scan.c and
 * json_number.c (text), json_string.c (strings), json_read.c (other values), json_object.c (SEQUENCE, CHOICE), json_plain.c
 * (numbers and bits of the plain dialect). */
#ifndef CAPTAIN_JSON_H
#define CAPTAIN_JSON_H

#include "plain.h"

#pragma GCC visibility push(hidden)

typedef struct json {
    const char *start, *next, *end;
    captain_arena *arena;
    captain_report *report; /* may be NULL */
    captain_path path;
    unsigned depth, recursion;
    bool is_plain;
    const char *unit; /* of the component that is read; NULL to use that of its type */
} json;

/* A scanned string, without its quotes. octets: length in UTF-8 after escapes are replaced. */
typedef struct json_string {
    const char *from, *until;
    size_t octets;
} json_string;

/* Limit for a name. Names of components are shorter, so a longer one is unknown. */
enum { JSON_MAX_NAME = 128 };

/* ---------------------------------------------------------------- json_scan.c */

void captain_json_blanks(json *from);
bool captain_json_is(json *from, char character); /* Return whether the character is next, after blanks. */
bool captain_json_take(json *from, char character);
captain_status captain_json_expect(json *from, char character, const char *what);
/* Fail with the path, and the offset in the text. */
captain_status captain_json_refuse(json *from, captain_status status, const char *text);
/* Fail with the sentence "what is expected, \"abc\" found". */
captain_status captain_json_refuse_found(json *from, captain_status status, const char *expected);
bool captain_json_word(json *from, const char *word);
captain_status captain_json_take_string(json *from, json_string *string, const char *expected);
int captain_json_hex(char character); /* Return the value of a digit, or -1. */
void captain_json_copy(const json_string *string, char *text); /* Copy string->octets octets. */
/* Copy a name, terminated by 0; empty if it is too long for one. */
void captain_json_copy_name(const json_string *string, char name[JSON_MAX_NAME]);
/* Read a name and its colon; a longer name is cut. */
captain_status captain_json_name(json *from, char name[JSON_MAX_NAME]);
/* Return a name for a sentence; unprintable characters become "?". */
const char *captain_json_show(const char *name, char shown[JSON_MAX_NAME]);
/* Return the next printable characters, for a sentence. */
enum { JSON_FOUND = 48 };
const char *captain_json_found(json *from, char text[JSON_FOUND]);
/* Read a whole number, also written as 1.0 or 1e3; CAPTAIN_RANGE above 64 bits. */
captain_status captain_json_integer(json *from, bool is_unsigned64, int64_t *number);
/* Read a number in the unit of the plain dialect, rounded to the nearest step. is_small: it fits 64 bits. */
captain_status captain_json_scaled(json *from, const captain_plain *of, bool is_unsigned64, int64_t *number, bool *is_small);
captain_status captain_json_skip(json *from);
bool captain_json_skip_number(json *from);

/* Members of objects and elements of arrays: callers loop while *is_more. */
captain_status captain_json_open(json *from, char bracket, const char *expected, bool *is_more);
captain_status captain_json_more(json *from, char bracket, bool *is_more);

/* ---------------------------------------------------------------- json_read.c, json_string.c, json_object.c, json_plain.c */

captain_status captain_json_value(json *from, const captain_type *type, void *value);
captain_status captain_json_sequence(json *from, const captain_type *type, void *value);
captain_status captain_json_choice(json *from, const captain_type *type, void *value);
captain_status captain_json_octets(json *from, captain_octets *octets);
captain_status captain_json_read_octets(json *from, const captain_type *type, void *value);
captain_status captain_json_read_bits(json *from, const captain_type *type, void *value);
/* Store bits; the octets remain in use unless the type is CAPTAIN_SMALL_BITS. */
void captain_json_store_bits(const captain_type *type, void *value, const uint8_t *octets, uint32_t count);
captain_status captain_json_read_plain_integer(json *from, const captain_type *type, const char *unit, void *value);
captain_status captain_json_read_named_bits(json *from, const captain_type *type, void *value);
captain_status captain_json_read_text(json *from, const captain_type *type, captain_text *value);
captain_status captain_json_read_oid(json *from, const captain_type *type, void *value);
/* Convert "1.2.840" or "[2a8648]", terminated by 0, to octets; one octet more must fit. Returns their number; SIZE_MAX if
 * invalid. */
size_t captain_json_oid(const captain_text *text, bool is_relative, uint8_t *octets);
captain_status captain_json_take_memory(json *from, size_t octets, void **memory);
/* Parse "[3]": return the number, or -1 for another form. */
int64_t captain_json_bracket(const char *name);

#pragma GCC visibility pop

#endif

/* A strict reader of JSON (RFC 8259) over the octets themselves: nothing is copied before its length is known. Its parts:
 * json_scan.c and json_number.c (the text), json_string.c (strings), json_read.c (the other values), json_object.c (SEQUENCE, CHOICE).
 */
#ifndef CAPTAIN_JSON_H
#define CAPTAIN_JSON_H

#include "walk.h"

#pragma GCC visibility push(hidden)

typedef struct json {
    const char *start, *next, *end;
    captain_arena *arena;
    captain_report *report; /* may be NULL */
    captain_path path;
    unsigned depth, recursion;
} json;

/* A string that has been looked through, without its quotes; octets: how many UTF-8 ones it stands for. */
typedef struct json_string {
    const char *from, *until;
    size_t octets;
} json_string;

/* Names of components are shorter; a longer one is none of them. */
enum { JSON_MAX_NAME = 128 };

/* ---------------------------------------------------------------- json_scan.c */

void captain_json_blanks(json *from);
bool captain_json_is(json *from, char character); /* whether it is next; blanks before it are passed over */
bool captain_json_take(json *from, char character);
captain_status captain_json_expect(json *from, char character, const char *what);
/* With the path, and the place in the text. */
captain_status captain_json_refuse(json *from, captain_status status, const char *text);
/* "what is expected, \"abc\" found" */
captain_status captain_json_refuse_found(json *from, captain_status status, const char *expected);
bool captain_json_word(json *from, const char *word);
captain_status captain_json_take_string(json *from, json_string *string, const char *expected);
int captain_json_hex(char character); /* the value of a digit, or -1 */
void captain_json_copy(const json_string *string, char *text); /* string->octets of them */
/* A name and its colon; cut where it is longer. */
captain_status captain_json_name(json *from, char name[JSON_MAX_NAME]);
/* A name as a sentence shows it: what cannot be printed as "?". */
const char *captain_json_show(const char *name, char shown[JSON_MAX_NAME]);
/* The next characters, printable ones only, for a sentence. */
enum { JSON_FOUND = 48 };
const char *captain_json_found(json *from, char text[JSON_FOUND]);
/* Whole, with 1.0 and 1e3; CAPTAIN_RANGE above 64 bits. */
captain_status captain_json_integer(json *from, bool is_unsigned64, int64_t *number);
captain_status captain_json_skip(json *from);
bool captain_json_skip_number(json *from);

/* Members of objects and elements of arrays: `while` loops over *is_more. */
captain_status captain_json_open(json *from, char bracket, const char *expected, bool *is_more);
captain_status captain_json_more(json *from, char bracket, bool *is_more);

/* ---------------------------------------------------------------- json_read.c, json_string.c, json_object.c */

captain_status captain_json_value(json *from, const captain_type *type, void *value);
captain_status captain_json_sequence(json *from, const captain_type *type, void *value);
captain_status captain_json_choice(json *from, const captain_type *type, void *value);
captain_status captain_json_octets(json *from, captain_octets *octets);
captain_status captain_json_read_octets(json *from, const captain_type *type, void *value);
captain_status captain_json_read_bits(json *from, const captain_type *type, void *value);
captain_status captain_json_read_text(json *from, const captain_type *type, captain_text *value);
captain_status captain_json_read_oid(json *from, const captain_type *type, void *value);
/* "1.2.840" or "[2a8648]", with a 0 behind it, into octets that have room for it and one more. How many; SIZE_MAX: it is neither. */
size_t captain_json_oid(const captain_text *text, bool is_relative, uint8_t *octets);
captain_status captain_json_take_memory(json *from, size_t octets, void **memory);
/* "[3]": the number, or -1 where it is not of this form. */
int64_t captain_json_bracket(const char *name);

#pragma GCC visibility pop

#endif

/* A strict reader of JSON (RFC 8259) over the octets themselves: nothing is copied before its length is known. Its parts:
 * json_scan.c (the text), json_read.c (values), json_object.c (SEQUENCE and CHOICE).
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
    unsigned depth;
} json;

/* A string that has been looked through, without its quotes; octets: how many UTF-8 ones it stands for. */
typedef struct json_string {
    const char *from, *until;
    size_t octets;
} json_string;

/* Names of components are shorter; a longer one is none of them. */
enum { JSON_MAX_NAME = 128 };

/* ---------------------------------------------------------------- json_scan.c */

void json_blanks(json *from);
bool json_is(json *from, char character); /* whether it is next; blanks before it are passed over */
bool json_take(json *from, char character);
captain_status json_expect(json *from, char character, const char *what);
/* With the path, and the place in the text. */
captain_status json_refuse(json *from, captain_status status, const char *text);
/* "what is expected, \"abc\" found" */
captain_status json_refuse_found(json *from, captain_status status, const char *expected);
captain_status json_word(json *from, const char *word, bool *is_there);
captain_status json_take_string(json *from, json_string *string, const char *expected);
void json_copy(const json_string *string, char *text); /* string->octets of them */
/* A name and its colon; cut where it is longer. */
captain_status json_name(json *from, char name[JSON_MAX_NAME]);
/* A name as a sentence shows it: what cannot be printed as "?". */
const char *json_show(const char *name, char shown[JSON_MAX_NAME]);
/* Whole, with 1.0 and 1e3; CAPTAIN_RANGE above 64 bits. */
captain_status json_integer(json *from, bool is_unsigned64, int64_t *number);
captain_status json_skip(json *from);

/* Members of objects and elements of arrays: `while` loops over *is_more. */
captain_status json_open(json *from, char bracket, const char *expected, bool *is_more);
captain_status json_more(json *from, char bracket, bool *is_more);

/* ---------------------------------------------------------------- json_read.c, json_object.c */

captain_status json_value(json *from, const captain_type *type, void *value);
captain_status json_sequence(json *from, const captain_type *type, void *value);
captain_status json_choice(json *from, const captain_type *type, void *value);
captain_status json_octets(json *from, captain_octets *octets);
captain_status json_take_memory(json *from, size_t octets, void **memory);
/* "[3]": the number, or -1 where it is not of this form. */
int64_t json_bracket(const char *name);

#pragma GCC visibility pop

#endif

/* Plain dialect of JSON: numbers in SI units, special values and bits by name. plain.c: rules; json_plain.c: reader. */
#ifndef CAPTAIN_PLAIN_H
#define CAPTAIN_PLAIN_H

#include "walk.h"

#pragma GCC visibility push(hidden)

/* The value of a number n in `unit` is n * times / per / 10^places. With per 1 this is a finite decimal. */
typedef struct captain_plain {
    uint64_t times, per; /* 1..10^9 */
    unsigned places;     /* at most PLAIN_PLACES */
    const char *unit;    /* SI unit, degree, or the unit itself if it has none: "m/s", "person"; empty for a ratio */
} captain_plain;

enum { PLAIN_PLACES = 24 };

/* unit: in the schema, "0.01 m/s". A unit that plain does not convert gives the factor 1. */
captain_plain captain_plain_of(const captain_type *type, const char *unit);
/* Return the name of a special value (unavailable, outOfRange), or NULL for an ordinary number, even if it has a name. */
const char *captain_plain_special(const captain_type *type, int64_t number);
bool captain_plain_is_special(const char *name);
/* Return whether a number is in the range, without the special values at its ends. */
bool captain_plain_in_range(const captain_type *type, int64_t number);

enum { PLAIN_TEXT = 64 };
/* Return a number in its unit as the shortest exact decimal; rounded to nine places if no finite decimal is exact. */
const char *captain_plain_text(const captain_type *type, captain_plain of, int64_t number, char text[PLAIN_TEXT]);
/* Ends of the range without special values; false for an end without a bound. */
bool captain_plain_low(const captain_type *type, captain_plain of, char text[PLAIN_TEXT]);
bool captain_plain_high(const captain_type *type, captain_plain of, char text[PLAIN_TEXT]);

#pragma GCC visibility pop

#endif

/* Rules of the plain dialect of JSON: units, special values, and numbers as decimals. */
#include "plain.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/* ---------------------------------------------------------------- special values */

/* Names of numbers that are not measurements, in every spelling of the standards. asn1/backends/ros2/access.py has them too. */
static const char *const SPECIAL[] = {
    "unavailable", "unknown", "notAvailable", "doNotUse", "valueNotUsed",
    "outOfRange", "positiveOutOfRange", "postiveOutOfRange", "outOfRangePositive",
    "negativeOutOfRange", "negativeOutofRange", "outOfRangeNegative",
};

bool captain_plain_is_special(const char *name)
{
    for (unsigned i = 0; i < sizeof SPECIAL / sizeof *SPECIAL; i++)
        if (strcmp(name, SPECIAL[i]) == 0)
            return true;
    return false;
}

const char *captain_plain_special(const captain_type *type, int64_t number)
{
    const char *name = type->names_count > 0 ? captain_walk_name(type, number) : NULL;
    return name != NULL && captain_plain_is_special(name) ? name : NULL;
}

/* Return the first ordinary number from an end of the range. */
static int64_t ordinary(const captain_type *type, int64_t end, int step)
{
    while (captain_plain_special(type, end) != NULL && end > INT64_MIN && end < INT64_MAX)
        end += step;
    return end;
}

bool captain_plain_in_range(const captain_type *type, int64_t number)
{
    if (captain_plain_special(type, number) == NULL)
        return (type->flags & CAPTAIN_EXTENSIBLE) || captain_walk_in_range(type, number);
    bool is_high = !(type->flags & CAPTAIN_UNBOUNDED_HIGH) && number > ordinary(type, type->high, -1);
    bool is_low = !(type->flags & CAPTAIN_UNBOUNDED_LOW) && number < ordinary(type, type->low, 1);
    return !is_high && !is_low;
}

/* ---------------------------------------------------------------- units */

typedef struct base {
    const char *unit, *si;
    uint64_t times, per;
    unsigned places;
} base;

/* Units other than those of SI. The factors are those of asn1/backends/ros2/access.py. */
static const base BASES[] = {
    {"km/h", "m/s", 5, 18, 0}, {"us", "s", 1, 1, 6},    {"ms", "s", 1, 1, 3},     {"min", "s", 60, 1, 0},
    {"h", "s", 3600, 1, 0},    {"kPa", "Pa", 1000, 1, 0}, {"Wh", "J", 3600, 1, 0}, {"%", "", 1, 1, 2},
    {"kbit/s", "bit/s", 1000, 1, 0},
};

enum { COUNT_DIGITS = 6 };
/* Bounds for a factor without a finite decimal, so that 64 bits and nine places suffice. */
#define MAX_NUMBER INT64_C(1000000000000)
#define MAX_FACTOR UINT64_C(1000000000)

static const char *take_digits(const char *at, uint64_t *number, unsigned *count)
{
    for (; *at >= '0' && *at <= '9' && *count < COUNT_DIGITS; at++, ++*count)
        *number = 10 * *number + (uint64_t)(*at - '0');
    return at;
}

/* Parse the factor of a unit: "0.01 m/s", "1e-7 degree", "360/65535 degree", "0.01". Return the unit after it; NULL without. */
static const char *take_factor(const char *unit, captain_plain *of)
{
    unsigned whole = 0, fraction = 0, divisor = 0;
    of->times = 0;
    const char *at = take_digits(unit, &of->times, &whole);
    if (whole > 0 && *at == '.')
        at = take_digits(at + 1, &of->times, &fraction);
    of->places = fraction;
    if (whole > 0 && at[0] == 'e' && at[1] == '-' && at[2] >= '1' && at[2] <= '9') {
        of->places += (unsigned)(at[2] - '0');
        at += 3;
    } else if (whole > 0 && at[0] == '/') {
        of->per = 0;
        at = take_digits(at + 1, &of->per, &divisor);
    }
    if (whole == 0 || of->times == 0 || of->per == 0 || (*at != ' ' && *at != 0))
        return NULL;
    return *at == ' ' ? at + 1 : at;
}

static bool is_small(const captain_type *type)
{
    unsigned any = CAPTAIN_EXTENSIBLE | CAPTAIN_UNBOUNDED_LOW | CAPTAIN_UNBOUNDED_HIGH;
    return !(type->flags & any) && type->low >= -MAX_NUMBER && type->high >= type->low && type->high <= MAX_NUMBER;
}

/* Return whether nine places distinguish the numbers, and 64 bits hold all products. */
static bool is_convertible(const captain_type *type, captain_plain *of)
{
    if (of->per == 1)
        return of->times <= MAX_FACTOR / 10;
    for (; of->places > 0 && of->per < MAX_FACTOR; of->places--)
        of->per *= 10;
    return of->places == 0 && of->per <= MAX_FACTOR && of->times <= MAX_FACTOR / 1000 && of->times >= of->per / 10000000
           && is_small(type);
}

captain_plain captain_plain_of(const captain_type *type, const char *unit)
{
    const captain_plain none = {1, 1, 0, unit};
    captain_plain of = none;
    const char *rest = take_factor(unit, &of);
    if (rest == NULL)
        of = none;
    else
        of.unit = rest;
    for (unsigned i = 0; i < sizeof BASES / sizeof *BASES; i++)
        if (strcmp(of.unit, BASES[i].unit) == 0) {
            of = (captain_plain){of.times * BASES[i].times, of.per * BASES[i].per, of.places + BASES[i].places, BASES[i].si};
            break;
        }
    return is_convertible(type, &of) ? of : none;
}

/* ---------------------------------------------------------------- decimals */

#define BILLION UINT64_C(1000000000)

/* Write (high * 10^9 + low) / 10^places without zeros at its ends. */
static void put_decimal(char text[PLAIN_TEXT], bool is_negative, uint64_t high, uint64_t low, unsigned places)
{
    char digits[48];
    snprintf(digits, sizeof digits, "%025" PRIu64 "%09" PRIu64, high, low);
    size_t count = strlen(digits), point = count - places, from = 0;
    while (from + 1 < point && digits[from] == '0')
        from++;
    while (count > point && digits[count - 1] == '0')
        count--;
    snprintf(text, PLAIN_TEXT, "%s%.*s%s%.*s", is_negative ? "-" : "", (int)(point - from), digits + from, count > point ? "." : "",
             (int)(count - point), digits + point);
}

const char *captain_plain_text(const captain_type *type, captain_plain of, int64_t number, char text[PLAIN_TEXT])
{
    bool is_negative = number < 0 && !captain_walk_is_unsigned64(type);
    uint64_t magnitude = is_negative ? 0 - (uint64_t)number : (uint64_t)number;
    if (of.per == 1) {
        uint64_t low = magnitude % BILLION * of.times;
        put_decimal(text, is_negative, magnitude / BILLION * of.times + low / BILLION, low % BILLION, of.places);
    } else {
        uint64_t product = magnitude * of.times, fraction = (product % of.per * BILLION + of.per / 2) / of.per;
        put_decimal(text, is_negative, product / of.per + fraction / BILLION, fraction % BILLION, 9);
    }
    return text;
}

bool captain_plain_low(const captain_type *type, captain_plain of, char text[PLAIN_TEXT])
{
    captain_plain_text(type, of, ordinary(type, type->low, 1), text);
    return !(type->flags & (CAPTAIN_UNBOUNDED_LOW | CAPTAIN_EXTENSIBLE));
}

bool captain_plain_high(const captain_type *type, captain_plain of, char text[PLAIN_TEXT])
{
    captain_plain_text(type, of, ordinary(type, type->high, -1), text);
    return !(type->flags & (CAPTAIN_UNBOUNDED_HIGH | CAPTAIN_EXTENSIBLE));
}

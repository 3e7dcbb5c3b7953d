/* Numbers in JSON (RFC 8259 clause 6), in all notations: whole numbers, and numbers in a unit. */
#include "json.h"

/* Limit of exponents. No text has enough digits for a larger exponent to matter. */
#define MAX_EXPONENT INT64_C(1000000000000000)

typedef struct number_text {
    const char *digits, *point, *end; /* digits of the mantissa; point: begin of its fraction, or end */
    int64_t exponent;                 /* limited to MAX_EXPONENT */
    bool is_negative;
} number_text;

static const char *digits_end(const json *from, const char *at)
{
    while (at < from->end && *at >= '0' && *at <= '9')
        at++;
    return at;
}

static bool scan_exponent(const json *from, const char **at, int64_t *exponent)
{
    *exponent = 0;
    if (*at == from->end || (**at != 'e' && **at != 'E'))
        return true;
    ++*at;
    bool is_negative = *at < from->end && **at == '-';
    *at += *at < from->end && (**at == '-' || **at == '+');
    const char *end = digits_end(from, *at);
    if (end == *at)
        return false;
    for (; *at < end; ++*at)
        *exponent = *exponent < MAX_EXPONENT ? *exponent * 10 + (**at - '0') : *exponent;
    *exponent = is_negative ? -*exponent : *exponent;
    return true;
}

static bool scan_number(json *from, number_text *number)
{
    captain_json_blanks(from);
    const char *at = from->next;
    number->is_negative = at < from->end && *at == '-';
    at += number->is_negative;
    number->digits = at;
    number->point = number->end = at = digits_end(from, at);
    if (at == number->digits || (*number->digits == '0' && at > number->digits + 1))
        return false;
    if (at < from->end && *at == '.') {
        number->end = digits_end(from, at + 1);
        if (number->end == at + 1)
            return false;
        at = number->end;
    }
    if (!scan_exponent(from, &at, &number->exponent))
        return false;
    from->next = at;
    return true;
}

/* Return the magnitude. is_whole: it has no fraction; is_small: it fits 64 bits. */
static uint64_t magnitude(const number_text *number, bool *is_whole, bool *is_small)
{
    uint64_t result = 0;
    int64_t left = (number->point - number->digits) + number->exponent; /* digits before the point */
    *is_whole = *is_small = true;
    for (const char *at = number->digits; at < number->end; at++) {
        if (at == number->point)
            continue;
        unsigned digit = (unsigned)(*at - '0');
        if (left-- <= 0) {
            *is_whole &= digit == 0;
            continue;
        }
        *is_small &= result < UINT64_MAX / 10 || (result == UINT64_MAX / 10 && digit <= UINT64_MAX % 10);
        result = result * 10 + digit;
    }
    for (; left > 0 && result != 0 && *is_small; left--) {
        *is_small = result <= UINT64_MAX / 10;
        result *= 10;
    }
    return result;
}

static captain_status refuse_large(json *from, const char *end)
{
    char shown[JSON_FOUND];
    captain_json_found(from, shown);
    size_t length = (size_t)(end - from->next);
    if (length < sizeof shown - 8)
        shown[length] = 0;
    return captain_walk_refuse(from->report, &from->path, 0, CAPTAIN_RANGE, "%s does not fit into 64 bits", shown);
}

captain_status captain_json_integer(json *from, bool is_unsigned64, int64_t *number)
{
    number_text text;
    bool is_whole, is_small;
    const char *before = from->next;
    if (!scan_number(from, &text))
        return captain_json_refuse_found(from, CAPTAIN_SYNTAX, "a number");
    uint64_t value = magnitude(&text, &is_whole, &is_small);
    *number = (int64_t)(text.is_negative ? 0 - value : value);
    uint64_t most = is_unsigned64 ? (text.is_negative ? 0 : UINT64_MAX) : (uint64_t)INT64_MAX + text.is_negative;
    const char *after = from->next;
    if (is_whole && is_small && value <= most)
        return CAPTAIN_OK;
    from->next = before;
    if (!is_whole)
        return captain_json_refuse_found(from, CAPTAIN_SYNTAX, "a whole number");
    return refuse_large(from, after);
}

/* ---------------------------------------------------------------- numbers in a unit */

/* Digits of the fraction that decide on rounding. */
enum { FRACTION_DIGITS = 9 };
#define FRACTION UINT64_C(1000000000)

static unsigned next_digit(const number_text *text, const char **at)
{
    *at += *at == text->point;
    return *at < text->end ? (unsigned)(*(*at)++ - '0') : 0;
}

/* Return text * 10^places * per / times, rounded to the nearest; half a step away from 0. */
static uint64_t nearest_step(const number_text *text, const captain_plain *of, bool *is_small)
{
    uint64_t result = 0, rest = 0, fraction = 0; /* result + rest / times: value of the digits so far */
    int64_t left = (text->point - text->digits) + text->exponent + of->places;
    const char *at = text->digits;
    *is_small = true;
    for (; left > 0 && *is_small && (at < text->end || result != 0 || rest != 0); left--) {
        rest = 10 * rest + next_digit(text, &at) * of->per;
        *is_small = result < UINT64_MAX / 10 - rest / of->times;
        result = 10 * result + rest / of->times;
        rest %= of->times;
    }
    for (unsigned i = 0; i < FRACTION_DIGITS; i++, left++)
        fraction = 10 * fraction + (left < 0 ? 0 : next_digit(text, &at));
    rest = rest * FRACTION + fraction * of->per;
    uint64_t whole = of->times * FRACTION;
    return result + rest / whole + (2 * (rest % whole) >= whole);
}

captain_status captain_json_scaled(json *from, const captain_plain *of, bool is_unsigned64, int64_t *number, bool *is_small)
{
    number_text text;
    if (!scan_number(from, &text))
        return captain_json_refuse_found(from, CAPTAIN_SYNTAX, "a number");
    uint64_t value = nearest_step(&text, of, is_small);
    uint64_t most = is_unsigned64 ? (text.is_negative ? 0 : UINT64_MAX) : (uint64_t)INT64_MAX + text.is_negative;
    *is_small = *is_small && value <= most;
    *number = (int64_t)(text.is_negative ? 0 - value : value);
    return CAPTAIN_OK;
}

bool captain_json_skip_number(json *from)
{
    number_text number;
    return scan_number(from, &number);
}

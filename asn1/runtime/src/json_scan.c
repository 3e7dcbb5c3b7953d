/* The text of JSON: blanks, strings, numbers, what is skipped. */
#include "json.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

void json_blanks(json *from)
{
    while (from->next < from->end && (*from->next == ' ' || *from->next == '\t' || *from->next == '\n' || *from->next == '\r'))
        from->next++;
}

bool json_is(json *from, char character)
{
    json_blanks(from);
    return from->next < from->end && *from->next == character;
}

bool json_take(json *from, char character)
{
    bool is_there = json_is(from, character);
    from->next += is_there;
    return is_there;
}

/* ---------------------------------------------------------------- refusals */

captain_status json_refuse(json *from, captain_status status, const char *text)
{
    return captain_walk_refuse(from->report, &from->path, 0, status, "%s", text);
}

/* The next characters, printable ones only, for a sentence. */
static const char *found(json *from, char text[48])
{
    json_blanks(from);
    size_t left = (size_t)(from->end - from->next), count = left < 40 ? left : 40;
    if (left == 0)
        return "the end";
    for (size_t i = 0; i < count; i++)
        text[i] = from->next[i] < 32 || from->next[i] > 126 ? '?' : from->next[i];
    memcpy(text + count, count < left ? "..." : "", count < left ? 4 : 1);
    return text;
}

captain_status json_refuse_found(json *from, captain_status status, const char *expected)
{
    char text[48];
    if (from->report == NULL)
        return status;
    const char *what = found(from, text);
    return captain_walk_refuse(from->report, &from->path, 0, status, "%s is expected at offset %zu, found: %s", expected,
                               (size_t)(from->next - from->start), what);
}

captain_status json_expect(json *from, char character, const char *what)
{
    return json_take(from, character) ? CAPTAIN_OK : json_refuse_found(from, CAPTAIN_SYNTAX, what);
}

captain_status json_word(json *from, const char *word, bool *is_there)
{
    size_t length = strlen(word);
    json_blanks(from);
    *is_there = (size_t)(from->end - from->next) >= length && memcmp(from->next, word, length) == 0;
    from->next += *is_there ? length : 0;
    return CAPTAIN_OK;
}

/* ---------------------------------------------------------------- strings */

static int hex_digit(char character)
{
    if (character >= '0' && character <= '9')
        return character - '0';
    if (character >= 'a' && character <= 'f')
        return character - 'a' + 10;
    return character >= 'A' && character <= 'F' ? character - 'A' + 10 : -1;
}

/* Four hexadecimal digits. */
static bool take_unit(const char **at, const char *end, uint32_t *unit)
{
    *unit = 0;
    for (int i = 0; i < 4; i++, ++*at) {
        int digit = *at < end ? hex_digit(**at) : -1;
        if (digit < 0)
            return false;
        *unit = *unit << 4 | (uint32_t)digit;
    }
    return true;
}

static bool take_escape(const char **at, const char *end, uint32_t *code)
{
    static const char CODES[] = "\"\"\\\\//b\bf\fn\nr\rt\t";
    uint32_t low;
    if (*at >= end)
        return false;
    char letter = *(*at)++;
    for (unsigned i = 0; i + 1 < sizeof CODES; i += 2)
        if (letter == CODES[i]) {
            *code = (uint32_t)CODES[i + 1];
            return true;
        }
    if (letter != 'u' || !take_unit(at, end, code) || (*code >= 0xdc00 && *code <= 0xdfff))
        return false;
    if (*code < 0xd800 || *code > 0xdbff)
        return true;
    if (end - *at < 2 || (*at)[0] != '\\' || (*at)[1] != 'u')
        return false; /* half of a surrogate pair */
    *at += 2;
    if (!take_unit(at, end, &low) || low < 0xdc00 || low > 0xdfff)
        return false;
    *code = 0x10000 + ((*code - 0xd800) << 10) + (low - 0xdc00);
    return true;
}

static unsigned put_utf8(uint32_t code, char text[4])
{
    unsigned more = code < 0x80 ? 0 : code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
    static const unsigned char LEAD[] = {0, 0xc0, 0xe0, 0xf0};
    text[0] = (char)(LEAD[more] | code >> (6 * more));
    for (unsigned i = 1; i <= more; i++)
        text[i] = (char)(0x80 | (code >> (6 * (more - i)) & 0x3f));
    return more + 1;
}

captain_status json_take_string(json *from, json_string *string, const char *expected)
{
    TRY(json_expect(from, '"', expected));
    const char *at = from->next;
    *string = (json_string){at, at, 0};
    captain_utf8 utf8 = {0};
    while (at < from->end && *at != '"') {
        uint32_t code;
        char text[4];
        from->next = at;
        if (*at == '\\' && utf8.left == 0) {
            at++;
            if (!take_escape(&at, from->end, &code))
                return json_refuse_found(from, CAPTAIN_SYNTAX, "an escape of JSON");
            string->octets += put_utf8(code, text);
        } else {
            if ((unsigned char)*at < 32 || !captain_utf8_feed(&utf8, (uint8_t)*at++))
                return json_refuse_found(from, CAPTAIN_SYNTAX, "a character of JSON in UTF-8");
            string->octets++;
        }
    }
    from->next = string->until = at;
    if (at == from->end || utf8.left > 0)
        return json_refuse_found(from, CAPTAIN_SYNTAX, "the end of a string");
    from->next++;
    return CAPTAIN_OK;
}

void json_copy(const json_string *string, char *text)
{
    const char *at = string->from;
    for (size_t i = 0; i < string->octets;) {
        uint32_t code;
        if (*at != '\\') {
            text[i++] = *at++;
            continue;
        }
        at++;
        take_escape(&at, string->until, &code);
        i += put_utf8(code, text + i);
    }
}

captain_status json_name(json *from, char name[JSON_MAX_NAME])
{
    json_string string;
    TRY(json_take_string(from, &string, "the name of a component"));
    char cut[JSON_MAX_NAME + 4];
    if (string.octets >= JSON_MAX_NAME) { /* of no component: shown in the sentence */
        json_string head = string;
        head.octets = JSON_MAX_NAME - 4;
        json_copy(&head, cut);
        memcpy(cut + JSON_MAX_NAME - 4, "...", 4);
        memcpy(name, cut, JSON_MAX_NAME);
    } else {
        json_copy(&string, name);
        name[string.octets] = 0;
        if (memchr(name, 0, string.octets) != NULL)
            return json_refuse(from, CAPTAIN_SYNTAX, "a name holds no character 0");
    }
    return json_expect(from, ':', "a colon");
}

const char *json_show(const char *name, char shown[JSON_MAX_NAME])
{
    size_t i = 0;
    for (; i < JSON_MAX_NAME - 1 && name[i] != 0; i++)
        shown[i] = name[i] < 32 || name[i] > 126 ? '?' : name[i];
    shown[i] = 0;
    return shown;
}

/* ---------------------------------------------------------------- numbers (RFC 8259 clause 6) */

typedef struct number_text {
    const char *digits, *point, *end; /* of the mantissa; point: where its fraction begins, or end */
    int exponent;                     /* cut at +-100000 */
    bool is_negative;
} number_text;

static const char *digits_end(const json *from, const char *at)
{
    while (at < from->end && *at >= '0' && *at <= '9')
        at++;
    return at;
}

static bool scan_exponent(const json *from, const char **at, int *exponent)
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
        *exponent = *exponent < 100000 ? *exponent * 10 + (**at - '0') : *exponent;
    *exponent = is_negative ? -*exponent : *exponent;
    return true;
}

static bool scan_number(json *from, number_text *number)
{
    json_blanks(from);
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

/* The magnitude; false in is_whole or is_small where it has a fraction or more than 64 bits. */
static uint64_t magnitude(const number_text *number, bool *is_whole, bool *is_small)
{
    uint64_t result = 0;
    int64_t left = (number->point - number->digits) + (int64_t)number->exponent; /* digits before the point */
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

captain_status json_integer(json *from, bool is_unsigned64, int64_t *number)
{
    number_text text;
    bool is_whole, is_small;
    const char *before = from->next;
    if (!scan_number(from, &text))
        return json_refuse_found(from, CAPTAIN_SYNTAX, "a number");
    uint64_t value = magnitude(&text, &is_whole, &is_small);
    *number = (int64_t)(text.is_negative ? 0 - value : value);
    uint64_t most = is_unsigned64 ? (text.is_negative ? 0 : UINT64_MAX) : (uint64_t)INT64_MAX + text.is_negative;
    const char *after = from->next;
    if (!is_whole)
        from->next = before;
    if (!is_whole)
        return json_refuse_found(from, CAPTAIN_SYNTAX, "a whole number");
    if (!is_small || value > most) {
        char shown[48];
        from->next = before;
        found(from, shown);
        size_t length = (size_t)(after - from->next);
        if (length < sizeof shown - 8)
            shown[length] = 0;
        return captain_walk_refuse(from->report, &from->path, 0, CAPTAIN_RANGE, "%s does not fit into 64 bits", shown);
    }
    return CAPTAIN_OK;
}

/* ---------------------------------------------------------------- objects and arrays */

captain_status json_open(json *from, char bracket, const char *expected, bool *is_more)
{
    TRY(json_expect(from, bracket, expected));
    *is_more = !json_take(from, bracket == '{' ? '}' : ']');
    return CAPTAIN_OK;
}

captain_status json_more(json *from, char bracket, bool *is_more)
{
    *is_more = json_take(from, ',');
    if (*is_more)
        return CAPTAIN_OK;
    return bracket == '{' ? json_expect(from, '}', "a comma or }") : json_expect(from, ']', "a comma or ]");
}

static captain_status skip_members(json *from, char bracket)
{
    bool is_more;
    json_string name;
    TRY(json_open(from, bracket, "a value", &is_more));
    while (is_more) {
        if (bracket == '{') {
            TRY(json_take_string(from, &name, "the name of a component"));
            TRY(json_expect(from, ':', "a colon"));
        }
        TRY(json_skip(from));
        TRY(json_more(from, bracket, &is_more));
    }
    return CAPTAIN_OK;
}

captain_status json_skip(json *from)
{
    bool is_there = false;
    json_string string;
    number_text number;
    static const char *const WORDS[] = {"true", "false", "null"};
    if (from->depth >= CAPTAIN_WALK_DEPTH)
        return json_refuse(from, CAPTAIN_DEPTH, "nested too deeply");
    if (json_is(from, '{') || json_is(from, '[')) {
        from->depth++;
        TRY(skip_members(from, *from->next));
        from->depth--;
        return CAPTAIN_OK;
    }
    if (json_is(from, '"'))
        return json_take_string(from, &string, "a value");
    for (unsigned i = 0; i < 3 && !is_there; i++)
        json_word(from, WORDS[i], &is_there);
    return is_there || scan_number(from, &number) ? CAPTAIN_OK : json_refuse_found(from, CAPTAIN_SYNTAX, "a value");
}

/* Scanner of JSON: blanks, strings, skipped values. */
#include "json.h"

#include <string.h>

void captain_json_blanks(json *from)
{
    while (from->next < from->end && (*from->next == ' ' || *from->next == '\t' || *from->next == '\n' || *from->next == '\r'))
        from->next++;
}

bool captain_json_is(json *from, char character)
{
    captain_json_blanks(from);
    return from->next < from->end && *from->next == character;
}

bool captain_json_take(json *from, char character)
{
    bool is_there = captain_json_is(from, character);
    from->next += is_there;
    return is_there;
}

/* ---------------------------------------------------------------- refusals */

captain_status captain_json_refuse(json *from, captain_status status, const char *text)
{
    return captain_walk_refuse(from->report, &from->path, 0, status, "%s", text);
}

const char *captain_json_found(json *from, char text[JSON_FOUND])
{
    captain_json_blanks(from);
    size_t left = (size_t)(from->end - from->next), count = left < 40 ? left : 40;
    if (left == 0)
        return "the end";
    for (size_t i = 0; i < count; i++)
        text[i] = from->next[i] < 32 || from->next[i] > 126 ? '?' : from->next[i];
    memcpy(text + count, count < left ? "..." : "", count < left ? 4 : 1);
    return text;
}

captain_status captain_json_refuse_found(json *from, captain_status status, const char *expected)
{
    char text[JSON_FOUND];
    if (from->report == NULL)
        return status;
    const char *what = captain_json_found(from, text);
    return captain_walk_refuse(from->report, &from->path, 0, status, "%s is expected at offset %zu, found: %s", expected,
                               (size_t)(from->next - from->start), what);
}

captain_status captain_json_expect(json *from, char character, const char *what)
{
    return captain_json_take(from, character) ? CAPTAIN_OK : captain_json_refuse_found(from, CAPTAIN_SYNTAX, what);
}

bool captain_json_word(json *from, const char *word)
{
    size_t length = strlen(word);
    captain_json_blanks(from);
    bool is_there = (size_t)(from->end - from->next) >= length && memcmp(from->next, word, length) == 0;
    from->next += is_there ? length : 0;
    return is_there;
}

/* ---------------------------------------------------------------- strings */

int captain_json_hex(char character)
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
        int digit = *at < end ? captain_json_hex(**at) : -1;
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
        return false; /* unpaired surrogate */
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

captain_status captain_json_take_string(json *from, json_string *string, const char *expected)
{
    TRY(captain_json_expect(from, '"', expected));
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
                return captain_json_refuse_found(from, CAPTAIN_SYNTAX, "an escape of JSON");
            string->octets += put_utf8(code, text);
        } else {
            if ((unsigned char)*at < 32 || !captain_utf8_feed(&utf8, (uint8_t)*at++))
                return captain_json_refuse_found(from, CAPTAIN_SYNTAX, "a character of JSON in UTF-8");
            string->octets++;
        }
    }
    from->next = string->until = at;
    if (at == from->end || utf8.left > 0)
        return captain_json_refuse_found(from, CAPTAIN_SYNTAX, "the end of a string");
    from->next++;
    return CAPTAIN_OK;
}

void captain_json_copy(const json_string *string, char *text)
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

void captain_json_copy_name(const json_string *string, char name[JSON_MAX_NAME])
{
    bool is_short = string->octets < JSON_MAX_NAME;
    if (is_short)
        captain_json_copy(string, name);
    name[is_short ? string->octets : 0] = 0;
}

captain_status captain_json_name(json *from, char name[JSON_MAX_NAME])
{
    json_string string;
    TRY(captain_json_take_string(from, &string, "the name of a component"));
    char cut[JSON_MAX_NAME + 4];
    if (string.octets >= JSON_MAX_NAME) { /* longer than any component's name: shown in the sentence */
        json_string head = string;
        head.octets = JSON_MAX_NAME - 4;
        captain_json_copy(&head, cut);
        memcpy(cut + JSON_MAX_NAME - 4, "...", 4);
        memcpy(name, cut, JSON_MAX_NAME);
    } else {
        captain_json_copy(&string, name);
        name[string.octets] = 0;
        if (memchr(name, 0, string.octets) != NULL)
            return captain_json_refuse(from, CAPTAIN_SYNTAX, "a name holds no character 0");
    }
    return captain_json_expect(from, ':', "a colon");
}

const char *captain_json_show(const char *name, char shown[JSON_MAX_NAME])
{
    size_t i = 0;
    for (; i < JSON_MAX_NAME - 1 && name[i] != 0; i++)
        shown[i] = name[i] < 32 || name[i] > 126 ? '?' : name[i];
    shown[i] = 0;
    return shown;
}

/* ---------------------------------------------------------------- objects and arrays */

captain_status captain_json_open(json *from, char bracket, const char *expected, bool *is_more)
{
    TRY(captain_json_expect(from, bracket, expected));
    *is_more = !captain_json_take(from, bracket == '{' ? '}' : ']');
    return CAPTAIN_OK;
}

captain_status captain_json_more(json *from, char bracket, bool *is_more)
{
    *is_more = captain_json_take(from, ',');
    if (*is_more)
        return CAPTAIN_OK;
    return bracket == '{' ? captain_json_expect(from, '}', "a comma or }") : captain_json_expect(from, ']', "a comma or ]");
}

static captain_status skip_members(json *from, char bracket)
{
    bool is_more;
    json_string name;
    TRY(captain_json_open(from, bracket, "a value", &is_more));
    while (is_more) {
        if (bracket == '{') {
            TRY(captain_json_take_string(from, &name, "the name of a component"));
            TRY(captain_json_expect(from, ':', "a colon"));
        }
        TRY(captain_json_skip(from));
        TRY(captain_json_more(from, bracket, &is_more));
    }
    return CAPTAIN_OK;
}

captain_status captain_json_skip(json *from)
{
    bool is_there = false;
    json_string string;
    static const char *const WORDS[] = {"true", "false", "null"};
    if (from->depth >= CAPTAIN_WALK_DEPTH)
        return captain_json_refuse(from, CAPTAIN_DEPTH, "nested too deeply");
    if (captain_json_is(from, '{') || captain_json_is(from, '[')) {
        from->depth++;
        TRY(skip_members(from, *from->next));
        from->depth--;
        return CAPTAIN_OK;
    }
    if (captain_json_is(from, '"'))
        return captain_json_take_string(from, &string, "a value");
    for (unsigned i = 0; i < 3 && !is_there; i++)
        is_there = captain_json_word(from, WORDS[i]);
    return is_there || captain_json_skip_number(from) ? CAPTAIN_OK : captain_json_refuse_found(from, CAPTAIN_SYNTAX, "a value");
}

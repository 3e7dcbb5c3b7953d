/* Values from JSON: the shapes of X.697 that captain_json_write writes. */
#include "json.h"

#include <stdio.h>
#include <string.h>

captain_status json_take_memory(json *from, size_t octets, void **memory)
{
    *memory = captain_arena_take(from->arena, octets);
    return *memory != NULL ? CAPTAIN_OK : json_refuse(from, CAPTAIN_NO_MEMORY, "the memory for the message is used up");
}

int64_t json_bracket(const char *name)
{
    int64_t number = 0;
    if (*name++ != '[' || *name == ']')
        return -1;
    for (; *name >= '0' && *name <= '9'; name++) {
        number = number * 10 + (*name - '0');
        if (number >= CAPTAIN_UNKNOWN)
            return -1;
    }
    return name[0] == ']' && name[1] == 0 ? number : -1;
}

/* ---------------------------------------------------------------- BOOLEAN, NULL, INTEGER, ENUMERATED */

static captain_status read_boolean(json *from, bool *value)
{
    bool is_false;
    TRY(json_word(from, "true", value));
    if (*value)
        return CAPTAIN_OK;
    TRY(json_word(from, "false", &is_false));
    return is_false ? CAPTAIN_OK : json_refuse_found(from, CAPTAIN_SYNTAX, "true or false");
}

static captain_status read_null(json *from, bool *value)
{
    bool is_there;
    *value = false;
    TRY(json_word(from, "null", &is_there));
    return is_there ? CAPTAIN_OK : json_refuse_found(from, CAPTAIN_SYNTAX, "null");
}

static captain_status read_integer(json *from, const captain_type *type, void *value)
{
    int64_t number;
    TRY(json_integer(from, captain_walk_is_unsigned64(type), &number));
    TRY(captain_check_number(type, number, from->report, &from->path));
    captain_walk_set_number(type, value, number);
    return CAPTAIN_OK;
}

static captain_status read_item(json *from, const captain_type *type, void *value)
{
    json_string string;
    char name[JSON_MAX_NAME] = "", shown[JSON_MAX_NAME], text[256];
    TRY(json_take_string(from, &string, "the name of an item in quotes"));
    if (string.octets < sizeof name)
        json_copy(&string, name);
    name[string.octets < sizeof name ? string.octets : 0] = 0;
    for (unsigned i = 0; i < type->names_count; i++) {
        if (strlen(type->names[i].name) != string.octets || strcmp(type->names[i].name, name) != 0)
            continue;
        captain_walk_set_number(type, value, type->names[i].value);
        return CAPTAIN_OK;
    }
    int64_t index = json_bracket(name);
    if (index >= type->names_count - type->root_count && (type->flags & CAPTAIN_EXTENSIBLE)) {
        captain_walk_set_number(type, value, CAPTAIN_UNKNOWN + index);
        return CAPTAIN_OK;
    }
    const char *near = from->report == NULL ? NULL : captain_walk_nearest(name, type->names, sizeof *type->names, type->names_count);
    snprintf(text, sizeof text, "%.60s is no item of %.60s%s%.60s%s", json_show(name, shown), captain_type_text(type),
             near != NULL ? "; did you mean " : "", near != NULL ? near : "", near != NULL ? "?" : "");
    return json_refuse(from, CAPTAIN_ALTERNATIVE, text);
}

/* ---------------------------------------------------------------- hexadecimal text */

static int hex_digit(char character)
{
    if (character >= '0' && character <= '9')
        return character - '0';
    if (character >= 'a' && character <= 'f')
        return character - 'a' + 10;
    return character >= 'A' && character <= 'F' ? character - 'A' + 10 : -1;
}

/* A string that is looked through: only digits, an even number of them, none written as an escape. */
static captain_status take_hex(json *from, json_string *string, size_t *octets)
{
    json_blanks(from);
    const char *before = from->next;
    TRY(json_take_string(from, string, "hexadecimal text in quotes"));
    bool is_hex = string->octets % 2 == 0;
    for (size_t i = 0; is_hex && i < string->octets; i++)
        is_hex = hex_digit(string->from[i]) >= 0;
    *octets = string->octets / 2;
    if (is_hex)
        return CAPTAIN_OK;
    from->next = before;
    return json_refuse_found(from, CAPTAIN_SYNTAX, "hexadecimal text, two digits an octet,");
}

static void copy_hex(const json_string *string, uint8_t *octets)
{
    for (size_t i = 0; i < string->octets / 2; i++)
        octets[i] = (uint8_t)(hex_digit(string->from[2 * i]) << 4 | hex_digit(string->from[2 * i + 1]));
}

static captain_status store_hex(json *from, const json_string *string, captain_octets *octets)
{
    void *memory = NULL;
    size_t count = string->octets / 2;
    if (count > UINT32_MAX)
        return json_refuse(from, CAPTAIN_SIZE, "a string has at most 4294967295 octets");
    if (count > 0)
        TRY(json_take_memory(from, count, &memory));
    copy_hex(string, memory);
    *octets = (captain_octets){(uint32_t)count, memory};
    return CAPTAIN_OK;
}

captain_status json_octets(json *from, captain_octets *octets)
{
    json_string string;
    size_t count;
    TRY(take_hex(from, &string, &count));
    return store_hex(from, &string, octets);
}

static captain_status read_octets(json *from, const captain_type *type, void *value)
{
    json_string string;
    size_t count;
    TRY(take_hex(from, &string, &count));
    TRY(captain_check_size(type, count, from->report, &from->path));
    if (type->kind == CAPTAIN_FIXED_OCTETS) {
        copy_hex(&string, value);
        return CAPTAIN_OK;
    }
    captain_octets octets;
    TRY(store_hex(from, &string, &octets));
    memcpy(value, &octets, sizeof octets);
    return CAPTAIN_OK;
}

/* ---------------------------------------------------------------- BIT STRING */

/* {"value": hex, "length": bits}, in either order. */
static captain_status take_bits(json *from, json_string *string, size_t *octets, int64_t *bits)
{
    bool is_more, has_value = false;
    char name[JSON_MAX_NAME];
    *bits = -1;
    TRY(json_open(from, '{', "an object with value and length", &is_more));
    while (is_more) {
        TRY(json_name(from, name));
        bool is_value = strcmp(name, "value") == 0, is_length = strcmp(name, "length") == 0;
        if (!is_value && !is_length)
            return json_refuse(from, CAPTAIN_SYNTAX, "a bit string has only the members value and length");
        if (is_value ? has_value : *bits >= 0)
            return json_refuse(from, CAPTAIN_SYNTAX, "a member of the bit string is there twice");
        if (is_value)
            TRY(take_hex(from, string, octets));
        else
            TRY(json_integer(from, false, bits));
        has_value |= is_value;
        if (*bits < -1 || (is_length && *bits < 0) || *bits > UINT32_MAX)
            return json_refuse(from, CAPTAIN_RANGE, "the length of a bit string is in 0..4294967295");
        TRY(json_more(from, '{', &is_more));
    }
    return has_value && *bits >= 0 ? CAPTAIN_OK : json_refuse(from, CAPTAIN_PRESENCE, "a bit string has the members value and length");
}

static captain_status read_bits(json *from, const captain_type *type, void *value)
{
    json_string string;
    size_t octets = 0;
    int64_t bits = type->high;
    bool is_fixed = type->kind == CAPTAIN_SMALL_BITS
                    || (!(type->flags & (CAPTAIN_EXTENSIBLE | CAPTAIN_UNBOUNDED_HIGH)) && type->low == type->high);
    if (is_fixed)
        TRY(take_hex(from, &string, &octets));
    else
        TRY(take_bits(from, &string, &octets, &bits));
    TRY(captain_check_size(type, (uint64_t)bits, from->report, &from->path));
    if (octets != ((uint64_t)bits + 7) / 8) {
        char text[96];
        snprintf(text, sizeof text, "%lld bits take %lld octets, %zu are there", (long long)bits, (long long)(bits + 7) / 8, octets);
        return json_refuse(from, CAPTAIN_SIZE, text);
    }
    unsigned unused = (unsigned)(octets * 8 - (uint64_t)bits);
    if (octets > 0 && hex_digit(string.from[2 * octets - 1]) & ((1 << (unused < 4 ? unused : 4)) - 1))
        return json_refuse(from, CAPTAIN_SIZE, "bits behind the end of the string are not zero");
    if (unused > 4 && hex_digit(string.from[2 * octets - 2]) & ((1 << (unused - 4)) - 1))
        return json_refuse(from, CAPTAIN_SIZE, "bits behind the end of the string are not zero");
    if (type->kind == CAPTAIN_SMALL_BITS) {
        uint8_t memory[8] = {0};
        uint64_t number = 0;
        copy_hex(&string, memory);
        for (size_t i = 0; i < octets; i++)
            number = number << 8 | memory[i];
        captain_walk_set_number(type, value, (int64_t)(number >> unused));
        return CAPTAIN_OK;
    }
    captain_octets stored;
    TRY(store_hex(from, &string, &stored));
    *(captain_bits *)value = (captain_bits){(uint32_t)bits, stored.octets};
    return CAPTAIN_OK;
}

/* ---------------------------------------------------------------- character strings */

/* Text of the arena with a 0 behind it. */
static captain_status take_text(json *from, captain_text *text, const char *expected)
{
    json_string string;
    void *memory;
    TRY(json_take_string(from, &string, expected));
    if (string.octets > UINT32_MAX)
        return json_refuse(from, CAPTAIN_SIZE, "a string has at most 4294967295 octets");
    TRY(json_take_memory(from, string.octets + 1, &memory));
    json_copy(&string, memory);
    ((char *)memory)[string.octets] = 0;
    *text = (captain_text){(uint32_t)string.octets, memory};
    return CAPTAIN_OK;
}

static captain_status read_text(json *from, const captain_type *type, captain_text *value)
{
    TRY(take_text(from, value, "text in quotes"));
    if (type->kind != CAPTAIN_UTF8) /* the encoding does not see its size (30.6) */
        TRY(captain_check_size(type, value->count, from->report, &from->path));
    bool in_root = captain_walk_in_size(type, value->count);
    return captain_check_text(type, in_root, value->text, value->count, from->report, &from->path);
}

/* ---------------------------------------------------------------- object identifiers (X.690 8.19, 8.20) */

static bool take_arc(const char **at, uint64_t *arc)
{
    const char *start = *at;
    for (*arc = 0; **at >= '0' && **at <= '9'; ++*at) {
        unsigned digit = (unsigned)(**at - '0');
        if (*arc > (UINT64_MAX - digit) / 10)
            return false;
        *arc = *arc * 10 + digit;
    }
    return *at > start && (*start != '0' || *at == start + 1);
}

/* Seven bits an octet, at most ten of them. */
static uint8_t *put_arc(uint8_t *to, uint64_t arc)
{
    unsigned more = 0;
    while (more < 9 && arc >> (7 * (more + 1)) != 0)
        more++;
    for (;; more--) {
        *to++ = (uint8_t)((arc >> (7 * more) & 0x7f) | (more > 0 ? 0x80 : 0));
        if (more == 0)
            return to;
    }
}

/* `to` has room for the text: an arc takes no more octets than digits and its point. Gives the octets, 0 where it is none. */
static size_t arcs_to_octets(const char *at, bool is_relative, uint8_t *to)
{
    uint8_t *start = to;
    uint64_t arc, second;
    if (!is_relative) {
        if (!take_arc(&at, &arc) || arc > 2 || *at++ != '.' || !take_arc(&at, &second) || (arc < 2 && second > 39)
            || second > UINT64_MAX - 80)
            return 0;
        to = put_arc(to, 40 * arc + second);
        if (*at == 0)
            return (size_t)(to - start);
        if (*at++ != '.')
            return 0;
    }
    for (;;) {
        if (!take_arc(&at, &arc))
            return 0;
        to = put_arc(to, arc);
        if (*at == 0)
            return (size_t)(to - start);
        if (*at++ != '.')
            return 0;
    }
}

/* "[2a8648]": octets that are no readable identifier. */
static size_t brackets_to_octets(const captain_text *text, uint8_t *to)
{
    size_t digits = text->count - 2, count = digits / 2;
    if (text->text[text->count - 1] != ']' || digits % 2 != 0)
        return SIZE_MAX;
    for (size_t i = 0; i < digits; i++)
        if (hex_digit(text->text[1 + i]) < 0)
            return SIZE_MAX;
    json_string string = {text->text + 1, text->text + 1 + digits, digits};
    copy_hex(&string, to);
    return count;
}

static captain_status read_oid(json *from, const captain_type *type, void *value)
{
    captain_text text;
    void *memory;
    TRY(take_text(from, &text, "an object identifier in quotes"));
    TRY(json_take_memory(from, text.count + 2u, &memory));
    size_t count = 0;
    if (text.count >= 2 && text.text[0] == '[')
        count = brackets_to_octets(&text, memory);
    else if (strlen(text.text) == text.count)
        count = arcs_to_octets(text.text, type->kind == CAPTAIN_RELATIVE_OID, memory);
    if (count == SIZE_MAX || (count == 0 && text.text[0] != '['))
        return json_refuse(from, CAPTAIN_SYNTAX, "numbers with points between them are expected, as 1.2.840");
    captain_octets octets = {(uint32_t)count, memory};
    memcpy(value, &octets, sizeof octets);
    return CAPTAIN_OK;
}

/* ---------------------------------------------------------------- SEQUENCE OF */

/* How many elements there are, before memory is taken for them. */
static captain_status count_elements(json *from, uint64_t *count)
{
    const json before = *from;
    bool is_more;
    TRY(json_open(from, '[', "a list", &is_more));
    for (*count = 0; is_more; ++*count) {
        TRY(json_skip(from));
        TRY(json_more(from, '[', &is_more));
    }
    from->next = before.next;
    return CAPTAIN_OK;
}

static captain_status read_list(json *from, const captain_type *type, void *value)
{
    uint64_t count;
    bool is_more;
    captain_list list = {0, NULL};
    TRY(count_elements(from, &count));
    TRY(captain_check_size(type, count, from->report, &from->path));
    if (count > UINT32_MAX || count > (SIZE_MAX - 64) / type->element->size)
        return json_refuse(from, CAPTAIN_SIZE, "a list has at most 4294967295 elements");
    if (count > 0)
        TRY(json_take_memory(from, (size_t)count * type->element->size, &list.items));
    TRY(json_open(from, '[', "a list", &is_more));
    for (; is_more && list.count < count; list.count++) {
        size_t path = captain_path_push_index(&from->path, list.count);
        TRY(json_value(from, type->element, (char *)list.items + (size_t)list.count * type->element->size));
        captain_path_pop(&from->path, path);
        TRY(json_more(from, '[', &is_more));
    }
    memcpy(value, &list, sizeof list);
    return CAPTAIN_OK;
}

/* ---------------------------------------------------------------- any type */

static captain_status read_container(json *from, const captain_type *type, void *value)
{
    switch (type->kind) {
    case CAPTAIN_SEQUENCE: return json_sequence(from, type, value);
    case CAPTAIN_CHOICE: return json_choice(from, type, value);
    default: return read_list(from, type, value);
    }
}

captain_status json_value(json *from, const captain_type *type, void *value)
{
    switch (type->kind) {
    case CAPTAIN_BOOLEAN: return read_boolean(from, value);
    case CAPTAIN_NULL: return read_null(from, value);
    case CAPTAIN_INTEGER: return read_integer(from, type, value);
    case CAPTAIN_ENUMERATED: return read_item(from, type, value);
    case CAPTAIN_SMALL_BITS:
    case CAPTAIN_BIT_STRING: return read_bits(from, type, value);
    case CAPTAIN_FIXED_OCTETS:
    case CAPTAIN_OCTET_STRING: return read_octets(from, type, value);
    case CAPTAIN_OID:
    case CAPTAIN_RELATIVE_OID: return read_oid(from, type, value);
    case CAPTAIN_SEQUENCE:
    case CAPTAIN_CHOICE:
    case CAPTAIN_LIST: break;
    default: return read_text(from, type, value);
    }
    if (from->depth == CAPTAIN_WALK_DEPTH)
        return json_refuse(from, CAPTAIN_DEPTH, "nested too deeply");
    from->depth++;
    TRY(read_container(from, type, value));
    from->depth--;
    return CAPTAIN_OK;
}

captain_status captain_json_read(const captain_type *type, void *value, const char *text, size_t octets, captain_arena *arena, captain_report *report)
{
    json from = {.start = text, .next = text, .end = text + octets, .arena = arena, .report = report};
    captain_report_clear(report);
    TRY(json_value(&from, type, value));
    json_blanks(&from);
    return from.next == from.end ? CAPTAIN_OK : json_refuse_found(&from, CAPTAIN_SYNTAX, "the end of the text");
}

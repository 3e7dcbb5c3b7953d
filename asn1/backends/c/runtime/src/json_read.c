/* Values from JSON, in the form that captain_json_write writes (X.697). */
#include "json.h"

#include <stdio.h>
#include <string.h>

captain_status captain_json_take_memory(json *from, size_t octets, void **memory)
{
    *memory = captain_arena_take(from->arena, octets);
    return *memory != NULL ? CAPTAIN_OK : captain_json_refuse(from, CAPTAIN_NO_MEMORY, "the memory for the message is used up");
}

int64_t captain_json_bracket(const char *name)
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
    *value = captain_json_word(from, "true");
    if (*value || captain_json_word(from, "false"))
        return CAPTAIN_OK;
    return captain_json_refuse_found(from, CAPTAIN_SYNTAX, "true or false");
}

static captain_status read_null(json *from, bool *value)
{
    *value = false;
    return captain_json_word(from, "null") ? CAPTAIN_OK : captain_json_refuse_found(from, CAPTAIN_SYNTAX, "null");
}

static captain_status read_integer(json *from, const captain_type *type, void *value)
{
    int64_t number;
    const char *unit = from->unit != NULL ? from->unit : type->unit;
    if (from->is_plain && (unit != NULL || captain_json_is(from, '"')))
        return captain_json_read_plain_integer(from, type, unit, value);
    TRY(captain_json_integer(from, captain_walk_is_unsigned64(type), &number));
    TRY(captain_check_number(type, number, from->report, &from->path));
    captain_walk_set_number(type, value, number);
    return CAPTAIN_OK;
}

static captain_status read_item(json *from, const captain_type *type, void *value)
{
    json_string string;
    char name[JSON_MAX_NAME], shown[JSON_MAX_NAME], text[256];
    TRY(captain_json_take_string(from, &string, "the name of an item in quotes"));
    captain_json_copy_name(&string, name);
    for (unsigned i = 0; i < type->names_count; i++) {
        if (strlen(type->names[i].name) != string.octets || strcmp(type->names[i].name, name) != 0)
            continue;
        captain_walk_set_number(type, value, type->names[i].value);
        return CAPTAIN_OK;
    }
    int64_t index = captain_json_bracket(name);
    if (index >= type->names_count - type->root_count && (type->flags & CAPTAIN_EXTENSIBLE)) {
        captain_walk_set_number(type, value, CAPTAIN_UNKNOWN + index);
        return CAPTAIN_OK;
    }
    const char *near = NULL;
    if (from->report != NULL)
        near = captain_walk_nearest(name, type->names, sizeof *type->names, type->names_count);
    snprintf(text, sizeof text, "%.60s is no item of %.60s%s%.60s%s", captain_json_show(name, shown), captain_type_text(type),
             near != NULL ? "; did you mean " : "", near != NULL ? near : "", near != NULL ? "?" : "");
    return captain_json_refuse(from, CAPTAIN_ALTERNATIVE, text);
}

/* ---------------------------------------------------------------- SEQUENCE OF */

/* Count the elements, before memory is allocated for them. */
static captain_status count_elements(json *from, uint64_t *count)
{
    const json before = *from;
    bool is_more;
    TRY(captain_json_open(from, '[', "a list", &is_more));
    for (*count = 0; is_more; ++*count) {
        TRY(captain_json_skip(from));
        TRY(captain_json_more(from, '[', &is_more));
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
        return captain_json_refuse(from, CAPTAIN_SIZE, "a list has at most 4294967295 elements");
    if (count > 0)
        TRY(captain_json_take_memory(from, (size_t)count * type->element->size, &list.items));
    TRY(captain_json_open(from, '[', "a list", &is_more));
    for (; is_more && list.count < count; list.count++) {
        size_t path = captain_path_push_index(&from->path, list.count);
        from->unit = NULL;
        TRY(captain_json_value(from, type->element, (char *)list.items + (size_t)list.count * type->element->size));
        captain_path_pop(&from->path, path);
        TRY(captain_json_more(from, '[', &is_more));
    }
    memcpy(value, &list, sizeof list);
    return CAPTAIN_OK;
}

/* ---------------------------------------------------------------- any type */

static captain_status read_container(json *from, const captain_type *type, void *value)
{
    switch (type->kind) {
    case CAPTAIN_SEQUENCE: return captain_json_sequence(from, type, value);
    case CAPTAIN_CHOICE: return captain_json_choice(from, type, value);
    default: return read_list(from, type, value);
    }
}

captain_status captain_json_value(json *from, const captain_type *type, void *value)
{
    switch (type->kind) {
    case CAPTAIN_BOOLEAN: return read_boolean(from, value);
    case CAPTAIN_NULL: return read_null(from, value);
    case CAPTAIN_INTEGER: return read_integer(from, type, value);
    case CAPTAIN_ENUMERATED: return read_item(from, type, value);
    case CAPTAIN_SMALL_BITS:
    case CAPTAIN_BIT_STRING:
        return from->is_plain && (type->flags & CAPTAIN_NAMED_BITS) ? captain_json_read_named_bits(from, type, value)
                                                                    : captain_json_read_bits(from, type, value);
    case CAPTAIN_FIXED_OCTETS:
    case CAPTAIN_OCTET_STRING: return captain_json_read_octets(from, type, value);
    case CAPTAIN_OID:
    case CAPTAIN_RELATIVE_OID: return captain_json_read_oid(from, type, value);
    case CAPTAIN_SEQUENCE:
    case CAPTAIN_CHOICE:
    case CAPTAIN_LIST: break;
    default: return captain_json_read_text(from, type, value);
    }
    unsigned again = type->flags & CAPTAIN_RECURS ? 1 : 0;
    if (from->depth == CAPTAIN_WALK_DEPTH || from->recursion + again > CAPTAIN_WALK_RECURSION)
        return captain_json_refuse(from, CAPTAIN_DEPTH, "nested too deeply");
    from->depth++;
    from->recursion += again;
    TRY(read_container(from, type, value));
    from->recursion -= again;
    from->depth--;
    return CAPTAIN_OK;
}

static captain_status read_whole(json *from, const captain_type *type, void *value)
{
    captain_report_clear(from->report);
    TRY(captain_json_value(from, type, value));
    captain_json_blanks(from);
    return from->next == from->end ? CAPTAIN_OK : captain_json_refuse_found(from, CAPTAIN_SYNTAX, "the end of the text");
}

captain_status captain_json_read(const captain_type *type, void *value, const char *text, size_t octets, captain_arena *arena,
                                 captain_report *report)
{
    json from = {.start = text, .next = text, .end = text + octets, .arena = arena, .report = report};
    return read_whole(&from, type, value);
}

captain_status captain_json_read_plain(const captain_type *type, void *value, const char *text, size_t octets,
                                       captain_arena *arena, captain_report *report)
{
    json from = {.start = text, .next = text, .end = text + octets, .arena = arena, .report = report, .is_plain = true};
    return read_whole(&from, type, value);
}

/* Setting of a value by text: plain JSON in which quotes may be omitted, and names of numbers and alternatives. */
#include "json.h"
#include "set.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---------------------------------------------------------------- plain JSON */

/* Text around a value to make it JSON. */
typedef struct quotes {
    const char *before, *after;
} quotes;

static quotes quotes_of(const captain_type *type, const char *text)
{
    const quotes none = {"", ""}, string = {"\"", "\""}, bits = {"[\"", "\"]"};
    switch (type->kind) {
    case CAPTAIN_BOOLEAN:
    case CAPTAIN_NULL:
    case CAPTAIN_SEQUENCE:
    case CAPTAIN_CHOICE:
    case CAPTAIN_LIST: return none;
    case CAPTAIN_INTEGER: return text[0] == '-' || (text[0] >= '0' && text[0] <= '9') ? none : string;
    default: break;
    }
    if (type->flags & CAPTAIN_NAMED_BITS)
        return text[0] == '[' ? none : bits;
    return text[0] == '"' || text[0] == '{' ? none : string;
}

static captain_status set_json(setting *in, const captain_type *type, const char *unit, void *value)
{
    quotes around = quotes_of(type, in->text);
    size_t room = strlen(in->text) + 5;
    char *text = captain_arena_take(in->filling.arena, room);
    if (text == NULL)
        return CAPTAIN_NO_MEMORY;
    int octets = snprintf(text, room, "%s%s%s", around.before, in->text, around.after);
    json from = {.start = text, .next = text, .end = text + octets, .arena = in->filling.arena, .report = in->report,
                 .path = in->path, .is_plain = true, .unit = unit};
    TRY(captain_json_value(&from, type, value));
    captain_json_blanks(&from);
    return from.next == from.end ? CAPTAIN_OK : captain_json_refuse_found(&from, CAPTAIN_SYNTAX, "the end of the text");
}

/* ---------------------------------------------------------------- the others */

/* Set a number by any of its names, also one of an ordinary number: passengerCar. False without such a name. */
static bool set_named(const captain_type *type, const char *name, void *value)
{
    for (unsigned i = 0; i < type->names_count; i++) {
        if (strcmp(type->names[i].name, name) != 0 || !captain_walk_in_range(type, type->names[i].value))
            continue;
        captain_walk_set_number(type, value, type->names[i].value);
        return true;
    }
    return false;
}

static captain_status set_string(setting *in, const captain_type *type, void *value)
{
    size_t length = strlen(in->text);
    char *copy = length < UINT32_MAX ? captain_arena_take(in->filling.arena, length + 1) : NULL;
    if (copy == NULL)
        return CAPTAIN_NO_MEMORY;
    memcpy(copy, in->text, length + 1);
    captain_text text = {(uint32_t)length, copy};
    memcpy(value, &text, sizeof text);
    captain_status status = captain_explain_value(type, value, true, in->report);
    if (status != CAPTAIN_OK && in->report != NULL)
        memcpy(in->report->path, in->path.text, in->path.length + 1);
    return status;
}

static captain_status refuse_alternative(setting *in, const captain_type *type)
{
    const char *near = captain_walk_nearest(in->text, type->fields, sizeof *type->fields, type->fields_count);
    return captain_walk_refuse(in->report, &in->path, 0, CAPTAIN_PRESENCE, "%s has no alternative '%.60s'%s%s%s",
                               captain_type_text(type), in->text, near != NULL ? "; did you mean " : "",
                               near != NULL ? near : "", near != NULL ? "?" : "");
}

/* Choose an alternative by name or index. causeCode of Release 2 has one for each cause, in their order. */
static captain_status set_choice(setting *in, const captain_type *type, void *value)
{
    char *end;
    unsigned long index = strtoul(in->text, &end, 10);
    if (in->text[0] == '{')
        return set_json(in, type, NULL, value);
    if (end == in->text || *end != 0)
        for (index = 0; index < type->fields_count && strcmp(type->fields[index].name, in->text) != 0; index++)
            ;
    if (index >= type->fields_count)
        return refuse_alternative(in, type);
    *(uint32_t *)value = (uint32_t)index + 1;
    return captain_place_example(&type->fields[index], value, &in->filling);
}

captain_status captain_set_value(setting *in, const captain_type *type, const char *unit, void *value)
{
    if (type->kind == CAPTAIN_INTEGER && set_named(type, in->text, value))
        return CAPTAIN_OK;
    if (type->kind == CAPTAIN_CHOICE)
        return set_choice(in, type, value);
    return captain_walk_is_string(type) ? set_string(in, type, value) : set_json(in, type, unit, value);
}

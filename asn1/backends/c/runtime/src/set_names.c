/* Search of the paths that an unknown short name could mean, and the report of it. */
#include "set.h"

#include <stdio.h>
#include <string.h>

/* Number of paths in a report; the others are counted. */
enum { SHOWN = 3 };

/* Limits for the search: no type of a standard nests deeper, and MAPEM has 40,000 values. */
enum { DEEPEST = 40, MOST_VALUES = 200000 };

typedef struct search {
    const char *name;
    size_t length;
    captain_path path;
    unsigned count, values;
    size_t used;
    char text[sizeof(((captain_report *)0)->text) - 64];
} search;

static void look(search *in, const captain_type *type, bool is_named, unsigned depth);

/* Append two texts, if there is room for both. */
static void append(search *in, const char *first, const char *second)
{
    size_t room = sizeof in->text - in->used;
    int length = snprintf(in->text + in->used, room, "%s%s", first, second);
    if (length > 0 && (size_t)length < room)
        in->used += (size_t)length;
    in->text[in->used] = 0;
}

static void found(search *in)
{
    if (++in->count <= SHOWN)
        append(in, in->count > 1 ? ", " : "", in->path.text);
}

static void look_component(search *in, const captain_field *field, unsigned depth)
{
    size_t before = captain_path_push(&in->path, field->name);
    bool is_named = captain_is_name(field->name, in->name, in->length);
    if (field->type->kind == CAPTAIN_OPEN)
        for (unsigned i = 0; i < field->type->rows_count; i++)
            look(in, field->type->rows[i].type, false, depth + 1);
    else
        look(in, field->type, is_named, depth + 1);
    captain_path_pop(&in->path, before);
}

/* is_named: the last component of the path has the name. A SEQUENCE passes it to its first component: yawRate.yawRateValue. */
static void look(search *in, const captain_type *type, bool is_named, unsigned depth)
{
    if (depth > DEEPEST || in->values++ > MOST_VALUES || (type->flags & CAPTAIN_RECURS))
        return;
    bool is_container = type->kind == CAPTAIN_SEQUENCE || type->kind == CAPTAIN_CHOICE;
    if (is_named && !is_container && type->kind != CAPTAIN_LIST)
        found(in);
    for (unsigned i = 0; is_container && i < type->fields_count; i++) {
        bool is_first = is_named && i == 0 && type->fields[i].type->kind == CAPTAIN_INTEGER;
        if (is_first) {
            size_t before = captain_path_push(&in->path, type->fields[i].name);
            found(in);
            captain_path_pop(&in->path, before);
        } else {
            look_component(in, &type->fields[i], depth);
        }
    }
    if (type->kind == CAPTAIN_LIST) {
        size_t before = captain_path_push_index(&in->path, 0);
        look(in, type->element, false, depth + 1);
        captain_path_pop(&in->path, before);
    }
}

captain_status captain_set_unknown(setting *in, const captain_message *message, const char *name)
{
    search search = {.name = name, .length = strlen(name)};
    look(&search, message->pdu, false, 0);
    captain_path_push(&in->path, name);
    if (search.count > SHOWN)
        snprintf(search.text + search.used, sizeof search.text - search.used, " and %u more", search.count - SHOWN);
    if (search.count > 0)
        return captain_walk_refuse(in->report, &in->path, 0, CAPTAIN_PRESENCE, "is no short name of %s; write its path: %s",
                                   message->name, search.text);
    const char *near = captain_walk_nearest(name, message->short_names, sizeof *message->short_names, message->short_names_count);
    if (near != NULL)
        return captain_walk_refuse(in->report, &in->path, 0, CAPTAIN_PRESENCE, "is no name in %s; did you mean %s?", message->name, near);
    for (unsigned i = 0; i < message->short_names_count; i++)
        append(&search, i == 0 ? "; short names: " : ", ", message->short_names[i].name);
    return captain_walk_refuse(in->report, &in->path, 0, CAPTAIN_PRESENCE, "is no name in %s%s", message->name, search.text);
}

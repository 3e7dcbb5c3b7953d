/* Setting of a field by its short name or path; creates what is absent on the path. */
#include "set.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

static captain_status set_at(setting *in, const captain_type *type, const char *unit, void *value, const char *rest);

/* Return the number of characters of the component at the begin of a path. */
static size_t component(const char *path)
{
    return strcspn(path, ".[");
}

/* Return the path after a component. */
static const char *after(const char *path, size_t length)
{
    return path + length + (path[length] == '.');
}

bool captain_is_name(const char *found, const char *name, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        char left = found[i] == '-' ? '_' : found[i], right = name[i] == '-' ? '_' : name[i];
        if (tolower((unsigned char)left) != tolower((unsigned char)right))
            return false;
    }
    return found[length] == 0;
}

static const captain_field *find_field(const captain_type *type, const char *name, size_t length)
{
    for (unsigned i = 0; i < type->fields_count; i++)
        if (captain_is_name(type->fields[i].name, name, length))
            return &type->fields[i];
    return NULL;
}

static captain_status refuse_component(setting *in, const captain_type *type, const char *rest)
{
    int length = (int)(component(rest) < 60 ? component(rest) : 60);
    return captain_walk_refuse(in->report, &in->path, 0, CAPTAIN_PRESENCE, "%s has no component '%.*s'", captain_type_text(type),
                               length, rest);
}

/* ---------------------------------------------------------------- SEQUENCE */

/* Create an absent component. The members of an addition group come together. */
static captain_status create(setting *in, const captain_type *type, const captain_field *field, void *structure)
{
    for (unsigned i = 0; (field->flags & CAPTAIN_GROUP) && i < type->fields_count; i++) {
        const captain_field *other = &type->fields[i];
        bool is_needed = other->addition == field->addition && (other->flags & CAPTAIN_MANDATORY) && other != field;
        if (is_needed && !captain_walk_is_present(other, structure))
            TRY(captain_place_example(other, structure, &in->filling));
    }
    return captain_place_example(field, structure, &in->filling);
}

static bool has_component(const captain_type *type, const char *rest)
{
    return rest[0] == '[' ? type->kind == CAPTAIN_LIST : find_field(type, rest, component(rest)) != NULL;
}

/* Return the first row of an open type that has the next component of the path, or NULL. */
static const captain_row *row_with(const captain_type *open, const char *rest)
{
    for (unsigned i = 0; i < open->rows_count; i++)
        if (has_component(open->rows[i].type, rest))
            return &open->rows[i];
    return NULL;
}

/* Enter an open type; selects the first row that has the next component, unless the selected one has it. */
static captain_status set_open(setting *in, const captain_type *holder, const captain_field *field, char *structure, const char *rest)
{
    captain_open *open = (captain_open *)(void *)(structure + field->offset);
    if (open->type == NULL || !has_component(open->type, rest)) {
        const captain_row *row = row_with(field->type, rest);
        if (row == NULL)
            return refuse_component(in, field->type, rest);
        TRY(captain_place_row(holder, field, row, structure, &in->filling));
    }
    return set_at(in, open->type, NULL, open->value, rest);
}

/* After the identifier of open types was set, select their rows, with example values. */
static captain_status follow_selector(setting *in, const captain_type *type, const captain_field *selector, void *structure)
{
    for (unsigned i = 0; i < type->fields_count; i++) {
        const captain_field *field = &type->fields[i];
        bool is_selected = field->type->kind == CAPTAIN_OPEN && &type->fields[field->type->selector] == selector;
        if (!is_selected || !captain_walk_is_present(field, structure))
            continue;
        int64_t id = captain_walk_number(selector->type, captain_walk_field(selector, structure));
        const captain_type *row = captain_walk_row(field->type, id);
        if (row == NULL)
            return captain_walk_refuse(in->report, &in->path, 0, CAPTAIN_ALTERNATIVE, "%lld selects no type", (long long)id);
        const captain_open *open = (const captain_open *)(const void *)((const char *)structure + field->offset);
        const captain_row selected = {id, row};
        if (open->type != row)
            TRY(captain_place_row(type, field, &selected, structure, &in->filling));
    }
    return CAPTAIN_OK;
}

static captain_status set_component(setting *in, const captain_type *type, void *structure, const char *rest)
{
    size_t length = component(rest);
    const captain_field *field = find_field(type, rest, length);
    if (field == NULL)
        return refuse_component(in, type, rest);
    captain_path_push(&in->path, field->name);
    if (!captain_walk_is_present(field, structure))
        TRY(create(in, type, field, structure));
    if (field->type->kind == CAPTAIN_OPEN)
        return set_open(in, type, field, structure, after(rest, length));
    void *value = (void *)(uintptr_t)captain_walk_field(field, structure);
    TRY(set_at(in, field->type, field->unit, value, after(rest, length)));
    return follow_selector(in, type, field, structure);
}

/* ---------------------------------------------------------------- CHOICE, SEQUENCE OF */

static captain_status set_alternative(setting *in, const captain_type *type, void *structure, const char *rest)
{
    size_t length = component(rest);
    uint32_t *choice = structure;
    bool is_chosen = length == 1 && rest[0] == '*' && *choice >= 1 && *choice <= type->fields_count;
    const captain_field *field = is_chosen ? &type->fields[*choice - 1] : find_field(type, rest, length);
    if (field == NULL)
        return refuse_component(in, type, rest);
    captain_path_push(&in->path, field->name);
    uint32_t wanted = (uint32_t)(field - type->fields) + 1;
    if (*choice != wanted) {
        *choice = wanted;
        TRY(captain_place_example(field, structure, &in->filling));
    }
    void *value = (void *)(uintptr_t)captain_walk_field(field, structure);
    return set_at(in, field->type, field->unit, value, after(rest, length));
}

static captain_status add_element(setting *in, const captain_type *type, captain_list *list)
{
    size_t size = type->element->size;
    TRY(captain_check_size(type, (uint64_t)list->count + 1, in->report, &in->path));
    char *items = captain_arena_take(in->filling.arena, (list->count + 1) * size);
    if (items == NULL)
        return CAPTAIN_NO_MEMORY;
    if (list->count > 0)
        memcpy(items, list->items, list->count * size);
    TRY(captain_example_value(type->element, items + list->count * size, &in->filling));
    *list = (captain_list){list->count + 1, items};
    return CAPTAIN_OK;
}

static captain_status set_element(setting *in, const captain_type *type, void *value, const char *rest)
{
    char *end = NULL;
    captain_list list = captain_walk_list(value);
    unsigned long index = rest[0] == '[' && isdigit((unsigned char)rest[1]) ? strtoul(rest + 1, &end, 10) : 0;
    if (end == NULL || *end != ']' || index > list.count)
        return captain_walk_refuse(in->report, &in->path, 0, CAPTAIN_PRESENCE, "the next component is one of [0] to [%u]", list.count);
    if (index == list.count) {
        TRY(add_element(in, type, &list));
        memcpy(value, &list, sizeof list);
    }
    captain_path_push_index(&in->path, index);
    return set_at(in, type->element, NULL, (char *)list.items + index * type->element->size, after(end, 1));
}

/* ---------------------------------------------------------------- any */

static captain_status set_at(setting *in, const captain_type *type, const char *unit, void *value, const char *rest)
{
    if (*rest == 0)
        return captain_set_value(in, type, unit, value);
    if (in->filling.depth++ == CAPTAIN_WALK_DEPTH)
        return captain_walk_refuse(in->report, &in->path, 0, CAPTAIN_DEPTH, "nested too deeply");
    switch (type->kind) {
    case CAPTAIN_SEQUENCE: return set_component(in, type, value, rest);
    case CAPTAIN_CHOICE: return set_alternative(in, type, value, rest);
    case CAPTAIN_LIST: return set_element(in, type, value, rest);
    default: return refuse_component(in, type, rest);
    }
}

captain_status captain_set(const captain_message *message, void *value, const char *name, const char *text, captain_arena *arena,
                           captain_report *report)
{
    setting in = {.text = text, .filling = {.arena = arena}, .report = report};
    captain_report_clear(report);
    const char *path = strpbrk(name, ".[") != NULL ? name : NULL;
    for (unsigned i = 0; path == NULL && i < message->short_names_count; i++)
        if (strcmp(message->short_names[i].name, name) == 0)
            path = message->short_names[i].path;
    if (path == NULL && message->pdu->kind == CAPTAIN_SEQUENCE && find_field(message->pdu, name, strlen(name)) != NULL)
        path = name; /* a component of the message itself */
    if (path == NULL)
        return captain_set_unknown(&in, message, name);
    captain_status status = set_at(&in, message->pdu, NULL, value, path);
    bool is_told = status == CAPTAIN_OK || (report != NULL && report->status != CAPTAIN_OK);
    return is_told ? status : captain_walk_refuse(report, &in.path, 0, status, "%s", captain_status_text(status));
}

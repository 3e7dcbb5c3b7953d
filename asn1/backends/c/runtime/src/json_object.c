/* SEQUENCE, CHOICE and open types from JSON. Members have any order, so an open type may come before its selector. */
#include "json.h"

#include <stdio.h>
#include <string.h>

/* Limit of fields for marks on the stack; a larger SEQUENCE has them in the arena. */
enum { SEEN_FIELDS = 256 };

typedef struct members {
    const captain_type *type;
    char *structure;
    uint8_t *seen; /* one bit per field */
    captain_addition *unknown;
    uint32_t unknown_count, unknown_room, bitmap;
} members;

static bool is_seen(const members *of, unsigned index)
{
    return of->seen[index / 8] >> (index % 8) & 1;
}

/* ---------------------------------------------------------------- names */

static captain_status refuse_name(json *from, const captain_type *type, const char *name, const char *what)
{
    char text[256], shown[JSON_MAX_NAME];
    captain_json_show(name, shown);
    const char *near = NULL;
    if (from->report != NULL)
        near = captain_walk_nearest(name, type->fields, sizeof *type->fields, type->fields_count);
    snprintf(text, sizeof text, "%.60s is no %s of %.60s%s%.60s%s", shown, what, captain_type_text(type),
             near != NULL ? "; did you mean " : "", near != NULL ? near : "", near != NULL ? "?" : "");
    return captain_json_refuse(from, CAPTAIN_SYNTAX, text);
}

static captain_status refuse_twice(json *from, const char *name)
{
    char text[JSON_MAX_NAME + 32], shown[JSON_MAX_NAME];
    captain_json_show(name, shown);
    snprintf(text, sizeof text, "the member %s is there twice", shown);
    return captain_json_refuse(from, CAPTAIN_SYNTAX, text);
}

static int find_field(const captain_type *type, const char *name)
{
    for (int i = 0; i < type->fields_count; i++)
        if (strcmp(type->fields[i].name, name) == 0)
            return i;
    return -1;
}

/* Return the memory of a component; for a pointer, allocate it. */
static captain_status field_memory(json *from, const captain_field *field, char *structure, void **memory)
{
    *memory = structure + field->offset;
    if (!(field->flags & CAPTAIN_POINTER))
        return CAPTAIN_OK;
    void *pointed;
    TRY(captain_json_take_memory(from, field->type->size, &pointed));
    memcpy(*memory, &pointed, sizeof pointed);
    *memory = pointed;
    return CAPTAIN_OK;
}

/* ---------------------------------------------------------------- additions that nobody here knows */

static captain_status grow(json *from, members *of)
{
    void *memory;
    uint32_t room = of->unknown_room == 0 ? 4 : 2 * of->unknown_room;
    TRY(captain_json_take_memory(from, room * sizeof *of->unknown, &memory));
    if (of->unknown_count > 0)
        memcpy(memory, of->unknown, of->unknown_count * sizeof *of->unknown);
    of->unknown = memory;
    of->unknown_room = room;
    return CAPTAIN_OK;
}

/* Insert an unknown addition, sorted by index. */
static captain_status read_unknown(json *from, members *of, const char *name, int64_t index)
{
    char text[128];
    if (index < of->type->additions_count || index >= CAPTAIN_WALK_ADDITIONS) {
        snprintf(text, sizeof text, "addition %lld is not in %u..%u: those below have names", (long long)index,
                 of->type->additions_count, CAPTAIN_WALK_ADDITIONS - 1u);
        return captain_json_refuse(from, CAPTAIN_RANGE, text);
    }
    if (of->unknown_count == of->unknown_room)
        TRY(grow(from, of));
    uint32_t place = of->unknown_count;
    while (place > 0 && of->unknown[place - 1].index > index)
        place--;
    if (place > 0 && of->unknown[place - 1].index == index)
        return refuse_twice(from, name);
    captain_addition addition = {.index = (uint32_t)index};
    TRY(captain_json_octets(from, &addition.octets));
    memmove(of->unknown + place + 1, of->unknown + place, (of->unknown_count - place) * sizeof addition);
    of->unknown[place] = addition;
    of->unknown_count++;
    return CAPTAIN_OK;
}

static captain_status read_bitmap(json *from, members *of, const char *name)
{
    int64_t bits;
    if (of->bitmap != 0)
        return refuse_twice(from, name);
    TRY(captain_json_integer(from, false, &bits));
    if (bits < 1 || bits > CAPTAIN_WALK_ADDITIONS)
        return captain_json_refuse(from, CAPTAIN_RANGE, "the length of a bitmap of additions is in 1..16383");
    of->bitmap = (uint32_t)bits;
    return CAPTAIN_OK;
}

static captain_status store_additions(json *from, const members *of)
{
    void *memory;
    if (of->unknown_count == 0 && of->bitmap == 0)
        return CAPTAIN_OK;
    uint32_t least = of->unknown_count > 0 ? of->unknown[of->unknown_count - 1].index + 1 : 0;
    if (of->bitmap != 0 && of->bitmap < least) {
        char text[96];
        snprintf(text, sizeof text, "a bitmap of %u bits has no addition %u", of->bitmap, least - 1);
        return captain_json_refuse(from, CAPTAIN_RANGE, text);
    }
    TRY(captain_json_take_memory(from, sizeof(captain_additions), &memory));
    captain_additions *additions = memory;
    *additions = (captain_additions){of->bitmap != 0 ? of->bitmap : least, of->unknown_count, of->unknown};
    memcpy(of->structure + of->type->additions, &memory, sizeof memory);
    return CAPTAIN_OK;
}

/* ---------------------------------------------------------------- open types */

/* A later member may select the type of an open type: skip its text, and keep the position in the struct. */
static captain_status postpone(json *from, captain_open *open)
{
    captain_json_blanks(from);
    *open = (captain_open){.octets = {0, (const uint8_t *)from->next}};
    return captain_json_skip(from);
}

/* Return whether a value is given as hexadecimal text of the open type, though the type itself is never text. */
static bool is_raw(json *from, const captain_type *type)
{
    bool is_text = (from->is_plain && type->kind == CAPTAIN_INTEGER) || type->kind == CAPTAIN_ENUMERATED || (type->kind >= CAPTAIN_SMALL_BITS && type->kind <= CAPTAIN_RELATIVE_OID);
    return !is_text && captain_json_is(from, '"');
}

static captain_status read_open(json *from, const captain_type *type, const captain_type *holder, const char *structure,
                                captain_open *open)
{
    const captain_field *selector = &holder->fields[type->selector];
    const void *id = captain_walk_effective(selector, structure);
    const captain_type *row = id == NULL ? NULL : captain_walk_row(type, captain_walk_number(selector->type, id));
    from->next = (const char *)open->octets.octets;
    *open = (captain_open){.type = NULL};
    if (row == NULL || is_raw(from, row))
        return captain_json_octets(from, &open->octets);
    void *memory;
    TRY(captain_json_take_memory(from, row->size, &memory));
    open->type = row;
    open->value = memory;
    from->unit = NULL;
    return captain_json_value(from, row, memory);
}

static captain_status read_opens(json *from, const members *of)
{
    const char *end = from->next;
    for (unsigned i = 0; i < of->type->fields_count; i++) {
        const captain_field *field = &of->type->fields[i];
        if (field->type->kind != CAPTAIN_OPEN || !is_seen(of, i))
            continue;
        size_t path = captain_path_push(&from->path, field->name);
        captain_open *open = (captain_open *)(void *)(of->structure + field->offset);
        TRY(read_open(from, field->type, of->type, of->structure, open));
        captain_path_pop(&from->path, path);
    }
    from->next = end;
    return CAPTAIN_OK;
}

/* ---------------------------------------------------------------- SEQUENCE */

static captain_status read_field(json *from, members *of, unsigned index)
{
    const captain_field *field = &of->type->fields[index];
    void *memory;
    of->seen[index / 8] = (uint8_t)(of->seen[index / 8] | 1u << (index % 8));
    TRY(field_memory(from, field, of->structure, &memory));
    if (field->present != CAPTAIN_NOWHERE)
        *(bool *)(of->structure + field->present) = true;
    from->unit = field->unit;
    return field->type->kind == CAPTAIN_OPEN ? postpone(from, memory) : captain_json_value(from, field->type, memory);
}

static captain_status read_member(json *from, members *of)
{
    char name[JSON_MAX_NAME];
    TRY(captain_json_name(from, name));
    int index = find_field(of->type, name);
    size_t path = from->path.length;
    bool keeps_unknown = of->type->additions != CAPTAIN_NOWHERE;
    if (index >= 0)
        captain_path_push(&from->path, name);
    if (index >= 0 && is_seen(of, (unsigned)index))
        return refuse_twice(from, name);
    if (index >= 0)
        TRY(read_field(from, of, (unsigned)index));
    else if (keeps_unknown && strcmp(name, "[]") == 0)
        TRY(read_bitmap(from, of, name));
    else if (keeps_unknown && captain_json_bracket(name) >= 0)
        TRY(read_unknown(from, of, name, captain_json_bracket(name)));
    else
        return refuse_name(from, of->type, name, "component");
    captain_path_pop(&from->path, path);
    return CAPTAIN_OK;
}

static captain_status check_missing(json *from, const members *of)
{
    for (unsigned i = 0; i < of->type->root_count; i++) {
        const captain_field *field = &of->type->fields[i];
        if (is_seen(of, i) || (field->flags & (CAPTAIN_OPTIONAL | CAPTAIN_DEFAULT)))
            continue;
        captain_path_push(&from->path, field->name);
        return captain_json_refuse(from, CAPTAIN_PRESENCE, "is missing");
    }
    return captain_check_groups(of->type, of->structure, false, from->report, &from->path);
}

static captain_status read_members(json *from, members *of)
{
    bool is_more;
    TRY(captain_json_open(from, '{', "an object", &is_more));
    while (is_more) {
        TRY(read_member(from, of));
        TRY(captain_json_more(from, '{', &is_more));
    }
    TRY(check_missing(from, of));
    TRY(read_opens(from, of));
    return store_additions(from, of);
}

captain_status captain_json_sequence(json *from, const captain_type *type, void *value)
{
    uint8_t seen[SEEN_FIELDS / 8] = {0};
    members of = {.type = type, .structure = value, .seen = seen};
    captain_init(type, value);
    if (type->fields_count > SEEN_FIELDS) {
        void *memory;
        TRY(captain_json_take_memory(from, type->fields_count / 8u + 1, &memory));
        memset(memory, 0, type->fields_count / 8u + 1);
        of.seen = memory;
    }
    return read_members(from, &of);
}

/* ---------------------------------------------------------------- CHOICE */

static captain_status read_alternative(json *from, const captain_type *type, char *structure, unsigned index)
{
    const captain_field *field = &type->fields[index];
    void *memory;
    size_t path = captain_path_push(&from->path, field->name);
    TRY(field_memory(from, field, structure, &memory));
    from->unit = field->unit;
    TRY(captain_json_value(from, field->type, memory));
    captain_path_pop(&from->path, path);
    *(uint32_t *)(void *)structure = index + 1;
    return CAPTAIN_OK;
}

captain_status captain_json_choice(json *from, const captain_type *type, void *value)
{
    bool is_more;
    char name[JSON_MAX_NAME];
    memset(value, 0, type->size);
    TRY(captain_json_open(from, '{', "an object with one alternative", &is_more));
    if (!is_more)
        return captain_json_refuse(from, CAPTAIN_PRESENCE, "one alternative is expected, none is there");
    TRY(captain_json_name(from, name));
    int index = find_field(type, name);
    int64_t unknown = captain_json_bracket(name);
    if (index >= 0) {
        TRY(read_alternative(from, type, value, (unsigned)index));
    } else if (unknown >= type->fields_count - type->root_count && (type->flags & CAPTAIN_EXTENSIBLE)) {
        TRY(captain_json_octets(from, captain_walk_unknown(type, value)));
        *(uint32_t *)value = CAPTAIN_UNKNOWN + (uint32_t)unknown;
    } else {
        return refuse_name(from, type, name, "alternative");
    }
    TRY(captain_json_more(from, '{', &is_more));
    return is_more ? captain_json_refuse(from, CAPTAIN_SYNTAX, "one alternative is expected, several are there") : CAPTAIN_OK;
}

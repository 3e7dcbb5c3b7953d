/* Location of the first value that encode or validate refuses. */
#include "walk.h"

#include <stdio.h>

typedef struct locate {
    bool is_strict;
    unsigned depth, recursion;
    captain_path path;
    captain_report *report;
} locate;

static captain_status check_value(locate *in, const captain_type *type, const void *value);

static captain_status refuse(locate *in, captain_status status, const char *text)
{
    return captain_walk_refuse(in->report, &in->path, 0, status, "%s", text);
}

/* Check the gaps of a union, which PER ignores. */
static captain_status check_gap(locate *in, const captain_type *type, int64_t number)
{
    if (!in->is_strict || (type->flags & CAPTAIN_EXTENSIBLE) || !captain_walk_in_gap(type, number))
        return CAPTAIN_OK;
    char text[128], found[CAPTAIN_RANGE_TEXT], low[CAPTAIN_RANGE_TEXT], high[CAPTAIN_RANGE_TEXT];
    for (unsigned i = 0; i < type->gaps_count; i++) {
        if (number < type->gaps[i].low || number > type->gaps[i].high)
            continue;
        captain_number_text(type, type->gaps[i].low, low);
        captain_number_text(type, type->gaps[i].high, high);
        break;
    }
    snprintf(text, sizeof text, "%s is not allowed: %.40s..%.40s is left out", captain_number_text(type, number, found), low,
             high);
    return refuse(in, CAPTAIN_INNER, text);
}

/* ---------------------------------------------------------------- values */

static captain_status check_integer(locate *in, const captain_type *type, const void *value)
{
    int64_t number = captain_walk_number(type, value);
    TRY(captain_check_number(type, number, in->report, &in->path));
    return check_gap(in, type, number);
}

static captain_status check_item(locate *in, const captain_type *type, const void *value)
{
    int64_t number = captain_walk_number(type, value);
    bool is_unknown = (type->flags & CAPTAIN_EXTENSIBLE) && number >= CAPTAIN_UNKNOWN;
    if (captain_walk_item(type, number) >= 0 || is_unknown)
        return CAPTAIN_OK;
    char text[128];
    snprintf(text, sizeof text, "%lld is no item of %.60s", (long long)number, captain_type_text(type));
    return refuse(in, CAPTAIN_ALTERNATIVE, text);
}

static captain_status check_small_bits(locate *in, const captain_type *type, const void *value)
{
    uint64_t bits = (uint64_t)captain_walk_number(type, value);
    if (type->high == 64 || bits >> type->high == 0)
        return CAPTAIN_OK;
    char text[96];
    snprintf(text, sizeof text, "the number has bits above the %lld of the string", (long long)type->high);
    return refuse(in, CAPTAIN_SIZE, text);
}

/* Trailing zeros of named bits are ignored here, because encode adds or removes them as the size requires (16.2, 16.3). */
static captain_status check_bits(locate *in, const captain_type *type, const captain_bits *bits)
{
    uint32_t count = bits->count;
    if (count > 0 && bits->octets == NULL)
        return refuse(in, CAPTAIN_PRESENCE, "the string has a length and no octets");
    if (type->flags & CAPTAIN_NAMED_BITS) {
        uint32_t least = captain_walk_bits(type, bits);
        count = least > (uint64_t)type->low ? least : (uint32_t)type->low;
    }
    TRY(captain_check_size(type, count, in->report, &in->path));
    return check_gap(in, type, count);
}

static captain_status check_text(locate *in, const captain_type *type, captain_octets octets)
{
    const char *text = (const char *)octets.octets;
    if (type->kind == CAPTAIN_UTF8) {
        TRY(captain_check_text(type, true, text, octets.count, in->report, &in->path));
        uint32_t characters = 0;
        for (uint32_t i = 0; i < octets.count; i++)
            characters += (octets.octets[i] & 0xc0) != 0x80;
        TRY(in->is_strict ? captain_check_size(type, characters, in->report, &in->path) : CAPTAIN_OK);
        return check_gap(in, type, characters);
    }
    if (!in->is_strict)
        TRY(captain_check_size(type, octets.count, in->report, &in->path));
    TRY(captain_check_text(type, in->is_strict || captain_walk_in_size(type, octets.count), text, octets.count, in->report,
                           &in->path));
    TRY(captain_check_size(type, octets.count, in->report, &in->path));
    return check_gap(in, type, octets.count);
}

static captain_status check_string(locate *in, const captain_type *type, captain_octets octets)
{
    if (octets.count > 0 && octets.octets == NULL)
        return refuse(in, CAPTAIN_PRESENCE, "the string has a length and no octets");
    if (captain_walk_is_string(type))
        return check_text(in, type, octets);
    if (type->kind != CAPTAIN_OCTET_STRING)
        return captain_walk_is_oid(&octets) ? CAPTAIN_OK : refuse(in, CAPTAIN_RANGE, "the octets are no object identifier");
    TRY(captain_check_size(type, octets.count, in->report, &in->path));
    return check_gap(in, type, octets.count);
}

/* ---------------------------------------------------------------- containers */

static captain_status check_additions(locate *in, const captain_type *type, const captain_additions *additions)
{
    for (uint32_t i = 0; additions != NULL && i < additions->count; i++) {
        uint32_t least = i == 0 ? type->additions_count : additions->unknown[i - 1].index + 1;
        if (additions->unknown[i].index < least)
            return refuse(in, CAPTAIN_PRESENCE, "unknown additions are ascending, behind those that the type knows");
        if (additions->unknown[i].index >= CAPTAIN_WALK_ADDITIONS)
            return refuse(in, CAPTAIN_SIZE, "an addition has an index above 16382");
    }
    if (captain_walk_bitmap(additions) > CAPTAIN_WALK_ADDITIONS)
        return refuse(in, CAPTAIN_SIZE, "a bitmap of additions has more than 16383 bits");
    return CAPTAIN_OK;
}

static captain_status check_field(locate *in, const captain_field *field, const void *structure)
{
    const void *value = captain_walk_field(field, structure);
    size_t path = captain_path_push(&in->path, field->name);
    TRY(value == NULL ? refuse(in, CAPTAIN_PRESENCE, "is missing") : check_value(in, field->type, value));
    captain_path_pop(&in->path, path);
    return CAPTAIN_OK;
}

/* Check that an open type has the type of its selector, or octets only. */
static captain_status check_selected(locate *in, const captain_type *holder, const captain_field *field, const void *structure)
{
    const captain_open *open = captain_walk_field(field, structure);
    const captain_field *selector = &holder->fields[field->type->selector];
    const void *id = captain_walk_effective(selector, structure);
    if (open == NULL || open->type == NULL || id == NULL)
        return CAPTAIN_OK;
    if (open->type == captain_walk_row(field->type, captain_walk_number(selector->type, id)) && open->value != NULL)
        return CAPTAIN_OK;
    char text[160];
    snprintf(text, sizeof text, "%lld of %.60s does not stand for a %.60s", (long long)captain_walk_number(selector->type, id),
             selector->name, captain_type_text(open->type));
    captain_path_push(&in->path, field->name);
    return refuse(in, CAPTAIN_ALTERNATIVE, text);
}

static captain_status check_sequence(locate *in, const captain_type *type, const void *value)
{
    for (unsigned i = 0; i < type->fields_count; i++) {
        const captain_field *field = &type->fields[i];
        if (!captain_walk_is_present(field, value))
            continue;
        if (field->type->kind == CAPTAIN_OPEN)
            TRY(check_selected(in, type, field, value));
        TRY(check_field(in, field, value));
    }
    TRY(captain_check_groups(type, value, in->is_strict, in->report, &in->path));
    /* Kept additions are not values of the standard, so only the encoding checks them. */
    return in->is_strict ? CAPTAIN_OK : check_additions(in, type, captain_walk_additions(type, value));
}

static captain_status check_choice(locate *in, const captain_type *type, const void *value)
{
    uint32_t choice = *(const uint32_t *)value;
    if (choice > 0 && choice <= type->fields_count)
        return check_field(in, &type->fields[choice - 1], value);
    if (choice >= CAPTAIN_UNKNOWN && (type->flags & CAPTAIN_EXTENSIBLE))
        return CAPTAIN_OK;
    char text[128];
    snprintf(text, sizeof text, "alternative %u does not exist: %.60s has %u, counted from 1", choice, captain_type_text(type),
             type->fields_count);
    return refuse(in, CAPTAIN_ALTERNATIVE, choice == 0 ? "no alternative is chosen" : text);
}

static captain_status check_list(locate *in, const captain_type *type, captain_list list)
{
    TRY(captain_check_size(type, list.count, in->report, &in->path));
    TRY(check_gap(in, type, list.count));
    if (list.count > 0 && list.items == NULL)
        return refuse(in, CAPTAIN_PRESENCE, "the list has a length and no elements");
    for (uint32_t i = 0; i < list.count; i++) {
        size_t path = captain_path_push_index(&in->path, i);
        TRY(check_value(in, type->element, (const char *)list.items + (size_t)i * type->element->size));
        captain_path_pop(&in->path, path);
    }
    return CAPTAIN_OK;
}

static captain_status check_known(locate *in, const captain_type *type, const void *value)
{
    const captain_open *open = value;
    switch (type->kind) {
    case CAPTAIN_SEQUENCE: return check_sequence(in, type, value);
    case CAPTAIN_CHOICE: return check_choice(in, type, value);
    case CAPTAIN_LIST: return check_list(in, type, captain_walk_list(value));
    default: return open->type == NULL || open->value == NULL ? CAPTAIN_OK : check_value(in, open->type, open->value);
    }
}

enum { PRESENT_TEXT = 160 };

/* Return the present optional components as text: "; there are a, b". Empty for types other than SEQUENCE. */
static const char *present(const captain_type *type, const void *value, char text[PRESENT_TEXT])
{
    size_t used = 0;
    text[0] = 0;
    for (unsigned i = 0; type->kind == CAPTAIN_SEQUENCE && i < type->fields_count; i++) {
        const captain_field *field = &type->fields[i];
        if (field->present == CAPTAIN_NOWHERE || !captain_walk_is_present(field, value) || used + 80 > PRESENT_TEXT)
            continue;
        used += (size_t)snprintf(text + used, PRESENT_TEXT - used, "%s%.60s",
                                 used == 0 ? "; of those that may be absent there are " : ", ", field->name);
    }
    if (type->kind == CAPTAIN_SEQUENCE && used == 0)
        snprintf(text, PRESENT_TEXT, "; of those that may be absent there is none");
    return text;
}

/* Only generated code checks WITH COMPONENTS: the error is reported for the innermost value that it refuses. */
static captain_status check_generated(locate *in, const captain_type *type, const void *value)
{
    captain_status status = in->is_strict ? captain_validate(type, value) : CAPTAIN_OK;
    if (status == CAPTAIN_OK)
        return status;
    char there[PRESENT_TEXT];
    return captain_walk_refuse(in->report, &in->path, 0, status, "breaks a constraint of %.60s%s%.280s%s",
                               captain_type_text(type), type->rule == NULL ? "" : ": ",
                               type->rule == NULL ? "" : type->rule, present(type, value, there));
}

static captain_status check_value(locate *in, const captain_type *type, const void *value)
{
    switch (type->kind) {
    case CAPTAIN_BOOLEAN:
    case CAPTAIN_NULL:
    case CAPTAIN_FIXED_OCTETS: return CAPTAIN_OK;
    case CAPTAIN_INTEGER: return check_integer(in, type, value);
    case CAPTAIN_ENUMERATED: return check_item(in, type, value);
    case CAPTAIN_SMALL_BITS: return check_small_bits(in, type, value);
    case CAPTAIN_BIT_STRING: return check_bits(in, type, value);
    case CAPTAIN_SEQUENCE:
    case CAPTAIN_CHOICE:
    case CAPTAIN_LIST:
    case CAPTAIN_OPEN: break;
    default: return check_string(in, type, captain_walk_octets(value));
    }
    /* decode has the same limit as encode */
    unsigned again = !in->is_strict && (type->flags & CAPTAIN_RECURS) ? 1 : 0;
    if (in->depth == CAPTAIN_WALK_DEPTH || in->recursion + again > CAPTAIN_WALK_RECURSION)
        return refuse(in, CAPTAIN_DEPTH, "nested too deeply");
    in->depth++;
    in->recursion += again;
    TRY(check_known(in, type, value));
    in->recursion -= again;
    in->depth--;
    return check_generated(in, type, value);
}

captain_status captain_explain_value(const captain_type *type, const void *value, bool is_strict, captain_report *report)
{
    locate in = {.is_strict = is_strict, .report = report};
    captain_report_clear(report);
    return check_value(&in, type, value);
}

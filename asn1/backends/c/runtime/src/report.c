/* Reports of errors: paths and sentences. */
#include "walk.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* ---------------------------------------------------------------- paths */

static void append(captain_path *path, const char *text, size_t count)
{
    size_t room = sizeof path->text - 1 - path->length;
    count = count < room ? count : room;
    memcpy(path->text + path->length, text, count);
    path->length += count;
    path->text[path->length] = 0;
}

size_t captain_path_push(captain_path *path, const char *name)
{
    size_t before = path->length;
    if (before > 0)
        append(path, ".", 1);
    append(path, name, strlen(name));
    return before;
}

size_t captain_path_push_index(captain_path *path, uint64_t index)
{
    char text[24];
    size_t before = path->length;
    append(path, text, (size_t)snprintf(text, sizeof text, "[%" PRIu64 "]", index));
    return before;
}

size_t captain_path_push_addition(captain_path *path, uint64_t index)
{
    char text[24];
    snprintf(text, sizeof text, "[%" PRIu64 "]", index);
    return captain_path_push(path, text);
}

void captain_path_pop(captain_path *path, size_t length)
{
    path->length = length;
    path->text[length] = 0;
}

/* ---------------------------------------------------------------- sentences */

void captain_report_clear(captain_report *report)
{
    if (report == NULL)
        return;
    report->status = CAPTAIN_OK;
    report->bit = 0;
    report->path[0] = report->text[0] = 0;
}

captain_status captain_walk_refuse(captain_report *report, const captain_path *path, size_t bit, captain_status status,
                                   const char *format, ...)
{
    if (report == NULL)
        return status;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(report->text, sizeof report->text, format, arguments);
    va_end(arguments);
    report->status = status;
    report->bit = bit;
    memcpy(report->path, path->text, path->length + 1);
    return status;
}

const char *captain_number_text(const captain_type *type, int64_t number, char text[CAPTAIN_RANGE_TEXT])
{
    if (type->kind == CAPTAIN_INTEGER && captain_walk_is_unsigned64(type))
        snprintf(text, CAPTAIN_RANGE_TEXT, "%" PRIu64, (uint64_t)number);
    else
        snprintf(text, CAPTAIN_RANGE_TEXT, "%" PRId64, number);
    return text;
}

const char *captain_range_text(const captain_type *type, char text[CAPTAIN_RANGE_TEXT])
{
    char low[CAPTAIN_RANGE_TEXT] = "MIN", high[CAPTAIN_RANGE_TEXT] = "MAX";
    if (!(type->flags & CAPTAIN_UNBOUNDED_LOW))
        captain_number_text(type, type->low, low);
    if (!(type->flags & CAPTAIN_UNBOUNDED_HIGH))
        captain_number_text(type, type->high, high);
    bool is_one = strcmp(low, high) == 0;
    snprintf(text, CAPTAIN_RANGE_TEXT, "%.24s%s%.24s", low, is_one ? "" : "..", is_one ? "" : high);
    return text;
}

const char *captain_size_noun(const captain_type *type)
{
    switch (type->kind) {
    case CAPTAIN_SMALL_BITS:
    case CAPTAIN_BIT_STRING: return "bits";
    case CAPTAIN_LIST: return "elements";
    default: return captain_walk_is_string(type) ? "characters" : "octets";
    }
}

const char *captain_size_text(const captain_type *type, char text[CAPTAIN_RANGE_TEXT])
{
    captain_range_text(type, text);
    size_t used = strlen(text);
    snprintf(text + used, CAPTAIN_RANGE_TEXT - used, " %s", captain_size_noun(type));
    return text;
}

const char *captain_kind_text(const captain_type *type)
{
    static const char *const KINDS[] = {
        "BOOLEAN", "NULL", "INTEGER", "ENUMERATED", "BIT STRING", "BIT STRING", "OCTET STRING", "OCTET STRING", "IA5String",
        "VisibleString", "PrintableString", "NumericString", "UTF8String", "OBJECT IDENTIFIER", "RELATIVE-OID", "SEQUENCE",
        "CHOICE", "SEQUENCE OF", "open type",
    };
    return KINDS[type->kind];
}

const char *captain_type_text(const captain_type *type)
{
    return type->name != NULL ? type->name : captain_kind_text(type);
}

/* Reading: entry function, counts, octets and bits, and errors for invalid octets. */
#include "cdr.h"
#include "walk.h"

#include <stdio.h>

enum { HEADER = 4 };

/* Empty path: errors get the names of the ROS message afterwards. */
static const captain_path NOWHERE;

/* ---------------------------------------------------------------- where and why */

static void put_in_front(captain_report *report, const char *name)
{
    char text[sizeof report->path];
    char first = report->path[0];
    snprintf(text, sizeof text, "%s%s%.400s", name, first == 0 || first == '[' ? "" : ".", report->path);
    memcpy(report->path, text, sizeof text);
}

size_t captain_cdr_refuse(captain_cdr_reader *r, size_t at, captain_status status, const char *name, const char *text)
{
    r->status = status;
    if (r->report == NULL)
        return CAPTAIN_FAILED;
    *r->report = (captain_report){.status = status, .bit = 8 * (at + HEADER)};
    snprintf(r->report->text, sizeof r->report->text, "%s", text);
    return captain_cdr_in(r, name);
}

size_t captain_cdr_in(captain_cdr_reader *r, const char *name)
{
    if (r->report != NULL && name[0] != 0)
        put_in_front(r->report, name);
    return CAPTAIN_FAILED;
}

size_t captain_cdr_in_item(captain_cdr_reader *r, uint32_t index, const char *name)
{
    char text[128];
    snprintf(text, sizeof text, "%.100s[%u]", name, (unsigned)index);
    return captain_cdr_in(r, text);
}

size_t captain_cdr_cut(captain_cdr_reader *r, size_t at, const char *name)
{
    char text[96];
    snprintf(text, sizeof text, "truncated: the octets end at %zu, before the end of the field", r->size + HEADER);
    return captain_cdr_refuse(r, at < r->size ? at : r->size, CAPTAIN_TRUNCATED, name, text);
}

size_t captain_cdr_bad_bool(captain_cdr_reader *r, size_t at, const char *name)
{
    char text[48];
    snprintf(text, sizeof text, "%u is no bool: 0 or 1", r->octets[at]);
    return captain_cdr_refuse(r, at, CAPTAIN_RANGE, name, text);
}

size_t captain_cdr_bad_number(captain_cdr_reader *r, size_t at, int64_t number, const captain_type *type, const char *name)
{
    char found[CAPTAIN_RANGE_TEXT], allowed[CAPTAIN_RANGE_TEXT], text[2 * CAPTAIN_RANGE_TEXT + 16];
    snprintf(text, sizeof text, "%s is not in %s", captain_number_text(type, number, found), captain_range_text(type, allowed));
    return captain_cdr_refuse(r, at, CAPTAIN_RANGE, name, text);
}

size_t captain_cdr_bad_item(captain_cdr_reader *r, size_t at, int64_t number, const captain_type *type, const char *name)
{
    char text[128];
    snprintf(text, sizeof text, "%lld is no item of %.60s", (long long)number, captain_type_text(type));
    return captain_cdr_refuse(r, at, CAPTAIN_ALTERNATIVE, name, text);
}

size_t captain_cdr_bad_choice(captain_cdr_reader *r, size_t at, int64_t number, const char *name)
{
    char text[64];
    snprintf(text, sizeof text, "%lld is no alternative", (long long)number);
    return captain_cdr_refuse(r, at, CAPTAIN_ALTERNATIVE, name, text);
}

size_t captain_cdr_bad_octet(captain_cdr_reader *r, size_t at, int64_t number, const char *name)
{
    char text[64];
    snprintf(text, sizeof text, "%lld is no octet: 0..255", (long long)number);
    return captain_cdr_refuse(r, at, CAPTAIN_RANGE, name, text);
}

size_t captain_cdr_bad_bits(captain_cdr_reader *r, size_t at, int64_t number, const captain_type *type, const char *name)
{
    char allowed[CAPTAIN_RANGE_TEXT], text[CAPTAIN_RANGE_TEXT + 80];
    snprintf(text, sizeof text, "%lld has bits beyond those of the string: %s are allowed", (long long)number,
             captain_size_text(type, allowed));
    return captain_cdr_refuse(r, at, CAPTAIN_SIZE, name, text);
}

size_t captain_cdr_bad_row(captain_cdr_reader *r, size_t at, int64_t id, const char *selector, const char *name)
{
    char text[160];
    snprintf(text, sizeof text, "%.80s is %lld, and the message has no field for what that stands for", selector, (long long)id);
    return captain_cdr_refuse(r, at, CAPTAIN_ALTERNATIVE, name, text);
}

size_t captain_cdr_bad_count(captain_cdr_reader *r, size_t at, uint64_t count, const captain_type *type, const char *name)
{
    char allowed[CAPTAIN_RANGE_TEXT], text[CAPTAIN_RANGE_TEXT + 80];
    snprintf(text, sizeof text, "%llu %s are there, %s are allowed", (unsigned long long)count, captain_size_noun(type),
             captain_size_text(type, allowed));
    return captain_cdr_refuse(r, at, CAPTAIN_SIZE, name, text);
}

size_t captain_cdr_bad_unused(captain_cdr_reader *r, size_t at, uint8_t unused, unsigned wanted, const char *name)
{
    char text[96];
    if (wanted == CAPTAIN_CDR_UNUSED_MAX)
        snprintf(text, sizeof text, "%u bits unused, of an octet that is there 0 to 7 can be", unused);
    else
        snprintf(text, sizeof text, "%u bits unused, of this string it is always %u", unused, wanted);
    return captain_cdr_refuse(r, at, CAPTAIN_SIZE, name, text);
}

size_t captain_cdr_no_memory(captain_cdr_reader *r, size_t at, const char *name)
{
    return captain_cdr_refuse(r, at, CAPTAIN_NO_MEMORY, name, "out of memory");
}

size_t captain_cdr_too_deep(captain_cdr_reader *r, size_t at)
{
    return captain_cdr_refuse(r, at, CAPTAIN_DEPTH, "", "nested too deeply");
}

/* ---------------------------------------------------------------- counts and octets */

size_t captain_cdr_get_count(captain_cdr_reader *r, size_t at, size_t least, uint32_t *count, const char *name)
{
    char text[112];
    at = captain_cdr_align(at, 4) + 4;
    if (at > r->size)
        return captain_cdr_cut(r, at - 4, name);
    *count = (uint32_t)captain_cdr_load(r, at, 4);
    if (*count <= (r->size - at) / least)
        return at;
    snprintf(text, sizeof text, "truncated: %u elements of at least %zu octets are announced, %zu octets are left", (unsigned)*count, least,
             r->size - at);
    return captain_cdr_refuse(r, at - 4, CAPTAIN_TRUNCATED, name, text);
}

size_t captain_cdr_get_octets(captain_cdr_reader *r, size_t at, captain_octets *octets, const char *name)
{
    at = captain_cdr_get_count(r, at, 1, &octets->count, name);
    if (at == CAPTAIN_FAILED)
        return at;
    octets->octets = r->octets + at;
    return at + octets->count;
}

static captain_status size_status(const captain_type *type, uint64_t count)
{
    return captain_check_size(type, count, NULL, &NOWHERE);
}

size_t captain_cdr_get_string(captain_cdr_reader *r, size_t at, captain_octets *octets, const captain_type *type, const char *name)
{
    size_t start = at;
    at = captain_cdr_get_octets(r, at, octets, name);
    if (at != CAPTAIN_FAILED && size_status(type, octets->count) != CAPTAIN_OK)
        return captain_cdr_bad_count(r, captain_cdr_align(start, 4), octets->count, type, name);
    return at;
}

size_t captain_cdr_get_fixed(captain_cdr_reader *r, size_t at, uint8_t *octets, const captain_type *type, const char *name)
{
    captain_octets found;
    at = captain_cdr_get_string(r, at, &found, type, name);
    if (at != CAPTAIN_FAILED)
        memcpy(octets, found.octets, found.count);
    return at;
}

/* ---------------------------------------------------------------- bits */

size_t captain_cdr_get_small_bits(captain_cdr_reader *r, size_t at, uint64_t *bits, const captain_type *type, const char *name)
{
    captain_octets octets;
    size_t start = captain_cdr_align(at, 4);
    unsigned wanted = (unsigned)(type->high + 7) / 8;
    at = captain_cdr_get_octets(r, at, &octets, name);
    if (at == CAPTAIN_FAILED)
        return at;
    if (octets.count != wanted)
        return captain_cdr_bad_count(r, start, (uint64_t)octets.count * 8, type, name);
    *bits = 0;
    for (unsigned i = 0; i < wanted; i++)
        *bits = *bits << 8 | octets.octets[i];
    *bits >>= 8 * wanted - (unsigned)type->high;
    return at;
}

size_t captain_cdr_get_small_unused(captain_cdr_reader *r, size_t at, const captain_type *type, const char *name)
{
    unsigned wanted = (unsigned)-type->high & 7;
    if (at >= r->size)
        return captain_cdr_cut(r, at, name);
    return r->octets[at] == wanted ? at + 1 : captain_cdr_bad_unused(r, at, r->octets[at], wanted, name);
}

size_t captain_cdr_get_unused(captain_cdr_reader *r, size_t at, captain_bits *bits, const captain_type *type, const char *name)
{
    captain_report found;
    if (at >= r->size)
        return captain_cdr_cut(r, at, name);
    uint8_t unused = r->octets[at];
    if (unused > (bits->count == 0 ? 0 : 7))
        return captain_cdr_bad_unused(r, at, unused, CAPTAIN_CDR_UNUSED_MAX, name);
    bits->count -= unused;
    /* encode removes and adds trailing zeros of named bits, so they do not count here */
    uint32_t count = bits->count;
    if (type->flags & CAPTAIN_NAMED_BITS) {
        uint32_t least = captain_walk_bits(type, bits);
        count = least > (uint64_t)type->low ? least : (uint32_t)type->low;
    }
    captain_status status = captain_check_size(type, count, &found, &NOWHERE);
    return status == CAPTAIN_OK ? at + 1 : captain_cdr_refuse(r, at, status, name, found.text);
}

/* ---------------------------------------------------------------- the way in */

static captain_status refuse_header(captain_report *report, captain_status status, size_t octet, const char *text)
{
    if (report != NULL) {
        *report = (captain_report){.status = status, .bit = 8 * octet};
        snprintf(report->text, sizeof report->text, "%s", text);
    }
    return status;
}

/* Octets 0 and 1 are the encapsulation; 2 and 3 are options, which XCDR1 does not use. */
static captain_status check_header(const uint8_t *cdr, size_t size, captain_report *report)
{
    char text[112];
    if (size < HEADER)
        return refuse_header(report, CAPTAIN_TRUNCATED, size, "truncated: not even the four octets of the encapsulation are there");
    if (cdr[0] == 0 && cdr[1] == 1)
        return CAPTAIN_OK;
    const char *what = cdr[0] != 0 || cdr[1] > 11   ? "no encapsulation of CDR"
                       : cdr[1] == 0                ? "CDR, big endian"
                       : cdr[1] == 2 || cdr[1] == 3 ? "a parameter list"
                       : cdr[1] > 5                 ? "XCDR2"
                                                    : "reserved";
    snprintf(text, sizeof text, "encapsulation %02x %02x (%s): only 00 01 is read, CDR little endian", cdr[0], cdr[1], what);
    return refuse_header(report, CAPTAIN_SYNTAX, 0, text);
}

captain_status captain_from_cdr(const captain_ros2 *ros2, void *value, const void *cdr, size_t size, bool takes_unknown,
                                captain_arena *arena, captain_report *report)
{
    const uint8_t *octets = cdr;
    char text[96];
    captain_status status = check_header(octets, size, report);
    if (status == CAPTAIN_OK && size > CAPTAIN_CDR_MAX)
        status = refuse_header(report, CAPTAIN_LENGTH, 0, "more than 16 MB");
    if (status != CAPTAIN_OK)
        return status;
    captain_cdr_reader reader = {.octets = octets + HEADER, .size = size - HEADER, .arena = arena, .report = report,
                                 .takes_unknown = takes_unknown};
    size_t at = ros2->read(&reader, 0, value);
    if (at == CAPTAIN_FAILED)
        return reader.status;
    /* A payload of RTPS is padded to a multiple of four octets. */
    if (reader.size - at < 4)
        return CAPTAIN_OK;
    snprintf(text, sizeof text, "octets behind the end: the message ends at %zu, the octets at %zu", at + HEADER, size);
    return refuse_header(report, CAPTAIN_TRAILING, at + HEADER, text);
}

/* Reading of text. Object identifiers, which are text in ROS, are read and written here. */
#include "cdr.h"
#include "json.h"
#include "walk.h"

/* Empty path: errors get the names of the ROS message afterwards. */
static const captain_path NOWHERE;

/* Read a string with its final zero, which its length includes. Some writers encode an empty string as length 0. */
static size_t get_text(captain_cdr_reader *r, size_t at, captain_text *text, const char *name)
{
    captain_octets octets;
    at = captain_cdr_get_octets(r, at, &octets, name);
    if (at == CAPTAIN_FAILED)
        return at;
    *text = (captain_text){.count = 0, .text = ""};
    if (octets.count == 0)
        return at;
    if (octets.octets[octets.count - 1] != 0)
        return captain_cdr_refuse(r, at - 1, CAPTAIN_LENGTH, name, "a string of CDR ends in a zero, this one does not");
    *text = (captain_text){.count = octets.count - 1, .text = (const char *)octets.octets};
    return at;
}

/* Return whether all octets are ASCII, as in most texts. Then all are valid in UTF-8, and in an IA5String without an alphabet. */
static bool is_ascii(const captain_text *text)
{
    uint64_t all = 0, word;
    uint32_t i = 0;
    for (; i + 8 <= text->count; i += 8) {
        memcpy(&word, text->text + i, 8);
        all |= word;
    }
    for (; i < text->count; i++)
        all |= (uint8_t)text->text[i];
    return (all & UINT64_C(0x8080808080808080)) == 0;
}

size_t captain_cdr_get_text(captain_cdr_reader *r, size_t at, captain_text *text, const captain_type *type, const char *name)
{
    captain_report found;
    size_t start = captain_cdr_align(at, 4);
    at = get_text(r, at, text, name);
    if (at == CAPTAIN_FAILED)
        return at;
    captain_status status = CAPTAIN_OK;
    if (type->kind != CAPTAIN_UTF8)
        status = captain_check_size(type, text->count, &found, &NOWHERE);
    bool is_any = type->kind == CAPTAIN_UTF8 || (type->kind == CAPTAIN_IA5 && type->alphabet == NULL);
    if (status == CAPTAIN_OK && !(is_any && is_ascii(text)))
        status = captain_check_text(type, captain_walk_in_size(type, text->count), text->text, text->count, &found, &NOWHERE);
    return status == CAPTAIN_OK ? at : captain_cdr_refuse(r, start, status, name, found.text);
}

static bool count_only(void *context, const char *text, size_t octets)
{
    (void)text;
    *(size_t *)context += octets;
    return true;
}

typedef struct copy {
    captain_cdr_writer *writer;
    size_t at;
} copy;

static bool append(void *context, const char *text, size_t octets)
{
    copy *to = context;
    for (size_t i = 0; i < octets; i++)
        to->at = captain_cdr_put(to->writer, to->at, (uint8_t)text[i], 1);
    return true;
}

static void print_oid(const captain_type *type, const captain_octets *oid, captain_sink sink, void *context)
{
    captain_out out;
    captain_out_start(&out, sink, context);
    captain_out_oid(&out, type->kind == CAPTAIN_RELATIVE_OID, oid);
    captain_out_end(&out);
}

size_t captain_cdr_put_oid(captain_cdr_writer *w, size_t at, const captain_type *type, const captain_octets *oid)
{
    size_t count = 0;
    print_oid(type, oid, count_only, &count);
    copy to = {w, captain_cdr_put(w, at, count + 1, 4)};
    print_oid(type, oid, append, &to);
    return captain_cdr_put(w, to.at, 0, 1);
}

size_t captain_cdr_get_oid(captain_cdr_reader *r, size_t at, captain_octets *oid, const captain_type *type, const char *name)
{
    captain_text text;
    size_t start = captain_cdr_align(at, 4);
    at = get_text(r, at, &text, name);
    if (at == CAPTAIN_FAILED)
        return at;
    uint8_t *octets = captain_arena_take(r->arena, (size_t)text.count + 1);
    if (octets == NULL)
        return captain_cdr_no_memory(r, start, name);
    size_t count = captain_json_oid(&text, type->kind == CAPTAIN_RELATIVE_OID, octets);
    if (count == SIZE_MAX)
        return captain_cdr_refuse(r, start, CAPTAIN_RANGE, name, "no object identifier like \"1.3.6.1\"");
    *oid = (captain_octets){.count = (uint32_t)count, .octets = octets};
    return at;
}

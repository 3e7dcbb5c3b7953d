/* Entry functions, and parts common to all messages. */
#include "cdr.h"

/* Octets of the encapsulation: CDR_LE of XCDR1 (DDSI-RTPS 2.5, 10.2), and two octets of options, which XCDR1 ignores. */
enum { HEADER = 4 };

const captain_ros2 *captain_find_ros2(const char *message, const char *profile)
{
    for (size_t i = 0; i < captain_ros2_messages_count; i++)
        if (strcmp(captain_ros2_messages[i]->message, message) == 0 && strcmp(captain_ros2_messages[i]->profile, profile) == 0)
            return captain_ros2_messages[i];
    return NULL;
}

captain_status captain_to_cdr(const captain_ros2 *ros2, const void *value, void *cdr, size_t size, size_t *octets, size_t *left_out)
{
    captain_cdr_writer writer = {.octets = cdr, .size = size < HEADER ? 0 : size - HEADER};
    if (size >= HEADER) {
        memcpy(cdr, "\0\1\0", HEADER);
        writer.octets += HEADER;
    }
    size_t count = ros2->write(&writer, 0, value);
    *octets = HEADER + count;
    *left_out = writer.left_count;
    if (*octets > CAPTAIN_CDR_MAX)
        return CAPTAIN_LENGTH;
    return *octets > size ? CAPTAIN_NO_SPACE : CAPTAIN_OK;
}

/* ---------------------------------------------------------------- writing */

size_t captain_cdr_put_end(captain_cdr_writer *w, size_t at, uint64_t number, size_t size)
{
    size_t to = captain_cdr_align(at, size);
    if (to + size <= w->size) {
        memset(w->octets + at, 0, to - at);
        for (size_t i = 0; i < size; i++)
            w->octets[to + i] = (uint8_t)(number >> 8 * i);
    }
    return to + size;
}

void captain_cdr_leave(captain_cdr_writer *w, const captain_type *type, const void *value)
{
    if (w->left != NULL && w->left_count < CAPTAIN_LEFT_MAX)
        w->left[w->left_count] = (captain_left){type, value};
    w->left_count++;
}

int64_t captain_cdr_fit(captain_cdr_writer *w, int64_t number, int64_t low, int64_t high, const captain_type *type, const void *value)
{
    if (number >= low && number <= high)
        return number;
    captain_cdr_leave(w, type, value);
    return number < low ? low : high;
}

static size_t put(captain_cdr_writer *w, size_t at, const void *octets, size_t count)
{
    if (count > 0 && at + count <= w->size)
        memcpy(w->octets + at, octets, count);
    return at + count;
}

size_t captain_cdr_put_octets(captain_cdr_writer *w, size_t at, const uint8_t *octets, uint32_t count)
{
    return put(w, captain_cdr_put(w, at, count, 4), octets, count);
}

size_t captain_cdr_put_text(captain_cdr_writer *w, size_t at, const captain_type *type, const captain_text *text)
{
    if (text->count > 0 && memchr(text->text, 0, text->count) != NULL)
        captain_cdr_leave(w, type, text);
    at = captain_cdr_put(w, at, (uint64_t)text->count + 1, 4);
    return captain_cdr_put(w, put(w, at, text->text, text->count), 0, 1);
}

size_t captain_cdr_put_small_bits(captain_cdr_writer *w, size_t at, uint64_t bits, unsigned size)
{
    unsigned octets = (size + 7) / 8;
    at = captain_cdr_put(w, at, octets, 4);
    bits <<= 8 * octets - size;
    for (unsigned i = octets; i-- > 0;)
        at = captain_cdr_put(w, at, bits >> 8 * i & 0xff, 1);
    return at;
}

static size_t put_part(captain_cdr_writer *w, size_t at, const captain_cdr_part *part)
{
    if (part->is_list)
        return captain_cdr_put(w, at, 0, 4);
    if (part->kind == CAPTAIN_CDR_MESSAGE)
        return captain_cdr_none(w, at, part->message);
    if (part->kind == CAPTAIN_CDR_STRING)
        return captain_cdr_put(w, captain_cdr_put(w, at, 1, 4), 0, 1);
    return captain_cdr_put(w, at, 0, (size_t)1 << part->kind);
}

size_t captain_cdr_put_none(captain_cdr_writer *w, size_t at, const captain_cdr_shape *shape)
{
    for (uint32_t i = 0; i < shape->parts_count; i++)
        at = put_part(w, at, &shape->parts[i]);
    return at;
}

/* ---------------------------------------------------------------- skipping fields */

/* Limit of nested messages. Messages contain themselves through lists only; all others nest less deeply. */
enum { DEEPEST = CAPTAIN_MAX_DEPTH };

static size_t walk_number(captain_cdr_reader *r, size_t at, const captain_cdr_part *part, size_t size)
{
    at = captain_cdr_align(at, size) + size;
    return at <= r->size ? at : captain_cdr_cut(r, at - size, part->name);
}

static size_t walk_string(captain_cdr_reader *r, size_t at, const char *name)
{
    captain_octets octets;
    return captain_cdr_get_octets(r, at, &octets, name);
}

static size_t walk_numbers(captain_cdr_reader *r, size_t at, const captain_cdr_part *part, size_t size)
{
    uint32_t count;
    at = captain_cdr_get_count(r, at, size, &count, part->name);
    if (at == CAPTAIN_FAILED || count == 0)
        return at;
    at = captain_cdr_align(at, size) + count * size;
    return at <= r->size ? at : captain_cdr_cut(r, at - size, part->name);
}

static size_t walk_list(captain_cdr_reader *r, size_t at, const captain_cdr_part *part)
{
    captain_cdr_part element = *part;
    uint32_t count;
    if (part->kind < CAPTAIN_CDR_STRING)
        return walk_numbers(r, at, part, (size_t)1 << part->kind);
    element.is_list = false;
    at = captain_cdr_get_count(r, at, 1, &count, part->name);
    for (uint32_t i = 0; i < count && at != CAPTAIN_FAILED; i++)
        at = captain_cdr_walk_part(r, at, &element);
    return at;
}

size_t captain_cdr_walk_part(captain_cdr_reader *r, size_t at, const captain_cdr_part *part)
{
    if (part->is_list)
        return walk_list(r, at, part);
    if (part->kind == CAPTAIN_CDR_MESSAGE)
        return captain_cdr_skip(r, at, part->message, part->name);
    if (part->kind == CAPTAIN_CDR_STRING)
        return walk_string(r, at, part->name);
    return walk_number(r, at, part, (size_t)1 << part->kind);
}

size_t captain_cdr_walk(captain_cdr_reader *r, size_t at, const captain_cdr_shape *shape)
{
    if (++r->depth > DEEPEST)
        return captain_cdr_too_deep(r, at);
    for (uint32_t i = 0; i < shape->parts_count && at != CAPTAIN_FAILED; i++)
        at = captain_cdr_walk_part(r, at, &shape->parts[i]);
    r->depth--;
    return at;
}

/* ---------------------------------------------------------------- comparing with what put_none writes */

static bool is_zero(const uint8_t *octets, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (octets[i] != 0)
            return false;
    return true;
}

/* An empty string is a uint32 of 1 and a zero, or a uint32 of 0, as some writers encode it. */
static bool none_part(const uint8_t *octets, size_t size, size_t *at, const captain_cdr_part *part)
{
    size_t octets_count = part->is_list || part->kind == CAPTAIN_CDR_STRING ? 4 : (size_t)1 << part->kind;
    size_t to = captain_cdr_align(*at, octets_count);
    if (to + octets_count > size)
        return false;
    *at = to + octets_count;
    if (part->is_list || part->kind != CAPTAIN_CDR_STRING)
        return is_zero(octets + to, octets_count);
    if (is_zero(octets + to, 4))
        return true;
    bool is_empty = octets[to] == 1 && is_zero(octets + to + 1, 3) && *at < size && octets[*at] == 0;
    (*at)++;
    return is_empty;
}

static bool none_at(const uint8_t *octets, size_t size, size_t *at, const captain_cdr_part *part)
{
    if (part->kind != CAPTAIN_CDR_MESSAGE || part->is_list)
        return none_part(octets, size, at, part);
    bool all = true;
    for (uint32_t i = 0; i < part->message->parts_count && all; i++)
        all = none_at(octets, size, at, &part->message->parts[i]);
    return all;
}

bool captain_cdr_is_none_part(const uint8_t *octets, size_t size, size_t at, const captain_cdr_part *part)
{
    return none_at(octets, size, &at, part);
}

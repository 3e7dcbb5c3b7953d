/* Bits, lengths and open types of an encoding in the UNALIGNED variant (X.691 clause 11). */
#include "explain.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/* ---------------------------------------------------------------- steps */

captain_status explain_step(explain *to, const explain_node *node, unsigned what, size_t from, const char *text, const char *clause)
{
    if (to->on_step == NULL)
        return CAPTAIN_OK;
    captain_step step = {.bit = from, .width = to->at - from, .path = to->path.text, .type = node->type, .field = node->field,
                         .text = text, .clause = clause};
    memcpy(&step.what, &what, sizeof step.what);
    return to->on_step(to->context, &step) ? CAPTAIN_OK : CAPTAIN_NO_SPACE;
}

captain_status explain_number_step(explain *to, const explain_node *node, unsigned what, size_t from, uint64_t number, const char *clause)
{
    char text[24];
    snprintf(text, sizeof text, "%" PRIu64, number);
    return explain_step(to, node, what, from, text, clause);
}

captain_status explain_refuse(explain *to, size_t bit, captain_status status, const char *text)
{
    return captain_walk_refuse(to->report, &to->path, bit, status, "%s", text);
}

/* ---------------------------------------------------------------- bits, through the open types they are in */

static captain_status take_at(explain *to, unsigned level, unsigned width, uint64_t *bits);

/* The length of the next fragment of the open type at this level (11.9.3.5 to 11.9.3.8). */
static captain_status next_fragment(explain *to, unsigned level)
{
    explain_frame *frame = &to->frames[level - 1];
    size_t from = to->at;
    uint64_t first, second = 0;
    TRY(take_at(to, level - 1, 8, &first));
    frame->has_more = first >= 0xc0;
    if (first >= 0x80 && !frame->has_more)
        TRY(take_at(to, level - 1, 8, &second));
    if (frame->has_more && (first < 0xc1 || first > 0xc4))
        return explain_refuse(to, from, CAPTAIN_LENGTH, "a fragment has 1 to 4 times 16384 octets");
    uint64_t octets = frame->has_more ? (first & 0x3f) * 16384 : first < 0x80 ? first : (first & 0x3f) << 8 | second;
    frame->left = (size_t)octets * 8;
    explain_node node = {0};
    return explain_number_step(to, &node, CAPTAIN_STEP_OPEN, from, octets, frame->has_more ? "11.9.3.8" : first < 0x80 ? "11.9.3.6" : "11.9.3.7");
}

/* How many bits follow one another at this level, at least one where any is left. */
static captain_status ready_at(explain *to, unsigned level, size_t *ready)
{
    if (level == 0) {
        *ready = to->end - to->at;
        return *ready > 0 ? CAPTAIN_OK : explain_refuse(to, to->at, CAPTAIN_TRUNCATED, "the message ends here");
    }
    explain_frame *frame = &to->frames[level - 1];
    while (frame->left == 0) {
        if (!frame->has_more)
            return explain_refuse(to, to->at, CAPTAIN_TRUNCATED, "the open type ends before its value does");
        TRY(next_fragment(to, level));
    }
    TRY(ready_at(to, level - 1, ready));
    *ready = frame->left < *ready ? frame->left : *ready;
    return CAPTAIN_OK;
}

static void advance(explain *to, unsigned level, size_t bits)
{
    to->at += bits;
    for (; level > 0; level--)
        to->frames[level - 1].left -= bits;
}

static captain_status take_at(explain *to, unsigned level, unsigned width, uint64_t *bits)
{
    *bits = 0;
    while (width > 0) {
        size_t ready;
        TRY(ready_at(to, level, &ready));
        unsigned part = ready < width ? (unsigned)ready : width;
        for (size_t bit = to->at; bit < to->at + part; bit++)
            *bits = *bits << 1 | ((to->octets[bit / 8] >> (7 - bit % 8)) & 1);
        advance(to, level, part);
        width -= part;
    }
    return CAPTAIN_OK;
}

captain_status explain_require(explain *to, uint64_t bits)
{
    char text[96];
    for (unsigned level = to->frames_count; level > 0; level--) {
        const explain_frame *frame = &to->frames[level - 1];
        if (frame->has_more)
            continue;
        if (frame->left >= bits)
            return CAPTAIN_OK; /* what is around it holds the whole of it, or is in fragments */
        snprintf(text, sizeof text, "%" PRIu64 " bits are needed, the open type has %zu more", bits, frame->left);
        return explain_refuse(to, to->at, CAPTAIN_TRUNCATED, text);
    }
    if (to->end - to->at >= bits)
        return CAPTAIN_OK;
    snprintf(text, sizeof text, "%" PRIu64 " bits are needed, the message has %zu more", bits, to->end - to->at);
    return explain_refuse(to, to->at, CAPTAIN_TRUNCATED, text);
}

captain_status explain_take(explain *to, unsigned width, uint64_t *bits)
{
    TRY(explain_require(to, width));
    return take_at(to, to->frames_count, width, bits);
}

captain_status explain_skip(explain *to, uint64_t bits)
{
    TRY(explain_require(to, bits));
    while (bits > 0) {
        size_t ready;
        TRY(ready_at(to, to->frames_count, &ready));
        size_t part = ready < bits ? ready : (size_t)bits;
        advance(to, to->frames_count, part);
        bits -= part;
    }
    return CAPTAIN_OK;
}

captain_status explain_take_flags(explain *to, unsigned count, explain_flags *flags)
{
    TRY(explain_require(to, count));
    flags->count = count;
    for (unsigned i = 0; i < count; i++) {
        uint64_t bit;
        TRY(take_at(to, to->frames_count, 1, &bit));
        if (i % 8 == 0)
            flags->octets[i / 8] = 0;
        flags->octets[i / 8] = (uint8_t)(flags->octets[i / 8] | bit << (7 - i % 8));
    }
    return CAPTAIN_OK;
}

bool explain_flag(const explain_flags *flags, unsigned n)
{
    return n < flags->count && ((flags->octets[n / 8] >> (7 - n % 8)) & 1);
}

const char *explain_flags_text(const explain_flags *flags, char text[EXPLAIN_FLAGS_TEXT])
{
    unsigned shown = flags->count < EXPLAIN_FLAGS_TEXT - 4 ? flags->count : EXPLAIN_FLAGS_TEXT - 4;
    for (unsigned i = 0; i < shown; i++)
        text[i] = explain_flag(flags, i) ? '1' : '0';
    memcpy(text + shown, shown < flags->count ? "..." : "", shown < flags->count ? 4 : 1);
    return text;
}

/* ---------------------------------------------------------------- whole numbers and lengths */

unsigned explain_width(uint64_t range)
{
    unsigned width = 0;
    for (; range > 0; range >>= 1)
        width++;
    return width;
}

captain_status explain_extension_bit(explain *to, const explain_node *node, bool *is_extended, const char *clause)
{
    *is_extended = false;
    if (!(node->type->flags & CAPTAIN_EXTENSIBLE))
        return CAPTAIN_OK;
    size_t from = to->at;
    uint64_t bit;
    TRY(explain_take(to, 1, &bit));
    *is_extended = bit == 1;
    return explain_step(to, node, CAPTAIN_STEP_EXTENSION_BIT, from, bit ? "1" : "0", clause);
}

/* One length without bounds, and the clause it follows. */
static captain_status take_length(explain *to, explain_part *part, const char **clause)
{
    uint64_t first, second;
    part->bit = to->at;
    part->has_more = false;
    *clause = "11.9.3.6";
    TRY(explain_take(to, 8, &first));
    part->count = first;
    if (first < 0x80)
        return CAPTAIN_OK;
    if (first < 0xc0) {
        *clause = "11.9.3.7";
        TRY(explain_take(to, 8, &second));
        part->count = (first & 0x3f) << 8 | second;
        return CAPTAIN_OK;
    }
    *clause = "11.9.3.8";
    part->has_more = true;
    part->count = (first & 0x3f) * 16384;
    if (first < 0xc1 || first > 0xc4)
        return explain_refuse(to, part->bit, CAPTAIN_LENGTH, "a fragment has 1 to 4 times 16384 items");
    return CAPTAIN_OK;
}

captain_status explain_length(explain *to, const explain_node *node, explain_part *part)
{
    const char *clause;
    TRY(take_length(to, part, &clause));
    return explain_number_step(to, node, CAPTAIN_STEP_LENGTH, part->bit, part->count, clause);
}

/* The octets of a number, behind their length (11.7, 11.8). */
static captain_status take_number(explain *to, const explain_part *part, uint64_t *number)
{
    if (part->count == 0 || part->has_more)
        return explain_refuse(to, part->bit, CAPTAIN_LENGTH, "a number has 1 to 8 octets");
    if (part->count > 8)
        return explain_refuse(to, part->bit, CAPTAIN_RANGE, "the number has more than 64 bits");
    return explain_take(to, (unsigned)part->count * 8, number);
}

captain_status explain_whole(explain *to, const explain_node *node, uint64_t *number, unsigned *octets)
{
    explain_part part;
    TRY(explain_length(to, node, &part));
    *octets = (unsigned)part.count;
    return take_number(to, &part, number);
}

captain_status explain_small(explain *to, uint64_t *number)
{
    size_t from = to->at;
    uint64_t is_large;
    TRY(explain_take(to, 1, &is_large));
    if (!is_large)
        return explain_take(to, 6, number); /* 11.6.1 */
    const char *clause;
    explain_part part;
    TRY(take_length(to, &part, &clause)); /* 11.6.2 */
    TRY(take_number(to, &part, number));
    if (*number < CAPTAIN_UNKNOWN)
        return CAPTAIN_OK;
    char text[64];
    snprintf(text, sizeof text, "index %" PRIu64 " is larger than any that is kept", *number);
    return explain_refuse(to, from, CAPTAIN_RANGE, text);
}

captain_status explain_survey(explain *to, unsigned width, uint64_t *total)
{
    const explain before = *to;
    explain_part part = {.has_more = true};
    captain_status status = CAPTAIN_OK;
    const char *clause;
    to->on_step = NULL;
    for (*total = 0; part.has_more && status == CAPTAIN_OK;) {
        status = take_length(to, &part, &clause);
        *total += status == CAPTAIN_OK ? part.count : 0;
        if (status == CAPTAIN_OK && width == 0 && *total > EXPLAIN_MAX_EMPTY)
            status = explain_refuse(to, part.bit, CAPTAIN_SIZE, "nothing bounds the number of items without bits");
        if (status == CAPTAIN_OK)
            status = explain_skip(to, part.count * width);
    }
    *to = before;
    return status;
}

bool explain_is_counted(const captain_type *type, bool in_root)
{
    return in_root && !(type->flags & CAPTAIN_UNBOUNDED_HIGH) && type->high < 65536;
}

captain_status explain_check_size(explain *to, const captain_type *type, size_t bit, uint64_t count)
{
    if (captain_walk_in_size(type, count))
        return CAPTAIN_OK;
    char text[128], allowed[CAPTAIN_RANGE_TEXT];
    snprintf(text, sizeof text, "%" PRIu64 " %s are announced, %s are allowed", count, captain_size_noun(type),
             captain_size_text(type, allowed));
    return explain_refuse(to, bit, CAPTAIN_SIZE, text);
}

captain_status explain_size(explain *to, const explain_node *node, bool in_root, explain_part *part)
{
    const captain_type *type = node->type;
    if (!explain_is_counted(type, in_root))
        return explain_length(to, node, part);
    uint64_t range = (uint64_t)(type->high - type->low), offset;
    part->bit = to->at;
    part->has_more = false;
    TRY(explain_take(to, explain_width(range), &offset));
    part->count = (uint64_t)type->low + offset;
    TRY(explain_check_size(to, type, part->bit, part->count));
    return range == 0 ? CAPTAIN_OK : explain_number_step(to, node, CAPTAIN_STEP_LENGTH, part->bit, part->count, "11.9.4.1");
}

captain_status explain_bitmap_length(explain *to, const explain_node *node, unsigned *count)
{
    size_t from = to->at;
    uint64_t is_large, number;
    explain_part part = {0};
    const char *clause;
    TRY(explain_take(to, 1, &is_large));
    if (is_large) {
        TRY(take_length(to, &part, &clause));
        number = part.count;
    } else {
        TRY(explain_take(to, 6, &number));
        number++;
    }
    if (number == 0 || number > EXPLAIN_MAX_ADDITIONS || part.has_more)
        return explain_refuse(to, from, CAPTAIN_LENGTH, "the bitmap of the additions has no length that can be");
    *count = (unsigned)number;
    return explain_number_step(to, node, CAPTAIN_STEP_LENGTH, from, number, "19.7");
}

/* ---------------------------------------------------------------- open types */

/* All fragments of an open type are there and well formed before its value is looked at. */
static captain_status check_fragments(explain *to)
{
    const explain before = *to;
    captain_status status = CAPTAIN_OK;
    to->on_step = NULL;
    explain_frame *frame = &to->frames[to->frames_count - 1];
    while (status == CAPTAIN_OK && (frame->left > 0 || frame->has_more)) {
        status = explain_skip(to, frame->left);
        if (status == CAPTAIN_OK && frame->has_more)
            status = next_fragment(to, to->frames_count);
    }
    *to = before;
    return status;
}

captain_status explain_enter_open(explain *to, const explain_node *node, size_t *start)
{
    explain_part part;
    const char *clause;
    if (to->frames_count == CAPTAIN_MAX_DEPTH)
        return explain_refuse(to, to->at, CAPTAIN_DEPTH, "nested too deeply");
    TRY(take_length(to, &part, &clause));
    TRY(explain_require(to, part.count * 8));
    if (part.count == 0)
        return explain_refuse(to, part.bit, CAPTAIN_LENGTH, "an open type has at least one octet");
    TRY(explain_number_step(to, node, CAPTAIN_STEP_OPEN, part.bit, part.count, part.has_more ? clause : "11.2"));
    to->frames[to->frames_count++] = (explain_frame){(size_t)part.count * 8, part.has_more};
    *start = to->at;
    return part.has_more ? check_fragments(to) : CAPTAIN_OK;
}

captain_status explain_leave_open(explain *to, const explain_node *node, size_t start)
{
    explain_frame *frame = &to->frames[to->frames_count - 1];
    bool is_empty = to->at == start; /* of no bits: one zero octet stands for it (11.1.3) */
    while (frame->left == 0 && frame->has_more)
        TRY(next_fragment(to, to->frames_count));
    size_t from = to->at;
    if (frame->has_more || frame->left > (is_empty ? 8 : 7)) {
        char text[96];
        snprintf(text, sizeof text, "the open type is longer than its value by %zu octets", frame->left / 8);
        return explain_refuse(to, from, CAPTAIN_LENGTH, text);
    }
    uint64_t padding;
    unsigned width = (unsigned)frame->left;
    TRY(explain_take(to, width, &padding));
    to->frames_count--;
    if (padding != 0)
        return explain_refuse(to, from, CAPTAIN_LENGTH, "the padding of the open type is not zero");
    return width == 0 ? CAPTAIN_OK : explain_step(to, node, CAPTAIN_STEP_PADDING, from, "", "11.2.1");
}

/* What no edition here knows: the octets of the open type, its first ones as text. */
captain_status explain_unknown(explain *to, const explain_node *node, const char *clause)
{
    explain_part part = {.has_more = true};
    while (part.has_more) {
        const char *form;
        char text[2 * 32 + 8] = "";
        TRY(take_length(to, &part, &form));
        TRY(explain_number_step(to, node, CAPTAIN_STEP_OPEN, part.bit, part.count, part.has_more ? form : "11.2"));
        TRY(explain_require(to, part.count * 8));
        size_t from = to->at, used = 0;
        uint64_t left = part.count, octet;
        for (; left > 0 && used < 2 * 32; left--) {
            TRY(explain_take(to, 8, &octet));
            used += (size_t)snprintf(text + used, sizeof text - used, "%02X", (unsigned)octet);
        }
        TRY(explain_skip(to, left * 8));
        snprintf(text + used, sizeof text - used, "%s", left > 0 ? "..." : "");
        TRY(explain_step(to, node, CAPTAIN_STEP_UNKNOWN, from, text, clause));
    }
    return CAPTAIN_OK;
}

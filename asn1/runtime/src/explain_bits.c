/* Bits, lengths and open types of an encoding in the UNALIGNED variant (X.691 clause 11). */
#include "explain.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/* ---------------------------------------------------------------- steps */

static captain_status tell(explain *to, unsigned what, captain_step step)
{
    step.path = to->path.text;
    memcpy(&step.what, &what, sizeof step.what);
    return to->on_step(to->context, &step) ? CAPTAIN_OK : CAPTAIN_NO_SPACE;
}

captain_status captain_explain_step(explain *to, const explain_node *node, unsigned what, size_t from, const char *text,
                                    const char *clause)
{
    if (to->on_step == NULL)
        return CAPTAIN_OK;
    size_t width = to->taken > from ? to->taken - from : 0;
    TRY(tell(to, what, (captain_step){.bit = from, .width = width, .type = node->type, .field = node->field, .text = text, .clause = clause}));
    for (unsigned i = 0; i < to->headers_count; i++) {
        char octets[24];
        explain_header *header = &to->headers[i];
        snprintf(octets, sizeof octets, "%" PRIu64, header->octets);
        TRY(tell(to, CAPTAIN_STEP_OPEN, (captain_step){.bit = header->bit, .width = header->width, .text = octets, .clause = header->clause}));
    }
    to->headers_count = 0;
    return CAPTAIN_OK;
}

captain_status captain_explain_number_step(explain *to, const explain_node *node, unsigned what, size_t from, uint64_t number,
                                           const char *clause)
{
    char text[24];
    snprintf(text, sizeof text, "%" PRIu64, number);
    return captain_explain_step(to, node, what, from, text, clause);
}

captain_status captain_explain_refuse(explain *to, size_t bit, captain_status status, const char *text)
{
    return captain_walk_refuse(to->report, &to->path, bit, status, "%s", text);
}

/* ---------------------------------------------------------------- bits, through the open types they are in */

static captain_status take_at(explain *to, unsigned level, unsigned width, uint64_t *bits);
static captain_status ready_at(explain *to, unsigned level, size_t *ready);

captain_status captain_explain_next_fragment(explain *to, unsigned level)
{
    explain_frame *frame = &to->frames[level - 1];
    size_t ready;
    TRY(ready_at(to, level - 1, &ready)); /* what is around it may be in fragments as well, and its header stands first */
    size_t from = to->at;
    uint64_t first, second = 0;
    TRY(take_at(to, level - 1, 8, &first));
    frame->has_more = first >= 0xc0;
    if (first >= 0x80 && !frame->has_more)
        TRY(take_at(to, level - 1, 8, &second));
    if (frame->has_more && (first < 0xc1 || first > 0xc4))
        return captain_explain_refuse(to, from, CAPTAIN_LENGTH, "a fragment has 1 to 4 times 16384 octets");
    uint64_t octets = frame->has_more ? (first & 0x3f) * 16384 : first < 0x80 ? first : (first & 0x3f) << 8 | second;
    frame->left = (size_t)octets * 8;
    const char *clause = frame->has_more ? "11.9.3.8" : first < 0x80 ? "11.9.3.6" : "11.9.3.7";
    if (to->headers_count < EXPLAIN_MAX_HEADERS)
        to->headers[to->headers_count++] = (explain_header){from, to->at - from, octets, clause};
    return CAPTAIN_OK;
}

/* How many bits follow one another at this level, at least one where any is left. */
static captain_status ready_at(explain *to, unsigned level, size_t *ready)
{
    if (level == 0) {
        *ready = to->end - to->at;
        return *ready > 0 ? CAPTAIN_OK : captain_explain_refuse(to, to->at, CAPTAIN_TRUNCATED, "the message ends here");
    }
    explain_frame *frame = &to->frames[level - 1];
    while (frame->left == 0) {
        if (!frame->has_more)
            return captain_explain_refuse(to, to->at, CAPTAIN_TRUNCATED, "the open type ends before its value does");
        TRY(captain_explain_next_fragment(to, level));
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

/* Headers that follow at once belong to what was taken: the next value begins behind them. */
static captain_status settle(explain *to)
{
    to->taken = to->at;
    for (unsigned level = to->frames_count; level > 0; level--) {
        explain_frame *frame = &to->frames[level - 1];
        while (frame->left == 0 && frame->has_more)
            TRY(captain_explain_next_fragment(to, level));
    }
    return CAPTAIN_OK;
}

captain_status captain_explain_require(explain *to, uint64_t bits)
{
    char text[96];
    for (unsigned level = to->frames_count; level > 0; level--) {
        const explain_frame *frame = &to->frames[level - 1];
        if (frame->has_more)
            continue;
        if (frame->left >= bits)
            return CAPTAIN_OK; /* what is around it holds the whole of it, or is in fragments */
        snprintf(text, sizeof text, "%" PRIu64 " bits are needed, the open type has %zu more", bits, frame->left);
        return captain_explain_refuse(to, to->at, CAPTAIN_TRUNCATED, text);
    }
    if (to->end - to->at >= bits)
        return CAPTAIN_OK;
    snprintf(text, sizeof text, "%" PRIu64 " bits are needed, the message has %zu more", bits, to->end - to->at);
    return captain_explain_refuse(to, to->at, CAPTAIN_TRUNCATED, text);
}

captain_status captain_explain_take(explain *to, unsigned width, uint64_t *bits)
{
    TRY(captain_explain_require(to, width));
    TRY(take_at(to, to->frames_count, width, bits));
    return settle(to);
}

captain_status captain_explain_skip(explain *to, uint64_t bits)
{
    TRY(captain_explain_require(to, bits));
    while (bits > 0) {
        size_t ready;
        TRY(ready_at(to, to->frames_count, &ready));
        size_t part = ready < bits ? ready : (size_t)bits;
        advance(to, to->frames_count, part);
        bits -= part;
    }
    return settle(to);
}

captain_status captain_explain_take_flags(explain *to, unsigned count, explain_flags *flags)
{
    TRY(captain_explain_require(to, count));
    flags->count = count;
    for (unsigned i = 0; i < count; i++) {
        uint64_t bit;
        TRY(take_at(to, to->frames_count, 1, &bit));
        if (i % 8 == 0)
            flags->octets[i / 8] = 0;
        flags->octets[i / 8] = (uint8_t)(flags->octets[i / 8] | bit << (7 - i % 8));
    }
    return settle(to);
}

bool captain_explain_flag(const explain_flags *flags, unsigned n)
{
    return n < flags->count && ((flags->octets[n / 8] >> (7 - n % 8)) & 1);
}

const char *captain_explain_flags_text(const explain_flags *flags, char text[EXPLAIN_FLAGS_TEXT])
{
    unsigned shown = flags->count < EXPLAIN_FLAGS_TEXT - 4 ? flags->count : EXPLAIN_FLAGS_TEXT - 4;
    for (unsigned i = 0; i < shown; i++)
        text[i] = captain_explain_flag(flags, i) ? '1' : '0';
    memcpy(text + shown, shown < flags->count ? "..." : "", shown < flags->count ? 4 : 1);
    return text;
}

/* ---------------------------------------------------------------- whole numbers and lengths */

unsigned captain_explain_width(uint64_t range)
{
    unsigned width = 0;
    for (; range > 0; range >>= 1)
        width++;
    return width;
}

captain_status captain_explain_extension_bit(explain *to, const explain_node *node, bool *is_extended, const char *clause)
{
    *is_extended = false;
    if (!(node->type->flags & CAPTAIN_EXTENSIBLE))
        return CAPTAIN_OK;
    size_t from = to->at;
    uint64_t bit;
    TRY(captain_explain_take(to, 1, &bit));
    *is_extended = bit == 1;
    return captain_explain_step(to, node, CAPTAIN_STEP_EXTENSION_BIT, from, bit ? "1" : "0", clause);
}

captain_status captain_explain_take_length(explain *to, explain_part *part, const char **clause)
{
    uint64_t first, second;
    part->bit = to->at;
    part->has_more = false;
    *clause = "11.9.3.6";
    TRY(captain_explain_take(to, 8, &first));
    part->count = first;
    if (first < 0x80)
        return CAPTAIN_OK;
    if (first < 0xc0) {
        *clause = "11.9.3.7";
        TRY(captain_explain_take(to, 8, &second));
        part->count = (first & 0x3f) << 8 | second;
        return CAPTAIN_OK;
    }
    *clause = "11.9.3.8";
    part->has_more = true;
    part->count = (first & 0x3f) * 16384;
    if (first < 0xc1 || first > 0xc4)
        return captain_explain_refuse(to, part->bit, CAPTAIN_LENGTH, "a fragment has 1 to 4 times 16384 items");
    return CAPTAIN_OK;
}

captain_status captain_explain_length(explain *to, const explain_node *node, explain_part *part)
{
    const char *clause;
    TRY(captain_explain_take_length(to, part, &clause));
    return captain_explain_number_step(to, node, CAPTAIN_STEP_LENGTH, part->bit, part->count, clause);
}

/* The octets of a number, behind their length (11.7, 11.8). */
static captain_status take_number(explain *to, const explain_part *part, uint64_t *number)
{
    if (part->count == 0 || part->has_more)
        return captain_explain_refuse(to, part->bit, CAPTAIN_LENGTH, "a number has 1 to 8 octets");
    if (part->count > 8)
        return captain_explain_refuse(to, part->bit, CAPTAIN_RANGE, "the number has more than 64 bits");
    return captain_explain_take(to, (unsigned)part->count * 8, number);
}

captain_status captain_explain_whole(explain *to, const explain_node *node, uint64_t *number, unsigned *octets)
{
    explain_part part;
    TRY(captain_explain_length(to, node, &part));
    *octets = (unsigned)part.count;
    return take_number(to, &part, number);
}

captain_status captain_explain_small(explain *to, uint64_t *number)
{
    size_t from = to->at;
    uint64_t is_large;
    TRY(captain_explain_take(to, 1, &is_large));
    if (!is_large)
        return captain_explain_take(to, 6, number); /* 11.6.1 */
    const char *clause;
    explain_part part;
    TRY(captain_explain_take_length(to, &part, &clause)); /* 11.6.2 */
    TRY(take_number(to, &part, number));
    if (*number < CAPTAIN_UNKNOWN)
        return CAPTAIN_OK;
    char text[64];
    snprintf(text, sizeof text, "index %" PRIu64 " is larger than any that is kept", *number);
    return captain_explain_refuse(to, from, CAPTAIN_RANGE, text);
}

captain_status captain_explain_survey(explain *to, unsigned width, uint64_t *total)
{
    const explain before = *to;
    explain_part part = {.has_more = true};
    captain_status status = CAPTAIN_OK;
    const char *clause;
    to->on_step = NULL;
    for (*total = 0; part.has_more && status == CAPTAIN_OK;) {
        status = captain_explain_take_length(to, &part, &clause);
        *total += status == CAPTAIN_OK ? part.count : 0;
        if (status == CAPTAIN_OK && width == 0 && *total > EXPLAIN_MAX_EMPTY)
            status = captain_explain_refuse(to, part.bit, CAPTAIN_SIZE, "nothing bounds the number of items without bits");
        if (status == CAPTAIN_OK)
            status = captain_explain_skip(to, part.count * width);
    }
    *to = before;
    return status;
}

bool captain_explain_is_counted(const captain_type *type, bool in_root)
{
    return in_root && !(type->flags & CAPTAIN_UNBOUNDED_HIGH) && type->high < 65536;
}

captain_status captain_explain_check_size(explain *to, const captain_type *type, size_t bit, uint64_t count)
{
    if (captain_walk_in_size(type, count))
        return CAPTAIN_OK;
    char text[128], allowed[CAPTAIN_RANGE_TEXT];
    snprintf(text, sizeof text, "%" PRIu64 " %s are announced, %s are allowed", count, captain_size_noun(type),
             captain_size_text(type, allowed));
    return captain_explain_refuse(to, bit, CAPTAIN_SIZE, text);
}

captain_status captain_explain_size(explain *to, const explain_node *node, bool in_root, explain_part *part)
{
    const captain_type *type = node->type;
    if (!captain_explain_is_counted(type, in_root))
        return captain_explain_length(to, node, part);
    uint64_t range = (uint64_t)(type->high - type->low), offset;
    part->bit = to->at;
    part->has_more = false;
    TRY(captain_explain_take(to, captain_explain_width(range), &offset));
    part->count = (uint64_t)type->low + offset;
    TRY(captain_explain_check_size(to, type, part->bit, part->count));
    return range == 0 ? CAPTAIN_OK : captain_explain_number_step(to, node, CAPTAIN_STEP_LENGTH, part->bit, part->count, "11.9.4.1");
}

captain_status captain_explain_bitmap_length(explain *to, const explain_node *node, unsigned *count)
{
    size_t from = to->at;
    uint64_t is_large, number;
    explain_part part = {0};
    const char *clause;
    TRY(captain_explain_take(to, 1, &is_large));
    if (is_large) {
        TRY(captain_explain_take_length(to, &part, &clause));
        number = part.count;
    } else {
        TRY(captain_explain_take(to, 6, &number));
        number++;
    }
    if (number == 0 || number > EXPLAIN_MAX_ADDITIONS || part.has_more)
        return captain_explain_refuse(to, from, CAPTAIN_LENGTH, "the bitmap of the additions has no length that can be");
    *count = (unsigned)number;
    return captain_explain_number_step(to, node, CAPTAIN_STEP_LENGTH, from, number, "19.7");
}

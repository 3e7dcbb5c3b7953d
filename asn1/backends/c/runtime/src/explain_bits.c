/* Bits of an encoding, read through the enclosing open types, and the reporting of steps. */
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
    TRY(tell(to, what, (captain_step){.bit = from, .width = width, .type = node->type, .field = node->field, .text = text,
                                      .clause = clause}));
    for (unsigned i = 0; i < to->headers_count; i++) {
        char octets[24];
        const explain_header *at = &to->headers[i];
        snprintf(octets, sizeof octets, "%" PRIu64, at->octets);
        TRY(tell(to, CAPTAIN_STEP_OPEN, (captain_step){.bit = at->bit, .width = at->width, .text = octets, .clause = at->clause}));
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
    TRY(ready_at(to, level - 1, &ready)); /* the enclosing open type may be fragmented, too, and its header comes first */
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

/* Return how many contiguous bits follow at this level; at least one if any is left. */
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

/* Headers directly after a value belong to it: the next value begins after them. */
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
            return CAPTAIN_OK; /* the enclosing open type contains it completely, or is fragmented */
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

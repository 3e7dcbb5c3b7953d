/* Open types (X.691 11.2), with known and unknown contents. */
#include "explain.h"

#include <inttypes.h>
#include <stdio.h>

/* Check that all fragments are present and well formed, before the value is read. */
static captain_status check_fragments(explain *to)
{
    const explain before = *to;
    captain_status status = CAPTAIN_OK;
    to->on_step = NULL;
    explain_frame *frame = &to->frames[to->frames_count - 1];
    while (status == CAPTAIN_OK && frame->left > 0)
        status = captain_explain_skip(to, frame->left); /* skip to the header after it, and past the header */
    *to = before;
    return status;
}

captain_status captain_explain_enter_open(explain *to, const explain_node *node, size_t *start)
{
    explain_part part;
    const char *clause;
    if (to->frames_count == CAPTAIN_MAX_DEPTH)
        return captain_explain_refuse(to, to->at, CAPTAIN_DEPTH, "nested too deeply");
    TRY(captain_explain_take_length(to, &part, &clause));
    TRY(captain_explain_require(to, part.count * 8));
    if (part.count == 0)
        return captain_explain_refuse(to, part.bit, CAPTAIN_LENGTH, "an open type has at least one octet");
    TRY(captain_explain_number_step(to, node, CAPTAIN_STEP_OPEN, part.bit, part.count, part.has_more ? clause : "11.2"));
    to->frames[to->frames_count++] = (explain_frame){(size_t)part.count * 8, part.has_more};
    *start = to->at;
    return part.has_more ? check_fragments(to) : CAPTAIN_OK;
}

captain_status captain_explain_leave_open(explain *to, const explain_node *node, size_t start)
{
    explain_frame *frame = &to->frames[to->frames_count - 1];
    bool is_empty = to->at == start; /* contents without bits are encoded as one zero octet (11.1.3) */
    size_t from = to->at;
    if (frame->has_more || frame->left > (is_empty ? 8 : 7)) {
        char text[96];
        snprintf(text, sizeof text, "the open type is longer than its value by %zu octets", frame->left / 8);
        return captain_explain_refuse(to, from, CAPTAIN_LENGTH, text);
    }
    uint64_t padding;
    unsigned width = (unsigned)frame->left;
    TRY(captain_explain_take(to, width, &padding));
    to->frames_count--;
    if (padding != 0)
        return captain_explain_refuse(to, from, CAPTAIN_LENGTH, "the padding of the open type is not zero");
    return width == 0 ? CAPTAIN_OK : captain_explain_step(to, node, CAPTAIN_STEP_PADDING, from, "", "11.2.1");
}

/* Explain an unknown open type: the first octets are shown as text. */
captain_status captain_explain_unknown(explain *to, const explain_node *node, const char *clause)
{
    explain_part part = {.has_more = true};
    while (part.has_more) {
        const char *form;
        char text[2 * 32 + 8] = "";
        TRY(captain_explain_take_length(to, &part, &form));
        TRY(captain_explain_number_step(to, node, CAPTAIN_STEP_OPEN, part.bit, part.count, part.has_more ? form : "11.2"));
        TRY(captain_explain_require(to, part.count * 8));
        size_t from = to->at, used = 0;
        uint64_t left = part.count, octet;
        for (; left > 0 && used < 2 * 32; left--) {
            TRY(captain_explain_take(to, 8, &octet));
            used += (size_t)snprintf(text + used, sizeof text - used, "%02X", (unsigned)octet);
        }
        TRY(captain_explain_skip(to, left * 8));
        snprintf(text + used, sizeof text - used, "%s", left > 0 ? "..." : "");
        TRY(captain_explain_step(to, node, CAPTAIN_STEP_UNKNOWN, from, text, clause));
    }
    return CAPTAIN_OK;
}

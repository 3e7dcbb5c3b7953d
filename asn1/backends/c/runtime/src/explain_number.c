/* Whole numbers and lengths in the UNALIGNED variant (X.691 11.5 to 11.9). */
#include "explain.h"

#include <inttypes.h>
#include <stdio.h>

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

/* Read the octets of a number, after their length (11.7, 11.8). */
static captain_status take_number(explain *to, const explain_part *part, uint64_t *number)
{
    if (part->count == 0 || part->has_more)
        return captain_explain_refuse(to, part->bit, CAPTAIN_LENGTH, "a number has 1 to 8 octets");
    if (part->count > 8)
        return captain_explain_refuse(to, part->bit, CAPTAIN_RANGE, "the number has more than 64 bits");
    return captain_explain_take(to, (unsigned)part->count * 8, number);
}

captain_status captain_explain_whole(explain *to, const explain_node *node, uint64_t *number, unsigned *octets, size_t *from)
{
    explain_part part;
    TRY(captain_explain_length(to, node, &part));
    *octets = (unsigned)part.count;
    *from = to->at;
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

captain_status captain_explain_index(explain *to, const captain_type *type, bool is_extended, uint64_t *index)
{
    if (is_extended)
        return captain_explain_small(to, index);
    return captain_explain_take(to, captain_explain_width((uint64_t)type->root_count - 1), index);
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
            status = captain_walk_refuse(to->report, &to->path, part.bit, CAPTAIN_SIZE, EXPLAIN_EMPTY_TEXT, "characters");
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
    return captain_explain_number_step(to, node, CAPTAIN_STEP_LENGTH, from, number, "19.8");
}

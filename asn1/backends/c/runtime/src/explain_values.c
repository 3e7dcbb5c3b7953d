/* Values other than containers and strings (X.691 clauses 12 to 14, 18), and any value as a step. */
#include "explain.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/* ---------------------------------------------------------------- values as text */

typedef struct text_buffer {
    size_t used;
    char text[2 * EXPLAIN_PREVIEW + 128];
} text_buffer;

static bool keep_text(void *context, const char *text, size_t octets)
{
    text_buffer *buffer = context;
    size_t room = sizeof buffer->text - 4 - buffer->used;
    octets = octets < room ? octets : room;
    memcpy(buffer->text + buffer->used, text, octets);
    buffer->used += octets;
    return true;
}

captain_status captain_explain_value_step(explain *to, const explain_node *node, size_t from, const void *value, bool is_cut,
                                          const char *clause)
{
    if (to->on_step == NULL)
        return CAPTAIN_OK;
    text_buffer buffer = {.used = 0};
    captain_out out;
    captain_out_start(&out, keep_text, &buffer);
    captain_out_value(&out, node->type, node->field == NULL ? NULL : node->field->unit, value);
    out.status = CAPTAIN_OK; /* a character cut by a fragment is shown as "?" */
    captain_out_end(&out);
    if (!captain_utf8_is_valid(buffer.text, buffer.used))
        for (size_t i = 0; i < buffer.used; i++)
            buffer.text[i] = (unsigned char)buffer.text[i] > 0x7f ? '?' : buffer.text[i];
    memcpy(buffer.text + buffer.used, is_cut ? "..." : "", is_cut ? 4 : 1);
    return captain_explain_step(to, node, CAPTAIN_STEP_VALUE, from, buffer.text, clause);
}

static captain_status number_step(explain *to, explain_node *node, size_t from, int64_t number, const char *clause)
{
    uint64_t memory;
    captain_walk_set_number(node->type, &memory, number);
    node->number = number;
    node->has_number = true;
    return captain_explain_value_step(to, node, from, &memory, false, clause);
}

/* ---------------------------------------------------------------- BOOLEAN, INTEGER, ENUMERATED */

static captain_status boolean(explain *to, const explain_node *node)
{
    size_t from = to->at;
    uint64_t bit;
    TRY(captain_explain_take(to, 1, &bit));
    bool value = bit == 1;
    return captain_explain_value_step(to, node, from, &value, false, "12.2");
}

/* Extend the sign of a two's complement number (11.4). */
static int64_t sign_extended(uint64_t bits, unsigned octets)
{
    unsigned unused = 64 - 8 * octets;
    uint64_t sign = bits >> (8 * octets - 1) & 1;
    return (int64_t)(sign && unused > 0 ? bits | ~UINT64_C(0) << (64 - unused) : bits);
}

static captain_status refuse_number(explain *to, const captain_type *type, size_t from, int64_t number)
{
    char text[128], found[CAPTAIN_RANGE_TEXT], allowed[CAPTAIN_RANGE_TEXT];
    snprintf(text, sizeof text, "%s is not in %s", captain_number_text(type, number, found), captain_range_text(type, allowed));
    return captain_explain_refuse(to, from, CAPTAIN_RANGE, text);
}

static captain_status integer(explain *to, explain_node *node)
{
    const captain_type *type = node->type;
    bool is_extended;
    TRY(captain_explain_extension_bit(to, node, &is_extended, "13.1"));
    size_t from = to->at, digits;
    uint64_t bits = 0;
    unsigned octets;
    if (is_extended || (type->flags & CAPTAIN_UNBOUNDED_LOW)) {
        TRY(captain_explain_whole(to, node, &bits, &octets, &digits));
        int64_t number = sign_extended(bits, octets);
        if (!is_extended && !captain_walk_in_range(type, number))
            return refuse_number(to, type, from, number);
        return number_step(to, node, digits, number, is_extended ? "13.1" : "13.2.4");
    }
    if (type->flags & CAPTAIN_UNBOUNDED_HIGH) {
        TRY(captain_explain_whole(to, node, &bits, &octets, &digits));
        if (bits > (uint64_t)INT64_MAX - (uint64_t)type->low)
            return captain_explain_refuse(to, from, CAPTAIN_RANGE, "the number has more than 64 bits");
        return number_step(to, node, digits, (int64_t)((uint64_t)type->low + bits), "13.2.3");
    }
    uint64_t range = (uint64_t)type->high - (uint64_t)type->low;
    TRY(captain_explain_take(to, captain_explain_width(range), &bits));
    int64_t number = (int64_t)((uint64_t)type->low + bits);
    if (bits > range)
        return refuse_number(to, type, from, number);
    return number_step(to, node, from, number, range == 0 ? "13.2.1" : "13.2.2");
}

static captain_status enumerated(explain *to, explain_node *node)
{
    const captain_type *type = node->type;
    bool is_extended;
    TRY(captain_explain_extension_bit(to, node, &is_extended, "14.3"));
    size_t from = to->at;
    uint64_t index;
    TRY(captain_explain_index(to, type, is_extended, &index));
    uint64_t limit = is_extended ? CAPTAIN_UNKNOWN : type->root_count;
    if (index >= limit) {
        char text[96];
        snprintf(text, sizeof text, "item %" PRIu64 " does not exist: there are %u, counted from 0", index, type->root_count);
        return captain_explain_refuse(to, from, CAPTAIN_ALTERNATIVE, text);
    }
    if (is_extended)
        index += type->root_count;
    int64_t number = index < type->names_count ? type->names[index].value : CAPTAIN_UNKNOWN + (int64_t)index - type->root_count;
    return number_step(to, node, from, number, is_extended ? "14.3" : "14.2");
}

static captain_status small_bits(explain *to, explain_node *node)
{
    size_t from = to->at;
    uint64_t bits;
    TRY(captain_explain_take(to, (unsigned)node->type->high, &bits));
    uint8_t memory[8];
    captain_walk_set_number(node->type, memory, (int64_t)bits);
    return captain_explain_value_step(to, node, from, memory, false, node->type->high <= 16 ? "16.9" : "16.10");
}

/* ---------------------------------------------------------------- by kind */

captain_status captain_explain_simple(explain *to, explain_node *node)
{
    switch (node->type->kind) {
    case CAPTAIN_BOOLEAN: return boolean(to, node);
    case CAPTAIN_NULL: return captain_explain_value_step(to, node, to->at, NULL, false, "18");
    case CAPTAIN_INTEGER: return integer(to, node);
    case CAPTAIN_ENUMERATED: return enumerated(to, node);
    case CAPTAIN_SMALL_BITS: return small_bits(to, node);
    default: return captain_explain_string(to, node);
    }
}

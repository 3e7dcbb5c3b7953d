/* Values that are no containers (X.691 clauses 12 to 18, 24, 25, 30). */
#include "explain.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/* ---------------------------------------------------------------- values as text */

/* A value step shows this much of a string. */
enum { PREVIEW = 512 };

typedef struct text_buffer {
    size_t used;
    char text[2 * PREVIEW + 128];
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

static captain_status value_step(explain *to, const explain_node *node, size_t from, const void *value, bool is_cut, const char *clause)
{
    if (to->on_step == NULL)
        return CAPTAIN_OK;
    text_buffer buffer = {.used = 0};
    captain_out out;
    captain_out_start(&out, keep_text, &buffer);
    captain_out_value(&out, node->type, value);
    out.status = CAPTAIN_OK; /* a character cut in two by a fragment: shown as "?" */
    captain_out_end(&out);
    if (!captain_utf8_is_valid(buffer.text, buffer.used))
        for (size_t i = 0; i < buffer.used; i++)
            buffer.text[i] = buffer.text[i] < 0 ? '?' : buffer.text[i];
    memcpy(buffer.text + buffer.used, is_cut ? "..." : "", is_cut ? 4 : 1);
    return explain_step(to, node, CAPTAIN_STEP_VALUE, from, buffer.text, clause);
}

static captain_status number_step(explain *to, explain_node *node, size_t from, int64_t number, const char *clause)
{
    uint64_t memory;
    captain_walk_set_number(node->type, &memory, number);
    node->number = number;
    node->has_number = true;
    return value_step(to, node, from, &memory, false, clause);
}

/* ---------------------------------------------------------------- BOOLEAN, INTEGER, ENUMERATED */

static captain_status boolean(explain *to, const explain_node *node)
{
    size_t from = to->at;
    uint64_t bit;
    TRY(explain_take(to, 1, &bit));
    bool value = bit == 1;
    return value_step(to, node, from, &value, false, "12.2");
}

/* From the octets of a two's complement number (11.4). */
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
    return explain_refuse(to, from, CAPTAIN_RANGE, text);
}

static captain_status integer(explain *to, explain_node *node)
{
    const captain_type *type = node->type;
    bool is_extended;
    TRY(explain_extension_bit(to, node, &is_extended, "13.1"));
    size_t from = to->at;
    uint64_t bits = 0;
    unsigned octets;
    if (is_extended || (type->flags & CAPTAIN_UNBOUNDED_LOW)) {
        TRY(explain_whole(to, node, &bits, &octets));
        int64_t number = sign_extended(bits, octets);
        if (!is_extended && !captain_walk_in_range(type, number))
            return refuse_number(to, type, from, number);
        return number_step(to, node, to->at - 8 * octets, number, is_extended ? "13.1" : "13.2.4");
    }
    if (type->flags & CAPTAIN_UNBOUNDED_HIGH) {
        TRY(explain_whole(to, node, &bits, &octets));
        if (bits > (uint64_t)INT64_MAX - (uint64_t)type->low)
            return explain_refuse(to, from, CAPTAIN_RANGE, "the number has more than 64 bits");
        return number_step(to, node, to->at - 8 * octets, (int64_t)((uint64_t)type->low + bits), "13.2.3");
    }
    uint64_t range = (uint64_t)type->high - (uint64_t)type->low;
    TRY(explain_take(to, explain_width(range), &bits));
    int64_t number = (int64_t)((uint64_t)type->low + bits);
    if (bits > range)
        return refuse_number(to, type, from, number);
    return number_step(to, node, from, number, range == 0 ? "13.2.1" : "13.2.2");
}

static captain_status enumerated(explain *to, explain_node *node)
{
    const captain_type *type = node->type;
    bool is_extended;
    TRY(explain_extension_bit(to, node, &is_extended, "14.3"));
    size_t from = to->at;
    uint64_t index;
    if (is_extended)
        TRY(explain_small(to, &index));
    else
        TRY(explain_take(to, explain_width((uint64_t)type->root_count - 1), &index));
    uint64_t limit = is_extended ? CAPTAIN_UNKNOWN : type->root_count;
    if (index >= limit) {
        char text[96];
        snprintf(text, sizeof text, "item %" PRIu64 " does not exist: there are %u, counted from 0", index, type->root_count);
        return explain_refuse(to, from, CAPTAIN_ALTERNATIVE, text);
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
    TRY(explain_take(to, (unsigned)node->type->high, &bits));
    uint8_t memory[8];
    captain_walk_set_number(node->type, memory, (int64_t)bits);
    return value_step(to, node, from, memory, false, node->type->high <= 16 ? "16.9" : "16.10");
}

/* ---------------------------------------------------------------- strings */

/* What a string type says where: whether it has bounds that are seen, and its clauses. */
typedef struct string_rules {
    unsigned item_bits;
    bool has_bounds;
    const char *extension, *empty, *fixed, *variable;
} string_rules;

static string_rules rules_of(const captain_type *type)
{
    switch (type->kind) {
    case CAPTAIN_BIT_STRING: return (string_rules){1, true, "16.6", "16.8", type->high <= 16 ? "16.9" : "16.10", "16.11"};
    case CAPTAIN_FIXED_OCTETS:
    case CAPTAIN_OCTET_STRING: return (string_rules){8, true, "17.3", "17.5", type->high <= 2 ? "17.6" : "17.7", "17.8"};
    case CAPTAIN_UTF8: return (string_rules){8, false, "30.6", "30.6", "30.6", "30.6"};
    case CAPTAIN_OID: return (string_rules){8, false, "24", "24", "24", "24"};
    case CAPTAIN_RELATIVE_OID: return (string_rules){8, false, "25", "25", "25", "25"};
    default: return (string_rules){type->character_bits, true, "30.4", "30.5.5", "30.5.6", "30.5.7"};
    }
}

/* A string on its way through its parts. */
typedef struct string_state {
    const captain_type *type;
    bool in_root;          /* of its size */
    unsigned width;        /* bits of an item */
    captain_utf8 utf8;
    bool begins, is_wrong; /* of an object identifier: a number begins; one began with 0x80 (X.690 8.19.2) */
} string_state;

/* The character that the bits of a known-multiplier string stand for, or -1 (30.5.4). */
static int32_t character(const string_state *state, uint32_t bits)
{
    int32_t last = -1, code;
    for (uint32_t n = 0; (code = captain_walk_character(state->type, state->in_root, n)) >= 0; n++)
        last = code;
    if (last >> state->width != 0)
        return captain_walk_character(state->type, state->in_root, bits);
    return captain_walk_has_character(state->type, state->in_root, bits) ? (int32_t)bits : -1;
}

static captain_status take_item(explain *to, string_state *state, uint64_t n, uint64_t *item)
{
    size_t from = to->at;
    TRY(explain_take(to, state->width, item));
    if (state->type->kind == CAPTAIN_UTF8 && !captain_utf8_feed(&state->utf8, (uint8_t)*item))
        return explain_refuse(to, from, CAPTAIN_ALPHABET, "the octets are not UTF-8");
    state->is_wrong |= state->begins && *item == 0x80;
    state->begins = *item < 0x80;
    if (!captain_walk_is_string(state->type) || state->type->kind == CAPTAIN_UTF8)
        return CAPTAIN_OK;
    int32_t code = character(state, (uint32_t)*item);
    if (code < 0) {
        char text[128];
        snprintf(text, sizeof text, "character %" PRIu64 ", bits of value %" PRIu64 ", is not in the alphabet of %.40s", n + 1, *item,
                 captain_type_text(state->type));
        return explain_refuse(to, from, CAPTAIN_ALPHABET, text);
    }
    *item = (uint64_t)code;
    return CAPTAIN_OK;
}

static captain_status preview_step(explain *to, const explain_node *node, size_t from, const uint8_t *items, uint64_t count, bool is_cut, const char *clause)
{
    captain_octets octets = {(uint32_t)count, items};
    captain_bits bits = {(uint32_t)count, items};
    switch (node->type->kind) {
    case CAPTAIN_BIT_STRING: return value_step(to, node, from, &bits, is_cut, clause);
    case CAPTAIN_FIXED_OCTETS: return value_step(to, node, from, items, is_cut, clause);
    default: return value_step(to, node, from, &octets, is_cut, clause);
    }
}

/* The items of one part, with as many of them as text as a step shows. */
static captain_status part_of_string(explain *to, const explain_node *node, string_state *state, uint64_t count, const char *clause)
{
    uint8_t items[PREVIEW] = {0};
    size_t from = to->at, most = state->width == 1 ? 8 * PREVIEW : PREVIEW;
    TRY(explain_require(to, count * state->width));
    bool is_plain = node->type->kind == CAPTAIN_BIT_STRING || node->type->kind == CAPTAIN_OCTET_STRING || state->width == 0;
    uint64_t read = is_plain && count > most ? most : count;
    for (uint64_t i = 0; i < read; i++) {
        uint64_t item;
        TRY(take_item(to, state, i, &item));
        if (i >= most)
            continue;
        if (node->type->kind == CAPTAIN_BIT_STRING)
            items[i / 8] = (uint8_t)(items[i / 8] | item << (7 - i % 8));
        else
            items[i] = (uint8_t)item;
    }
    TRY(explain_skip(to, (count - read) * state->width));
    return preview_step(to, node, from, items, count < most ? count : most, count > most, clause);
}

static captain_status end_of_string(explain *to, const string_state *state, size_t from, uint64_t total)
{
    bool is_oid = state->type->kind == CAPTAIN_OID || state->type->kind == CAPTAIN_RELATIVE_OID;
    if (state->utf8.left > 0)
        return explain_refuse(to, from, CAPTAIN_ALPHABET, "the octets are not UTF-8: the last character is cut");
    if (is_oid && (total == 0 || state->is_wrong || !state->begins))
        return explain_refuse(to, from, CAPTAIN_RANGE, "the octets are no object identifier");
    return CAPTAIN_OK;
}

static captain_status string(explain *to, explain_node *node)
{
    string_rules rules = rules_of(node->type);
    string_state state = {.type = node->type, .in_root = true, .width = rules.item_bits, .begins = true};
    bool is_extended = false;
    size_t from = to->at;
    uint64_t total = 0;
    if (rules.has_bounds)
        TRY(explain_extension_bit(to, node, &is_extended, rules.extension));
    state.in_root = !is_extended;
    if (is_extended && captain_walk_is_string(node->type))
        state.width = node->type->kind == CAPTAIN_NUMERIC ? 4 : 7;
    bool is_counted = rules.has_bounds && explain_is_counted(node->type, !is_extended);
    if (!is_counted)
        TRY(explain_survey(to, state.width, &total));
    if (!is_counted && rules.has_bounds && !is_extended)
        TRY(explain_check_size(to, node->type, from, total));
    explain_part part = {.has_more = true};
    while (part.has_more) {
        TRY(is_counted ? explain_size(to, node, true, &part) : explain_length(to, node, &part));
        const char *clause = is_counted && node->type->low == node->type->high ? rules.fixed : rules.variable;
        TRY(part_of_string(to, node, &state, part.count, part.count == 0 ? rules.empty : clause));
    }
    return end_of_string(to, &state, from, is_counted ? part.count : total);
}

captain_status explain_simple(explain *to, explain_node *node)
{
    switch (node->type->kind) {
    case CAPTAIN_BOOLEAN: return boolean(to, node);
    case CAPTAIN_NULL: return value_step(to, node, to->at, NULL, false, "18");
    case CAPTAIN_INTEGER: return integer(to, node);
    case CAPTAIN_ENUMERATED: return enumerated(to, node);
    case CAPTAIN_SMALL_BITS: return small_bits(to, node);
    default: return string(to, node);
    }
}

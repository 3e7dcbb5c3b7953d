/* Strings (X.691 clauses 16, 17, 24, 25, 30). */
#include "explain.h"

#include <inttypes.h>
#include <stdio.h>

/* Rules of a string type: whether PER sees its bounds, and its clauses; NULL if it has no clause of its own. */
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
    case CAPTAIN_UTF8: return (string_rules){8, false, "30.6", NULL, "30.6", "30.6"};
    case CAPTAIN_OID: return (string_rules){8, false, "24", NULL, "24", "24"};
    case CAPTAIN_RELATIVE_OID: return (string_rules){8, false, "25", NULL, "25", "25"};
    default: return (string_rules){type->character_bits, true, "30.4", NULL, "30.5.6", "30.5.7"};
    }
}

/* State of a string that is read in parts. */
typedef struct string_state {
    const captain_type *type;
    bool in_root;          /* the extension bit of its size is 0 */
    unsigned width;        /* bits per item */
    captain_utf8 utf8;
    bool begins, is_wrong; /* for object identifiers: an arc begins; an arc began with 0x80 (X.690 8.19.2) */
} string_state;

/* Return the character for the bits of a known-multiplier string, or -1 (30.5.4). */
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
    TRY(captain_explain_take(to, state->width, item));
    if (state->type->kind == CAPTAIN_UTF8 && !captain_utf8_feed(&state->utf8, (uint8_t)*item))
        return captain_explain_refuse(to, from, CAPTAIN_ALPHABET, "the octets are not UTF-8");
    state->is_wrong |= state->begins && *item == 0x80;
    state->begins = *item < 0x80;
    if (!captain_walk_is_string(state->type) || state->type->kind == CAPTAIN_UTF8)
        return CAPTAIN_OK;
    int32_t code = character(state, (uint32_t)*item);
    if (code < 0) {
        char text[128];
        snprintf(text, sizeof text, "character %" PRIu64 ", bits of value %" PRIu64 ", is not in the alphabet of %.40s", n + 1, *item,
                 captain_type_text(state->type));
        return captain_explain_refuse(to, from, CAPTAIN_ALPHABET, text);
    }
    *item = (uint64_t)code;
    return CAPTAIN_OK;
}

static captain_status preview_step(explain *to, const explain_node *node, size_t from, const uint8_t *items, uint64_t count,
                                   bool is_cut, const char *clause)
{
    captain_octets octets = {(uint32_t)count, items};
    captain_bits bits = {(uint32_t)count, items};
    switch (node->type->kind) {
    case CAPTAIN_BIT_STRING: return captain_explain_value_step(to, node, from, &bits, is_cut, clause);
    case CAPTAIN_FIXED_OCTETS: return captain_explain_value_step(to, node, from, items, is_cut, clause);
    default: return captain_explain_value_step(to, node, from, &octets, is_cut, clause);
    }
}

/* Read the items of one part, and add them to the text of the step, up to its limit. */
static captain_status part_of_string(explain *to, const explain_node *node, string_state *state, uint64_t count,
                                     const char *clause)
{
    uint8_t items[EXPLAIN_PREVIEW] = {0};
    size_t from = to->at, most = state->width == 1 ? 8 * EXPLAIN_PREVIEW : EXPLAIN_PREVIEW;
    TRY(captain_explain_require(to, count * state->width));
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
    TRY(captain_explain_skip(to, (count - read) * state->width));
    return preview_step(to, node, from, items, count < most ? count : most, count > most, clause);
}

static captain_status end_of_string(explain *to, const string_state *state, size_t from, uint64_t total)
{
    bool is_oid = state->type->kind == CAPTAIN_OID || state->type->kind == CAPTAIN_RELATIVE_OID;
    if (state->utf8.left > 0)
        return captain_explain_refuse(to, from, CAPTAIN_ALPHABET, "the octets are not UTF-8: the last character is cut");
    if (is_oid && (total == 0 || state->is_wrong || !state->begins))
        return captain_explain_refuse(to, from, CAPTAIN_RANGE, "the octets are no object identifier");
    return CAPTAIN_OK;
}

captain_status captain_explain_string(explain *to, explain_node *node)
{
    string_rules rules = rules_of(node->type);
    string_state state = {.type = node->type, .in_root = true, .width = rules.item_bits, .begins = true};
    bool is_extended = false;
    size_t from = to->at;
    uint64_t total = 0;
    if (rules.has_bounds)
        TRY(captain_explain_extension_bit(to, node, &is_extended, rules.extension));
    state.in_root = !is_extended;
    if (is_extended && captain_walk_is_string(node->type))
        state.width = node->type->kind == CAPTAIN_NUMERIC ? 4 : 7;
    bool is_counted = rules.has_bounds && captain_explain_is_counted(node->type, !is_extended);
    if (!is_counted)
        TRY(captain_explain_survey(to, state.width, &total));
    if (!is_counted && rules.has_bounds && !is_extended)
        TRY(captain_explain_check_size(to, node->type, from, total));
    explain_part part = {.has_more = true};
    while (part.has_more) {
        TRY(is_counted ? captain_explain_size(to, node, true, &part) : captain_explain_length(to, node, &part));
        const char *clause = is_counted && node->type->low == node->type->high ? rules.fixed : rules.variable;
        TRY(part_of_string(to, node, &state, part.count, part.count == 0 && rules.empty != NULL ? rules.empty : clause));
    }
    return end_of_string(to, &state, from, is_counted ? part.count : total);
}

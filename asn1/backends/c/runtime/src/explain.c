/* Explanation of containers, and the two public functions (X.691 clauses 11, 19 to 23). */
#include "explain.h"

#include <inttypes.h>
#include <stdio.h>

static captain_status explain_value(explain *to, explain_node *node);

/* ---------------------------------------------------------------- SEQUENCE */

/* Recent INTEGERs of a SEQUENCE, which may select later open types. A few are sufficient, because selectors are close. */
enum { REMEMBERED = 4 };
typedef struct sequence {
    const explain_node *node;
    struct { unsigned index; int64_t number; } ids[REMEMBERED];
    unsigned ids_count;
} sequence;

static bool is_selector(const captain_type *type, unsigned index)
{
    for (unsigned i = 0; i < type->fields_count; i++)
        if (type->fields[i].type->kind == CAPTAIN_OPEN && type->fields[i].type->selector == index)
            return true;
    return false;
}

static captain_status component(explain *to, sequence *of, unsigned index)
{
    const captain_type *type = of->node->type;
    const captain_field *field = &type->fields[index];
    explain_node node = {field->type, field, 0, false};
    for (unsigned i = 0; field->type->kind == CAPTAIN_OPEN && i < of->ids_count && i < REMEMBERED; i++) {
        if (of->ids[i].index != field->type->selector)
            continue;
        node.number = of->ids[i].number;
        node.has_number = true;
    }
    size_t path = captain_path_push(&to->path, field->name);
    TRY(explain_value(to, &node));
    captain_path_pop(&to->path, path);
    if (node.has_number && field->type->kind != CAPTAIN_OPEN && is_selector(type, index)) {
        of->ids[of->ids_count % REMEMBERED].index = index;
        of->ids[of->ids_count++ % REMEMBERED].number = node.number;
    }
    return CAPTAIN_OK;
}

/* Return whether the preamble has a bit for a component (19.2; in a group 19.9). */
static bool has_bit(const captain_field *field)
{
    if (field->flags & CAPTAIN_DEFAULT)
        return true;
    return field->addition == 0 ? (field->flags & CAPTAIN_OPTIONAL) != 0 : !(field->flags & CAPTAIN_MANDATORY);
}

/* Explain components first <= i < last, with the preamble of their presence bits. */
static captain_status components(explain *to, sequence *of, unsigned first, unsigned last, const char *clause)
{
    const captain_field *fields = of->node->type->fields;
    uint8_t octets[EXPLAIN_MAX_OPTIONAL / 8];
    char text[EXPLAIN_FLAGS_TEXT];
    explain_flags present = {0, octets};
    unsigned count = 0, k = 0;
    for (unsigned i = first; i < last; i++)
        count += has_bit(&fields[i]);
    size_t from = to->at;
    if (count > EXPLAIN_MAX_OPTIONAL)
        return captain_explain_refuse(to, from, CAPTAIN_LENGTH, "the type has more optional components than can be explained");
    TRY(captain_explain_take_flags(to, count, &present));
    if (count > 0)
        TRY(captain_explain_step(to, of->node, CAPTAIN_STEP_PRESENCE, from, captain_explain_flags_text(&present, text),
                                 clause));
    for (unsigned i = first; i < last; i++)
        if (!has_bit(&fields[i]) || captain_explain_flag(&present, k++))
            TRY(component(to, of, i));
    return CAPTAIN_OK;
}

/* Explain a present addition. index: counted from 0. */
static captain_status addition(explain *to, sequence *of, unsigned index)
{
    const captain_type *type = of->node->type;
    unsigned first = type->root_count, last;
    if (index >= type->additions_count) {
        size_t path = captain_path_push_addition(&to->path, index);
        explain_node unknown = {0};
        TRY(captain_explain_unknown(to, &unknown, "19.9"));
        captain_path_pop(&to->path, path);
        return CAPTAIN_OK;
    }
    while (first < type->fields_count && type->fields[first].addition != index + 1)
        first++;
    for (last = first; last < type->fields_count && type->fields[last].addition == index + 1;)
        last++;
    size_t start;
    explain_node node = {type, first < last ? &type->fields[first] : NULL, 0, false};
    TRY(captain_explain_enter_open(to, &node, &start));
    if (first < last && (type->fields[first].flags & CAPTAIN_GROUP))
        TRY(components(to, of, first, last, "19.9"));
    else if (first < last)
        TRY(component(to, of, first));
    return captain_explain_leave_open(to, &node, start);
}

static captain_status additions(explain *to, sequence *of)
{
    uint8_t octets[EXPLAIN_MAX_ADDITIONS / 8 + 1];
    char text[EXPLAIN_FLAGS_TEXT];
    explain_flags present = {0, octets};
    unsigned count;
    TRY(captain_explain_bitmap_length(to, of->node, &count));
    size_t from = to->at;
    TRY(captain_explain_take_flags(to, count, &present));
    TRY(captain_explain_step(to, of->node, CAPTAIN_STEP_PRESENCE, from, captain_explain_flags_text(&present, text), "19.7"));
    for (unsigned i = 0; i < count; i++)
        if (captain_explain_flag(&present, i))
            TRY(addition(to, of, i));
    return CAPTAIN_OK;
}

static captain_status explain_sequence(explain *to, const explain_node *node)
{
    sequence of = {.node = node};
    bool is_extended;
    TRY(captain_explain_extension_bit(to, node, &is_extended, "19.1"));
    TRY(components(to, &of, 0, node->type->root_count, "19.2"));
    return is_extended ? additions(to, &of) : CAPTAIN_OK;
}

/* ---------------------------------------------------------------- CHOICE */

static captain_status alternative(explain *to, const explain_node *node, unsigned index, bool is_extended)
{
    const captain_field *field = &node->type->fields[index];
    explain_node inner = {field->type, field, 0, false};
    size_t start, path = captain_path_push(&to->path, field->name);
    if (is_extended)
        TRY(captain_explain_enter_open(to, &inner, &start));
    TRY(explain_value(to, &inner));
    if (is_extended)
        TRY(captain_explain_leave_open(to, &inner, start));
    captain_path_pop(&to->path, path);
    return CAPTAIN_OK;
}

static captain_status unknown_alternative(explain *to, uint64_t index)
{
    size_t path = captain_path_push_addition(&to->path, index);
    explain_node unknown = {0};
    TRY(captain_explain_unknown(to, &unknown, "23.8"));
    captain_path_pop(&to->path, path);
    return CAPTAIN_OK;
}

static captain_status explain_choice(explain *to, const explain_node *node)
{
    const captain_type *type = node->type;
    bool is_extended;
    TRY(captain_explain_extension_bit(to, node, &is_extended, "23.5"));
    size_t from = to->at;
    uint64_t index;
    TRY(captain_explain_index(to, type, is_extended, &index));
    char text[96];
    if (index >= (is_extended ? (uint64_t)CAPTAIN_UNKNOWN : type->root_count)) {
        snprintf(text, sizeof text, "alternative %" PRIu64 " does not exist: there are %u, counted from 0", index, type->root_count);
        return captain_explain_refuse(to, from, CAPTAIN_ALTERNATIVE, text);
    }
    uint64_t place = is_extended ? index + type->root_count : index;
    snprintf(text, sizeof text, "[%" PRIu64 "]", index);
    const char *name = place < type->fields_count ? type->fields[place].name : text;
    TRY(captain_explain_step(to, node, CAPTAIN_STEP_CHOICE, from, name,
                             is_extended ? "23.8" : type->flags & CAPTAIN_EXTENSIBLE ? "23.7" : "23.6"));
    return place < type->fields_count ? alternative(to, node, (unsigned)place, is_extended) : unknown_alternative(to, index);
}

/* ---------------------------------------------------------------- SEQUENCE OF, SET OF */

/* Elements without bits are all equal, so only the first one is reported. */
static captain_status elements(explain *to, const explain_node *node, uint64_t first, uint64_t count)
{
    uint64_t least = captain_explain_least_bits(node->type->element);
    TRY(captain_explain_require(to, count * least));
    for (uint64_t i = 0; i < count; i++) {
        explain_node element = {node->type->element, NULL, 0, false};
        size_t before = to->at, path = captain_path_push_index(&to->path, first + i);
        TRY(explain_value(to, &element));
        captain_path_pop(&to->path, path);
        if (to->at > before)
            continue;
        if (first + count > EXPLAIN_MAX_EMPTY)
            return captain_walk_refuse(to->report, &to->path, before, CAPTAIN_SIZE, EXPLAIN_EMPTY_TEXT, "elements");
        break;
    }
    return CAPTAIN_OK;
}

static captain_status explain_list(explain *to, const explain_node *node)
{
    bool is_extended;
    uint64_t total = 0;
    TRY(captain_explain_extension_bit(to, node, &is_extended, "20.4"));
    size_t from = to->at;
    explain_part part = {.has_more = true};
    for (; part.has_more; total += part.count) {
        TRY(captain_explain_size(to, node, !is_extended, &part));
        TRY(elements(to, node, total, part.count));
    }
    return is_extended ? CAPTAIN_OK : captain_explain_check_size(to, node->type, from, total);
}

/* ---------------------------------------------------------------- open types, and any type */

static captain_status explain_open(explain *to, const explain_node *node)
{
    const captain_type *type = node->has_number ? captain_walk_row(node->type, node->number) : NULL;
    if (type == NULL)
        return captain_explain_unknown(to, node, "11.2");
    explain_node inner = {type, node->field, 0, false};
    size_t start;
    TRY(captain_explain_enter_open(to, node, &start));
    TRY(explain_value(to, &inner));
    return captain_explain_leave_open(to, node, start);
}

static captain_status container(explain *to, const explain_node *node)
{
    switch (node->type->kind) {
    case CAPTAIN_SEQUENCE: return explain_sequence(to, node);
    case CAPTAIN_CHOICE: return explain_choice(to, node);
    case CAPTAIN_LIST: return explain_list(to, node);
    default: return explain_open(to, node);
    }
}

static const char *container_clause(const captain_type *type)
{
    switch (type->kind) {
    case CAPTAIN_SEQUENCE: return "19";
    case CAPTAIN_CHOICE: return "23";
    case CAPTAIN_LIST: return "20";
    default: return "11.2";
    }
}

static captain_status explain_value(explain *to, explain_node *node)
{
    if (node->type->kind < CAPTAIN_SEQUENCE)
        return captain_explain_simple(to, node);
    unsigned again = node->type->flags & CAPTAIN_RECURS ? 1 : 0;
    if (to->depth == CAPTAIN_MAX_DEPTH || to->recursion + again > CAPTAIN_WALK_RECURSION)
        return captain_explain_refuse(to, to->at, CAPTAIN_DEPTH, "nested too deeply");
    to->depth++;
    to->recursion += again;
    TRY(captain_explain_step(to, node, CAPTAIN_STEP_ENTER, to->at, "", container_clause(node->type)));
    TRY(container(to, node));
    to->recursion -= again;
    to->depth--;
    return captain_explain_step(to, node, CAPTAIN_STEP_LEAVE, to->at, "", container_clause(node->type));
}

/* ---------------------------------------------------------------- the message */

/* Check the padding: zeros to the end of the octet, and nothing after it (11.1.3). An empty encoding is one zero octet. */
static captain_status padding(explain *to, const captain_type *type)
{
    explain_node node = {.type = type};
    size_t from = to->at, octets = to->at == 0 ? 1 : (to->at + 7) / 8;
    uint64_t bits;
    if (octets * 8 > to->end)
        return captain_explain_refuse(to, from, CAPTAIN_TRUNCATED, "an encoding has at least one octet");
    TRY(captain_explain_take(to, (unsigned)(octets * 8 - from), &bits));
    if (bits != 0)
        return captain_explain_refuse(to, from, CAPTAIN_TRAILING, "the padding of the last octet is not zero");
    if (to->at > from)
        TRY(captain_explain_step(to, &node, CAPTAIN_STEP_PADDING, from, "", "11.1.3"));
    if (to->at == to->end)
        return CAPTAIN_OK;
    char text[64];
    snprintf(text, sizeof text, "%zu octets follow the end of the message", (to->end - to->at) / 8);
    return captain_explain_refuse(to, to->at, CAPTAIN_TRAILING, text);
}

static captain_status explain_message(const captain_type *type, const void *octets, size_t size, bool exact,
                                      captain_on_step on_step,
                                      void *context, captain_report *report)
{
    explain to = {.octets = octets, .end = (size < SIZE_MAX / 8 ? size : SIZE_MAX / 8) * 8, .on_step = on_step,
                  .context = context,
                  .report = report};
    explain_node node = {.type = type};
    captain_report_clear(report);
    TRY(explain_value(&to, &node));
    if (report != NULL)
        report->bit = to.at;
    return exact ? padding(&to, type) : CAPTAIN_OK;
}

captain_status captain_explain(const captain_type *type, const void *octets, size_t size, captain_on_step on_step,
                               void *context, captain_report *report)
{
    return explain_message(type, octets, size, true, on_step, context, report);
}

captain_status captain_explain_decode(const captain_type *type, const void *octets, size_t size, bool exact,
                                      captain_report *report)
{
    return explain_message(type, octets, size, exact, NULL, NULL, report);
}

/* Every ::= SEQUENCE {
 *   flag BOOLEAN, nothing NULL, small INTEGER {none(300)} (-10..300), wide INTEGER (0..10, ...), free INTEGER, positive INTEGER (5..MAX),
 *   colour ENUMERATED {red(0), green(5), ..., blue(2)}, mask BIT STRING {a(0), b(1), c(6)} (SIZE(7)),
 *   named BIT STRING {x(0), y(9)} (SIZE(0..20)), big BIT STRING (SIZE(70)), loose BIT STRING (SIZE(1..4, ...)),
 *   key OCTET STRING (SIZE(3)), data OCTET STRING (SIZE(1..4, ...)), name IA5String (SIZE(1..8)), digits NumericString (SIZE(2)),
 *   code VisibleString (FROM("0".."9" | "A".."F")) (SIZE(0..4, ...)), label PrintableString, text UTF8String (SIZE(0..3)),
 *   oid OBJECT IDENTIFIER, arcs RELATIVE-OID, limit INTEGER (0..7) DEFAULT 3, maybe INTEGER (0..255) OPTIONAL,
 *   list SEQUENCE (SIZE(1..3, ...)) OF INTEGER (0..15 | 20..31), nulls SEQUENCE OF NULL,
 *   which CHOICE {number INTEGER (0..255), inner Inner, ..., extra BOOLEAN, blob OCTET STRING}, next Every OPTIONAL,
 *   id INTEGER (0..15), value CLASS.&Type({1 small | 2 Inner}{@id}),
 *   ..., first BOOLEAN, [[ high INTEGER (0..255), low BOOLEAN OPTIONAL, step INTEGER (0..7) DEFAULT 3 ]] }
 * Inner ::= SEQUENCE { a INTEGER (0..3), b BOOLEAN OPTIONAL }
 */
#include "every.h"

#include <string.h>

#define COUNT(ARRAY) (sizeof(ARRAY) / sizeof *(ARRAY))
#define NAMES(ARRAY) .names = ARRAY, .names_count = COUNT(ARRAY)
#define NUMBER(WIDTH, LOW, HIGH) .kind = CAPTAIN_INTEGER, .width = WIDTH, .size = WIDTH, .low = LOW, .high = HIGH
#define STRING(KIND, LOW, HIGH) .kind = KIND, .size = sizeof(captain_octets), .low = LOW, .high = HIGH

typedef struct Inner { uint8_t a; bool has_b; bool b; } Inner;

static const captain_type flag = {.name = "Flag", .kind = CAPTAIN_BOOLEAN, .size = 1};
static const captain_type nothing = {.name = "Nothing", .kind = CAPTAIN_NULL, .size = 1};
static const captain_name small_names[] = {{"none", 300}};
static const captain_type small = {.name = "Small", .unit = "0.1 m", NUMBER(2, -10, 300), .flags = CAPTAIN_SIGNED, NAMES(small_names)};
static const captain_type wide = {.name = "Wide", NUMBER(8, 0, 10), .flags = CAPTAIN_SIGNED | CAPTAIN_EXTENSIBLE};
static const captain_type free_ = {.name = "Free", NUMBER(8, 0, 0), .flags = CAPTAIN_SIGNED | CAPTAIN_UNBOUNDED_LOW | CAPTAIN_UNBOUNDED_HIGH};
static const captain_type positive = {.name = "Positive", NUMBER(8, 5, 0), .flags = CAPTAIN_SIGNED | CAPTAIN_UNBOUNDED_HIGH};
static const captain_name colour_names[] = {{"red", 0}, {"green", 5}, {"blue", 2}};
static const captain_type colour = {.name = "Colour", .kind = CAPTAIN_ENUMERATED, .size = 4, .width = 4, .flags = CAPTAIN_EXTENSIBLE, NAMES(colour_names), .root_count = 2};
static const captain_name mask_names[] = {{"a", 0}, {"b", 1}, {"c", 6}};
static const captain_type mask = {.name = "Mask", .kind = CAPTAIN_SMALL_BITS, .size = 1, .width = 1, .low = 7, .high = 7, NAMES(mask_names)};
static const captain_name named_names[] = {{"x", 0}, {"y", 9}};
static const captain_type named = {.name = "Named", STRING(CAPTAIN_BIT_STRING, 0, 20), .flags = CAPTAIN_NAMED_BITS, NAMES(named_names)};
static const captain_type big = {.name = "Big", STRING(CAPTAIN_BIT_STRING, 70, 70)};
static const captain_type loose = {.name = "Loose", STRING(CAPTAIN_BIT_STRING, 1, 4), .flags = CAPTAIN_EXTENSIBLE};
static const captain_type key = {.name = "Key", .kind = CAPTAIN_FIXED_OCTETS, .size = 3, .low = 3, .high = 3};
static const captain_type data = {.name = "Data", STRING(CAPTAIN_OCTET_STRING, 1, 4), .flags = CAPTAIN_EXTENSIBLE};
static const captain_type blob = {.name = "Blob", STRING(CAPTAIN_OCTET_STRING, 0, 0), .flags = CAPTAIN_UNBOUNDED_HIGH};
static const captain_type name_ = {.name = "Name", STRING(CAPTAIN_IA5, 1, 8), .character_bits = 7};
static const captain_type digits = {.name = "Digits", STRING(CAPTAIN_NUMERIC, 2, 2), .character_bits = 4};
static const captain_range code_alphabet[] = {{'0', '9'}, {'A', 'F'}};
static const captain_type code = {.name = "Code", STRING(CAPTAIN_VISIBLE, 0, 4), .flags = CAPTAIN_EXTENSIBLE, .character_bits = 4, .alphabet = code_alphabet, .alphabet_count = 2};
static const captain_type label = {.name = "Label", STRING(CAPTAIN_PRINTABLE, 0, 0), .flags = CAPTAIN_UNBOUNDED_HIGH, .character_bits = 7};
static const captain_type text = {.name = "Text", STRING(CAPTAIN_UTF8, 0, 3), .character_bits = 8};
static const captain_type oid = {.name = "Oid", STRING(CAPTAIN_OID, 0, 0), .flags = CAPTAIN_UNBOUNDED_HIGH};
static const captain_type arcs = {.name = "Arcs", STRING(CAPTAIN_RELATIVE_OID, 0, 0), .flags = CAPTAIN_UNBOUNDED_HIGH};
static const captain_type limit = {.name = "Limit", NUMBER(1, 0, 7)};
static const uint8_t limit_default = 3;
static const captain_type octet = {.name = "Octet", NUMBER(1, 0, 255)};
static const captain_range item_gaps[] = {{16, 19}};
static const captain_type item = {.name = "Item", NUMBER(1, 0, 31), .gaps = item_gaps, .gaps_count = 1};
static const captain_type list = {.name = "List", STRING(CAPTAIN_LIST, 1, 3), .flags = CAPTAIN_EXTENSIBLE, .element = &item};
static const captain_type nulls = {.name = "Nulls", STRING(CAPTAIN_LIST, 0, 0), .flags = CAPTAIN_UNBOUNDED_HIGH, .element = &nothing};
static const captain_type id = {.name = "Id", NUMBER(1, 0, 15)};
static const captain_type two = {.name = "Two", NUMBER(1, 0, 3)};

static const captain_field inner_fields[] = {
    {.name = "a", .type = &two, .offset = offsetof(Inner, a), .present = CAPTAIN_NOWHERE},
    {.name = "b", .type = &flag, .offset = offsetof(Inner, b), .present = offsetof(Inner, has_b), .flags = CAPTAIN_OPTIONAL},
};
static const captain_type inner = {.name = "Inner", .kind = CAPTAIN_SEQUENCE, .size = sizeof(Inner), .fields = inner_fields, .fields_count = 2, .root_count = 2, .additions = CAPTAIN_NOWHERE};

typedef struct Which { uint32_t choice; union { uint8_t number; Inner *inner; bool extra; captain_octets blob, unknown; } u; } Which;
static const captain_field which_fields[] = {
    {.name = "number", .type = &octet, .unit = "m", .offset = offsetof(Which, u), .present = CAPTAIN_NOWHERE},
    {.name = "inner", .type = &inner, .offset = offsetof(Which, u), .present = CAPTAIN_NOWHERE, .flags = CAPTAIN_POINTER},
    {.name = "extra", .type = &flag, .offset = offsetof(Which, u), .present = CAPTAIN_NOWHERE, .addition = 1},
    {.name = "blob", .type = &blob, .offset = offsetof(Which, u), .present = CAPTAIN_NOWHERE, .addition = 2},
};
static const captain_type which = {.name = "Which", .kind = CAPTAIN_CHOICE, .size = sizeof(Which), .flags = CAPTAIN_EXTENSIBLE, .fields = which_fields, .fields_count = 4, .root_count = 2, .additions_count = 2};

typedef struct Every {
    bool flag, nothing;
    int16_t small;
    int64_t wide, free_, positive;
    int32_t colour;
    uint8_t mask;
    captain_bits named, big, loose;
    uint8_t key[3];
    captain_octets data;
    captain_text name, digits, code, label, text;
    captain_octets oid, arcs;
    bool has_limit;
    uint8_t limit;
    bool has_maybe;
    uint8_t maybe;
    struct { uint32_t count; uint8_t *items; } list;
    struct { uint32_t count; bool *items; } nulls;
    Which which;
    bool has_next;
    struct Every *next;
    uint8_t id;
    captain_open value;
    bool has_first, first;
    bool has_high;
    uint8_t high;
    bool has_low, low;
    bool has_step;
    uint8_t step;
    const captain_additions *additions;
} Every;

extern const captain_type every;
static const captain_row value_rows[] = {{1, &small}, {2, &inner}};
static const captain_type value = {.name = "Value", .kind = CAPTAIN_OPEN, .size = sizeof(captain_open), .rows = value_rows, .rows_count = 2, .selector = 26};

#define FIELD(NAME, MEMBER, TYPE) .name = NAME, .type = &TYPE, .offset = offsetof(Every, MEMBER)
#define ALWAYS(NAME, MEMBER, TYPE) {FIELD(NAME, MEMBER, TYPE), .present = CAPTAIN_NOWHERE}
static const captain_field every_fields[] = {
    ALWAYS("flag", flag, flag), ALWAYS("nothing", nothing, nothing), ALWAYS("small", small, small), ALWAYS("wide", wide, wide),
    ALWAYS("free", free_, free_), ALWAYS("positive", positive, positive), ALWAYS("colour", colour, colour), ALWAYS("mask", mask, mask),
    ALWAYS("named", named, named), ALWAYS("big", big, big), ALWAYS("loose", loose, loose), ALWAYS("key", key, key),
    ALWAYS("data", data, data), ALWAYS("name", name, name_), ALWAYS("digits", digits, digits), ALWAYS("code", code, code),
    ALWAYS("label", label, label), ALWAYS("text", text, text), ALWAYS("oid", oid, oid), ALWAYS("arcs", arcs, arcs),
    {FIELD("limit", limit, limit), .present = offsetof(Every, has_limit), .flags = CAPTAIN_OPTIONAL | CAPTAIN_DEFAULT, .default_value = &limit_default},
    {FIELD("maybe", maybe, octet), .present = offsetof(Every, has_maybe), .flags = CAPTAIN_OPTIONAL, .unit = "dB"},
    ALWAYS("list", list, list), ALWAYS("nulls", nulls, nulls), ALWAYS("which", which, which),
    {FIELD("next", next, every), .present = offsetof(Every, has_next), .flags = CAPTAIN_OPTIONAL | CAPTAIN_POINTER},
    ALWAYS("id", id, id), ALWAYS("value", value, value),
    {FIELD("first", first, flag), .present = offsetof(Every, has_first), .addition = 1, .flags = CAPTAIN_OPTIONAL | CAPTAIN_MANDATORY},
    {FIELD("high", high, octet), .present = offsetof(Every, has_high), .addition = 2, .flags = CAPTAIN_OPTIONAL | CAPTAIN_GROUP | CAPTAIN_MANDATORY},
    {FIELD("low", low, flag), .present = offsetof(Every, has_low), .addition = 2, .flags = CAPTAIN_OPTIONAL | CAPTAIN_GROUP},
    {FIELD("step", step, limit), .present = offsetof(Every, has_step), .addition = 2, .flags = CAPTAIN_OPTIONAL | CAPTAIN_GROUP | CAPTAIN_DEFAULT, .default_value = &limit_default},
};
const captain_type every = {.name = "Every", .kind = CAPTAIN_SEQUENCE, .size = sizeof(Every), .flags = CAPTAIN_EXTENSIBLE, .fields = every_fields,
                            .fields_count = COUNT(every_fields), .root_count = 28, .additions_count = 2, .additions = offsetof(Every, additions)};

/* Short ones for encodings written by hand. */
typedef struct Growing { uint8_t a; bool has_b, b; bool has_high; uint8_t high; bool has_low, low; const captain_additions *additions; } Growing;
static const captain_field growing_fields[] = {
    {.name = "a", .type = &two, .offset = offsetof(Growing, a), .present = CAPTAIN_NOWHERE},
    {.name = "b", .type = &flag, .offset = offsetof(Growing, b), .present = offsetof(Growing, has_b), .addition = 1, .flags = CAPTAIN_OPTIONAL | CAPTAIN_MANDATORY},
    {.name = "high", .type = &octet, .offset = offsetof(Growing, high), .present = offsetof(Growing, has_high), .addition = 2, .flags = CAPTAIN_OPTIONAL | CAPTAIN_GROUP | CAPTAIN_MANDATORY},
    {.name = "low", .type = &flag, .offset = offsetof(Growing, low), .present = offsetof(Growing, has_low), .addition = 2, .flags = CAPTAIN_OPTIONAL | CAPTAIN_GROUP},
};
static const captain_type growing = {.name = "Growing", .kind = CAPTAIN_SEQUENCE, .size = sizeof(Growing), .flags = CAPTAIN_EXTENSIBLE, .fields = growing_fields,
                                     .fields_count = 4, .root_count = 1, .additions_count = 2, .additions = offsetof(Growing, additions)};

typedef struct Selected { uint8_t id; captain_open value; } Selected;
static const captain_type selected_value = {.name = "Value", .kind = CAPTAIN_OPEN, .size = sizeof(captain_open), .rows = value_rows, .rows_count = 2, .selector = 0};
static const captain_field selected_fields[] = {
    {.name = "id", .type = &id, .offset = offsetof(Selected, id), .present = CAPTAIN_NOWHERE},
    {.name = "value", .type = &selected_value, .offset = offsetof(Selected, value), .present = CAPTAIN_NOWHERE},
};
static const captain_type selected = {.name = "Selected", .kind = CAPTAIN_SEQUENCE, .size = sizeof(Selected), .fields = selected_fields, .fields_count = 2, .root_count = 2, .additions = CAPTAIN_NOWHERE};

/* Endless: a list of itself. */
extern const captain_type deep;
const captain_type deep = {.name = "Deep", STRING(CAPTAIN_LIST, 0, 0), .flags = CAPTAIN_UNBOUNDED_HIGH, .element = &deep};

const captain_type *every_find(const char *name)
{
    static const captain_type *const others[] = {&every, &inner, &growing, &selected, &deep, &blob};
    for (unsigned i = 0; i < COUNT(others); i++)
        if (strcmp(others[i]->name, name) == 0)
            return others[i];
    for (unsigned i = 0; i < COUNT(every_fields); i++)
        if (strcmp(every_fields[i].name, name) == 0)
            return every_fields[i].type;
    return NULL;
}

const captain_message *const captain_messages[] = {NULL};
const size_t captain_messages_count = 0;

/* Writer of JSON: the forms of X.697, and the additional ones of runtime.h. */
#include "plain.h"

typedef struct writer {
    captain_out out;
    unsigned depth;
    bool is_plain;
    const char *unit; /* of the component that is written; NULL to use that of its type */
} writer;

static void put_value(writer *to, const captain_type *type, const void *value);

static void put_hex(writer *to, const uint8_t *octets, size_t count)
{
    captain_out_character(&to->out, '"');
    captain_out_hex(&to->out, octets, count);
    captain_out_character(&to->out, '"');
}

static void put_name(writer *to, const char *name)
{
    captain_out_character(&to->out, '"');
    captain_out_string(&to->out, name);
    captain_out_string(&to->out, "\":");
}

/* "[3]" */
static void put_bracket(writer *to, uint32_t number)
{
    captain_out_string(&to->out, "\"[");
    captain_out_integer(&to->out, number);
    captain_out_string(&to->out, "]\"");
}

static void put_text(writer *to, const char *text)
{
    captain_out_character(&to->out, '"');
    captain_out_string(&to->out, text);
    captain_out_character(&to->out, '"');
}

static void put_integer(writer *to, const captain_type *type, int64_t number)
{
    char text[PLAIN_TEXT];
    const char *unit = to->unit != NULL ? to->unit : type->unit;
    const char *special = to->is_plain ? captain_plain_special(type, number) : NULL;
    if (special != NULL)
        put_text(to, special);
    else if (to->is_plain && unit != NULL)
        captain_out_string(&to->out, captain_plain_text(type, captain_plain_of(type, unit), number, text));
    else
        captain_out_number(&to->out, type, number);
}

/* Write the names of the set bits as a list: "[7]" for a bit without a name. */
static void put_named_bits(writer *to, const captain_type *type, const void *value)
{
    const char *between = "";
    uint32_t count = captain_walk_bits(type, value);
    captain_out_character(&to->out, '[');
    for (uint32_t i = 0; i < count; i++) {
        if (!captain_walk_bit(type, value, i))
            continue;
        const char *name = captain_walk_name(type, i);
        captain_out_string(&to->out, between);
        if (name != NULL)
            put_text(to, name);
        else
            put_bracket(to, i);
        between = ",";
    }
    captain_out_character(&to->out, ']');
}

/* A BIT STRING of fixed size is hexadecimal text only (X.697 24). */
static void put_bits(writer *to, const captain_type *type, const void *value)
{
    bool is_fixed = captain_walk_is_fixed(type);
    uint32_t count = type->kind == CAPTAIN_SMALL_BITS ? (uint32_t)type->high : ((const captain_bits *)value)->count;
    captain_out_string(&to->out, is_fixed ? "\"" : "{\"value\":\"");
    captain_out_bits_hex(&to->out, type, value, count);
    captain_out_character(&to->out, '"');
    if (is_fixed)
        return;
    captain_out_string(&to->out, ",\"length\":");
    captain_out_integer(&to->out, count);
    captain_out_character(&to->out, '}');
}

static void put_item(writer *to, const captain_type *type, int64_t number)
{
    const char *name = captain_walk_name(type, number);
    if (name != NULL) {
        put_text(to, name);
    } else if (number >= CAPTAIN_UNKNOWN) {
        put_bracket(to, (uint32_t)(number - CAPTAIN_UNKNOWN));
    } else if (to->out.status == CAPTAIN_OK) {
        to->out.status = CAPTAIN_ALTERNATIVE;
    }
}

static void put_additions(writer *to, const captain_type *type, const void *value, const char *between)
{
    const captain_additions *additions = captain_walk_additions(type, value);
    for (uint32_t i = 0; additions != NULL && i < additions->count; i++) {
        captain_out_string(&to->out, between);
        put_bracket(to, additions->unknown[i].index);
        captain_out_character(&to->out, ':');
        put_hex(to, additions->unknown[i].octets.octets, additions->unknown[i].octets.count);
        between = ",";
    }
    if (captain_walk_bitmap(additions) == 0)
        return;
    captain_out_string(&to->out, between);
    captain_out_string(&to->out, "\"[]\":");
    captain_out_integer(&to->out, additions->bits);
}

static void put_sequence(writer *to, const captain_type *type, const void *value)
{
    const char *between = "";
    captain_out_character(&to->out, '{');
    for (unsigned i = 0; i < type->fields_count; i++) {
        const void *component = captain_walk_shown(&type->fields[i], value);
        if (component == NULL && !captain_walk_is_present(&type->fields[i], value))
            continue;
        captain_out_string(&to->out, between);
        put_name(to, type->fields[i].name);
        to->unit = type->fields[i].unit;
        put_value(to, type->fields[i].type, component);
        between = ",";
    }
    put_additions(to, type, value, between);
    captain_out_character(&to->out, '}');
}

static void put_choice(writer *to, const captain_type *type, const void *value)
{
    uint32_t choice = *(const uint32_t *)value;
    captain_out_character(&to->out, '{');
    if (choice >= CAPTAIN_UNKNOWN) {
        const captain_octets *octets = captain_walk_unknown(type, value);
        put_bracket(to, choice - CAPTAIN_UNKNOWN);
        captain_out_character(&to->out, ':');
        put_hex(to, octets->octets, octets->count);
    } else if (choice > 0 && choice <= type->fields_count) {
        const captain_field *field = &type->fields[choice - 1];
        put_name(to, field->name);
        to->unit = field->unit;
        put_value(to, field->type, captain_walk_field(field, value));
    } else if (to->out.status == CAPTAIN_OK) {
        to->out.status = CAPTAIN_ALTERNATIVE;
    }
    captain_out_character(&to->out, '}');
}

static void put_list(writer *to, const captain_type *type, captain_list list)
{
    captain_out_character(&to->out, '[');
    for (uint32_t i = 0; i < list.count; i++) {
        to->unit = NULL;
        captain_out_string(&to->out, i == 0 ? "" : ",");
        put_value(to, type->element, (const char *)list.items + (size_t)i * type->element->size);
    }
    captain_out_character(&to->out, ']');
}

static void put_open(writer *to, const captain_open *open)
{
    to->unit = NULL;
    if (open->type == NULL)
        put_hex(to, open->octets.octets, open->octets.count);
    else
        put_value(to, open->type, open->value);
}

static void put_string(writer *to, const captain_type *type, captain_octets octets)
{
    switch (type->kind) {
    case CAPTAIN_OCTET_STRING: put_hex(to, octets.octets, octets.count); return;
    case CAPTAIN_OID:
    case CAPTAIN_RELATIVE_OID:
        captain_out_character(&to->out, '"');
        captain_out_oid(&to->out, type->kind == CAPTAIN_RELATIVE_OID, &octets);
        captain_out_character(&to->out, '"');
        return;
    default: captain_out_quoted(&to->out, (const char *)octets.octets, octets.count);
    }
}

static void put_known(writer *to, const captain_type *type, const void *value)
{
    switch (type->kind) {
    case CAPTAIN_BOOLEAN: captain_out_string(&to->out, *(const bool *)value ? "true" : "false"); break;
    case CAPTAIN_NULL: captain_out_string(&to->out, "null"); break;
    case CAPTAIN_INTEGER: put_integer(to, type, captain_walk_number(type, value)); break;
    case CAPTAIN_ENUMERATED: put_item(to, type, captain_walk_number(type, value)); break;
    case CAPTAIN_SMALL_BITS:
    case CAPTAIN_BIT_STRING:
        if (to->is_plain && (type->flags & CAPTAIN_NAMED_BITS))
            put_named_bits(to, type, value);
        else
            put_bits(to, type, value);
        break;
    case CAPTAIN_FIXED_OCTETS: put_hex(to, value, (size_t)type->high); break;
    case CAPTAIN_SEQUENCE: put_sequence(to, type, value); break;
    case CAPTAIN_CHOICE: put_choice(to, type, value); break;
    case CAPTAIN_LIST: put_list(to, type, captain_walk_list(value)); break;
    case CAPTAIN_OPEN: put_open(to, value); break;
    default: put_string(to, type, captain_walk_octets(value));
    }
}

static void put_value(writer *to, const captain_type *type, const void *value)
{
    if (to->out.status != CAPTAIN_OK)
        return;
    if (value == NULL) {
        to->out.status = CAPTAIN_PRESENCE;
    } else if (to->depth >= CAPTAIN_WALK_DEPTH) {
        to->out.status = CAPTAIN_DEPTH;
    } else {
        to->depth++;
        put_known(to, type, value);
        to->depth--;
    }
}

static captain_status write_whole(writer *to, const captain_type *type, const void *value, captain_sink sink, void *context)
{
    captain_out_start(&to->out, sink, context);
    put_value(to, type, value);
    return captain_out_end(&to->out);
}

captain_status captain_json_write(const captain_type *type, const void *value, captain_sink sink, void *context)
{
    writer to = {.depth = 0};
    return write_whole(&to, type, value, sink, context);
}

captain_status captain_json_write_plain(const captain_type *type, const void *value, captain_sink sink, void *context)
{
    writer to = {.is_plain = true};
    return write_whole(&to, type, value, sink, context);
}

/* Output of a value as an indented tree, one field per line. */
#include "walk.h"

typedef struct print {
    captain_out out;
    unsigned depth;
} print;

static void put_value(print *to, const captain_type *type, const char *unit, const void *value, unsigned indent);

static void put_label(print *to, unsigned indent, const char *name)
{
    captain_out_blanks(&to->out, indent);
    captain_out_string(&to->out, name);
    captain_out_character(&to->out, ':');
}

static void put_number_label(print *to, unsigned indent, uint32_t number)
{
    captain_out_blanks(&to->out, indent);
    captain_out_character(&to->out, '[');
    captain_out_integer(&to->out, number);
    captain_out_string(&to->out, "]:");
}

/* Print an unknown part as octets. */
static void put_unknown(print *to, const captain_octets *octets)
{
    captain_out_string(&to->out, " '");
    captain_out_hex(&to->out, octets->octets, octets->count);
    captain_out_string(&to->out, "'H (unknown, kept)\n");
}

static void put_additions(print *to, const captain_type *type, const void *value, unsigned indent)
{
    const captain_additions *additions = captain_walk_additions(type, value);
    for (uint32_t i = 0; additions != NULL && i < additions->count; i++) {
        put_number_label(to, indent, additions->unknown[i].index);
        put_unknown(to, &additions->unknown[i].octets);
    }
    if (captain_walk_bitmap(additions) == 0)
        return;
    captain_out_blanks(&to->out, indent);
    captain_out_string(&to->out, "[]: ");
    captain_out_integer(&to->out, additions->bits);
    captain_out_string(&to->out, " (additions that the sender counts, kept)\n");
}

static void put_sequence(print *to, const captain_type *type, const void *value, unsigned indent)
{
    captain_out_character(&to->out, '\n');
    for (unsigned i = 0; i < type->fields_count; i++) {
        const captain_field *field = &type->fields[i];
        const void *component = captain_walk_shown(field, value);
        if (component == NULL)
            continue;
        put_label(to, indent, field->name);
        put_value(to, field->type, field->unit, component, indent);
    }
    put_additions(to, type, value, indent);
}

/* Alternatives stay on the same line: "delta: node-XY1:" and so on. */
static void put_choice(print *to, const captain_type *type, const void *value, unsigned indent)
{
    uint32_t choice = *(const uint32_t *)value;
    captain_out_character(&to->out, ' ');
    if (choice >= CAPTAIN_UNKNOWN) {
        put_number_label(to, 0, choice - CAPTAIN_UNKNOWN);
        put_unknown(to, captain_walk_unknown(type, value));
    } else if (choice == 0 || choice > type->fields_count) {
        captain_out_string(&to->out, "nothing\n");
    } else {
        const captain_field *field = &type->fields[choice - 1];
        put_label(to, 0, field->name);
        put_value(to, field->type, field->unit, captain_walk_field(field, value), indent);
    }
}

static void put_list(print *to, const captain_type *type, captain_list list, unsigned indent)
{
    captain_out_string(&to->out, list.count == 0 ? " empty\n" : "\n");
    for (uint32_t i = 0; i < list.count; i++) {
        put_number_label(to, indent, i);
        put_value(to, type->element, NULL, (const char *)list.items + (size_t)i * type->element->size, indent);
    }
}

static void put_line(print *to, const captain_type *type, const char *unit, const void *value)
{
    captain_out_character(&to->out, ' ');
    captain_out_value(&to->out, type, unit, value);
    captain_out_character(&to->out, '\n');
}

/* Print a value after its label. indent: that of the line. */
static void put_value(print *to, const captain_type *type, const char *unit, const void *value, unsigned indent)
{
    if (value == NULL) {
        captain_out_string(&to->out, " nothing\n");
        return;
    }
    if (to->depth >= CAPTAIN_WALK_DEPTH) {
        to->out.status = CAPTAIN_DEPTH;
        return;
    }
    to->depth++;
    switch (type->kind) {
    case CAPTAIN_SEQUENCE: put_sequence(to, type, value, indent + 2); break;
    case CAPTAIN_CHOICE: put_choice(to, type, value, indent); break;
    case CAPTAIN_LIST: put_list(to, type, captain_walk_list(value), indent + 2); break;
    case CAPTAIN_OPEN: {
        const captain_open *open = value;
        if (open->type == NULL)
            put_unknown(to, &open->octets);
        else
            put_value(to, open->type, NULL, open->value, indent);
        break;
    }
    default: put_line(to, type, unit, value);
    }
    to->depth--;
}

captain_status captain_print(const captain_type *type, const void *value, captain_sink sink, void *context)
{
    print to = {.depth = 0};
    captain_out_start(&to.out, sink, context);
    put_label(&to, 0, captain_type_text(type));
    put_value(&to, type, NULL, value, 0);
    return captain_out_end(&to.out);
}

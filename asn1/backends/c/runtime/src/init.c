/* Initialisation of a value. */
#include "walk.h"

#include <string.h>

static void init_field(const captain_field *field, char *structure)
{
    void *value = structure + field->offset;
    if (field->flags & CAPTAIN_DEFAULT) {
        if (field->flags & CAPTAIN_POINTER)
            memcpy(value, &field->default_value, sizeof field->default_value);
        else
            memcpy(value, field->default_value, field->type->size);
    } else if (field->type->kind == CAPTAIN_SEQUENCE && !(field->flags & CAPTAIN_POINTER)) {
        captain_init(field->type, value);
    }
}

void captain_init(const captain_type *type, void *value)
{
    memset(value, 0, type->size);
    if (type->kind != CAPTAIN_SEQUENCE)
        return;
    for (unsigned i = 0; i < type->fields_count; i++)
        init_field(&type->fields[i], value);
}

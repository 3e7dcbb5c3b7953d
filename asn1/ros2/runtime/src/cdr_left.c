/* What the ROS message has no place for: written once more, with a list of the places, and then each of them is looked for in the value. */
#include "cdr.h"
#include "walk.h"

enum { HEADER = 4 };

typedef struct search {
    const captain_left *left;
    size_t count;
    unsigned depth;
    captain_on_left_out on_left_out;
    void *context;
    captain_path path;
} search;

static bool find(search *in, const captain_type *type, const void *value);

static bool is_left(const search *in, const captain_type *type, const void *value)
{
    for (size_t i = 0; i < in->count; i++)
        if (in->left[i].type == type && in->left[i].value == value)
            return true;
    return false;
}

static bool tell(search *in, const captain_type *type, const void *value)
{
    return in->on_left_out(in->context, in->path.text, type, value);
}

/* "[]": the sender knew more or fewer additions than we do, and sent none of those that we do not know. */
static bool find_additions(search *in, const captain_additions *additions)
{
    static const captain_addition NONE;
    bool goes_on = true;
    if (additions != NULL && additions->count == 0) {
        size_t path = captain_path_push(&in->path, "[]");
        goes_on = tell(in, NULL, &NONE);
        captain_path_pop(&in->path, path);
    }
    for (uint32_t i = 0; additions != NULL && i < additions->count && goes_on; i++) {
        size_t path = captain_path_push_addition(&in->path, additions->unknown[i].index);
        goes_on = tell(in, NULL, &additions->unknown[i]);
        captain_path_pop(&in->path, path);
    }
    return goes_on;
}

static bool find_field(search *in, const captain_field *field, const void *structure)
{
    const void *value = captain_walk_is_present(field, structure) ? captain_walk_field(field, structure) : NULL;
    if (value == NULL)
        return true;
    size_t path = captain_path_push(&in->path, field->name);
    bool goes_on = find(in, field->type, value);
    captain_path_pop(&in->path, path);
    return goes_on;
}

static bool find_in_list(search *in, const captain_type *type, captain_list list)
{
    bool goes_on = true;
    for (uint32_t i = 0; i < list.count && goes_on; i++) {
        size_t path = captain_path_push_index(&in->path, i);
        goes_on = find(in, type->element, (const char *)list.items + (size_t)i * type->element->size);
        captain_path_pop(&in->path, path);
    }
    return goes_on;
}

static bool find_inside(search *in, const captain_type *type, const void *value)
{
    bool goes_on = true;
    switch (type->kind) {
    case CAPTAIN_SEQUENCE:
        for (unsigned i = 0; i < type->fields_count && goes_on; i++)
            goes_on = find_field(in, &type->fields[i], value);
        return goes_on && find_additions(in, captain_walk_additions(type, value));
    case CAPTAIN_CHOICE: {
        uint32_t choice = *(const uint32_t *)value;
        return choice == 0 || choice > type->fields_count || find_field(in, &type->fields[choice - 1], value);
    }
    case CAPTAIN_LIST: return find_in_list(in, type, captain_walk_list(value));
    case CAPTAIN_OPEN: {
        const captain_open *open = value;
        return open->type == NULL || open->value == NULL || find(in, open->type, open->value);
    }
    default: return true;
    }
}

static bool find(search *in, const captain_type *type, const void *value)
{
    if (is_left(in, type, value))
        return tell(in, type, value);
    if (in->depth == CAPTAIN_WALK_DEPTH)
        return true;
    in->depth++;
    bool goes_on = find_inside(in, type, value);
    in->depth--;
    return goes_on;
}

captain_status captain_cdr_left_out(const captain_ros2 *ros2, const void *value, void *cdr, size_t octets,
                                    captain_on_left_out on_left_out, void *context)
{
    captain_left left[CAPTAIN_LEFT_MAX];
    captain_cdr_writer writer = {.octets = (uint8_t *)cdr + HEADER, .size = octets - HEADER, .left = left};
    ros2->write(&writer, 0, value);
    search in = {.left = left, .on_left_out = on_left_out, .context = context};
    in.count = writer.left_count < CAPTAIN_LEFT_MAX ? writer.left_count : CAPTAIN_LEFT_MAX;
    return find(&in, ros2->pdu, value) ? CAPTAIN_OK : CAPTAIN_NO_SPACE;
}

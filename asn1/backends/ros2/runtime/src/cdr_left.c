/* Parts without a place in the ROS message: writes the value again, with a list of these parts, and searches the value for each
 * one. */
#include "cdr.h"
#include "walk.h"

enum { HEADER = 4 };

/* Path to a value, from inside to outside. It is converted to text only for a report. */
typedef struct step {
    const struct step *outer;
    const char *name; /* name of a component or alternative; NULL for an element */
    uint32_t index;
} step;

typedef struct search {
    const captain_left *left;
    size_t count, wanted; /* length of the list, and number of parts not yet found */
    unsigned depth;
    captain_on_left_out on_left_out;
    void *context;
} search;

static bool find(search *in, const step *at, const captain_type *type, const void *value);

static bool is_left(const search *in, const captain_type *type, const void *value)
{
    for (size_t i = 0; i < in->count; i++)
        if (in->left[i].value == value && in->left[i].type == type)
            return true;
    return false;
}

static void put_path(captain_path *path, const step *at)
{
    if (at == NULL)
        return;
    put_path(path, at->outer);
    if (at->name != NULL)
        captain_path_push(path, at->name);
    else
        captain_path_push_index(path, at->index);
}

static bool tell(search *in, const step *at, const captain_type *type, const void *value)
{
    captain_path path = {.length = 0};
    put_path(&path, at);
    in->wanted--;
    return in->on_left_out(in->context, path.text, type, value) && in->wanted > 0;
}

/* Report unknown additions, which are one entry of the list. "[]" means that only the length of the sender's bitmap differs. */
static bool tell_additions(search *in, const step *at, const captain_additions *additions)
{
    static const captain_addition NONE;
    captain_path path = {.length = 0};
    bool goes_on = true;
    put_path(&path, at);
    in->wanted--;
    if (additions->count == 0) {
        captain_path_push(&path, "[]");
        goes_on = in->on_left_out(in->context, path.text, NULL, &NONE);
    }
    for (uint32_t i = 0; i < additions->count && goes_on; i++) {
        size_t before = captain_path_push_addition(&path, additions->unknown[i].index);
        goes_on = in->on_left_out(in->context, path.text, NULL, &additions->unknown[i]);
        captain_path_pop(&path, before);
    }
    return goes_on && in->wanted > 0;
}

static bool find_field(search *in, const step *at, const captain_field *field, const void *structure)
{
    const void *value = captain_walk_is_present(field, structure) ? captain_walk_field(field, structure) : NULL;
    const step inside = {at, field->name, 0};
    return value == NULL || find(in, &inside, field->type, value);
}

static bool find_in_list(search *in, const step *at, const captain_type *type, captain_list list)
{
    bool goes_on = true;
    for (uint32_t i = 0; i < list.count && goes_on; i++) {
        const step inside = {at, NULL, i};
        goes_on = find(in, &inside, type->element, (const char *)list.items + (size_t)i * type->element->size);
    }
    return goes_on;
}

static bool find_in_sequence(search *in, const step *at, const captain_type *type, const void *value)
{
    const captain_additions *additions = captain_walk_additions(type, value);
    bool goes_on = true;
    for (unsigned i = 0; i < type->fields_count && goes_on; i++)
        goes_on = find_field(in, at, &type->fields[i], value);
    return goes_on && (additions == NULL || tell_additions(in, at, additions));
}

static bool find_inside(search *in, const step *at, const captain_type *type, const void *value)
{
    switch (type->kind) {
    case CAPTAIN_SEQUENCE: return find_in_sequence(in, at, type, value);
    case CAPTAIN_LIST: return find_in_list(in, at, type, captain_walk_list(value));
    case CAPTAIN_CHOICE: {
        uint32_t choice = *(const uint32_t *)value;
        return choice == 0 || choice > type->fields_count || find_field(in, at, &type->fields[choice - 1], value);
    }
    case CAPTAIN_OPEN: {
        const captain_open *open = value;
        return open->type == NULL || open->value == NULL || find(in, at, open->type, open->value);
    }
    default: return true;
    }
}

/* Return false if everything was reported, or on_left_out returned false. */
static bool find(search *in, const step *at, const captain_type *type, const void *value)
{
    if (is_left(in, type, value))
        return tell(in, at, type, value);
    if (type->kind < CAPTAIN_SEQUENCE || in->depth == CAPTAIN_WALK_DEPTH)
        return true;
    in->depth++;
    bool goes_on = find_inside(in, at, type, value);
    in->depth--;
    return goes_on;
}

void captain_cdr_left_out(const captain_ros2 *ros2, const void *value, void *cdr, size_t octets,
                          captain_on_left_out on_left_out, void *context)
{
    captain_left left[CAPTAIN_LEFT_MAX];
    captain_cdr_writer writer = {.octets = (uint8_t *)cdr + HEADER, .size = octets - HEADER, .left = left};
    ros2->write(&writer, 0, value);
    search in = {.left = left, .on_left_out = on_left_out, .context = context};
    in.count = writer.left_count < CAPTAIN_LEFT_MAX ? writer.left_count : CAPTAIN_LEFT_MAX;
    in.wanted = writer.left_count;
    if (writer.left_count > 0)
        find(&in, NULL, ros2->pdu, value);
}

/* What tests ask of generated C for ROS 2: values go in and out as JSON. */
#include <captain/ros2.h>
#include <stdlib.h>
#include <string.h>

typedef struct output {
    char *next, *end;
} output;

static unsigned char memory[1 << 22];
static uint64_t value_[1 << 14];

static bool put(void *context, const char *text, size_t octets)
{
    output *to = context;
    if (octets >= (size_t)(to->end - to->next))
        return false;
    memcpy(to->next, text, octets);
    to->next += octets;
    *to->next = 0;
    return true;
}

static bool tell(void *context, const char *path, const captain_type *type, const void *value)
{
    (void)type, (void)value;
    return put(context, path, strlen(path)) && put(context, " ", 1);
}

/* left: paths of what was left out, a blank behind each. */
captain_status test_to_cdr(const char *name, const char *json, unsigned char *cdr, size_t size, size_t *count, char *left, size_t left_size)
{
    const captain_ros2 *ros2 = captain_find_ros2(name, "etsi_its");
    output to = {left, left + left_size};
    captain_arena arena;
    captain_report report;
    size_t left_count;
    captain_arena_init(&arena, memory, sizeof memory);
    if (captain_json_read(ros2->pdu, value_, json, strlen(json), &arena, &report) != CAPTAIN_OK)
        return CAPTAIN_SYNTAX;
    memset(cdr, 0xa5, size);
    captain_status status = captain_to_cdr(ros2, value_, cdr, size, count, &left_count);
    if (status == CAPTAIN_OK && left_count > 0)
        captain_cdr_left_out(ros2, value_, cdr, *count, tell, &to);
    return status;
}

/* The octets lie at the end of what was allocated, so that reading further is seen by tools. */
captain_status test_from_cdr(const char *name, const unsigned char *cdr, size_t size, char *json, size_t json_size, captain_report *report)
{
    const captain_ros2 *ros2 = captain_find_ros2(name, "etsi_its");
    unsigned char *copy = malloc(size == 0 ? 1 : size);
    output to = {json, json + json_size};
    captain_arena arena;
    if (copy == NULL)
        return CAPTAIN_NO_MEMORY;
    memcpy(copy, cdr, size);
    captain_arena_init(&arena, memory, sizeof memory);
    memset(value_, 0xa5, ros2->pdu->size);
    captain_status status = captain_from_cdr(ros2, value_, copy, size, false, &arena, report);
    if (status == CAPTAIN_OK)
        status = captain_json_write(ros2->pdu, value_, put, &to);
    free(copy);
    return status;
}

/* What was read, written into other memory: strings in it are those of the octets, which have to stay. */
captain_status test_again(const char *name, const unsigned char *cdr, size_t size, bool takes_unknown, unsigned char *again, size_t room,
                          size_t *count)
{
    const captain_ros2 *ros2 = captain_find_ros2(name, "etsi_its");
    captain_arena arena;
    size_t left_count;
    captain_arena_init(&arena, memory, sizeof memory);
    captain_status status = captain_from_cdr(ros2, value_, cdr, size, takes_unknown, &arena, NULL);
    return status == CAPTAIN_OK ? captain_to_cdr(ros2, value_, again, room, count, &left_count) : status;
}

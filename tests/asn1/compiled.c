/* What tests ask of generated C: values go in and out as JSON. */
#include <captain/messages.h>
#include <stdlib.h>
#include <string.h>

typedef struct output {
    char *next, *end;
} output;

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

static unsigned char memory[1 << 24];
static uint64_t value_[1 << 16];

captain_status test_encode(const char *name, const char *json, unsigned char *octets, size_t size, size_t *bits)
{
    const captain_type *type = captain_find_message(name)->pdu;
    captain_arena arena;
    captain_status status;
    captain_arena_init(&arena, memory, sizeof memory);
    status = captain_json_read(type, value_, json, strlen(json), &arena, NULL);
    return status == CAPTAIN_OK ? captain_encode(type, value_, octets, size, bits) : status;
}

captain_status test_validate(const char *name, const char *json)
{
    const captain_type *type = captain_find_message(name)->pdu;
    captain_arena arena;
    captain_status status;
    captain_arena_init(&arena, memory, sizeof memory);
    status = captain_json_read(type, value_, json, strlen(json), &arena, NULL);
    return status == CAPTAIN_OK ? captain_validate(type, value_) : status;
}

/* room: octets of the arena. The octets lie at the end of what was allocated, so that reading further is seen by tools. */
captain_status test_decode(const char *name, const unsigned char *octets, size_t size, size_t room, char *json, size_t json_size)
{
    const captain_type *type = captain_find_message(name)->pdu;
    unsigned char *copy = malloc(size == 0 ? 1 : size);
    output to = {json, json + json_size};
    captain_arena arena;
    captain_status status;
    if (copy == NULL)
        return CAPTAIN_NO_MEMORY;
    memcpy(copy, octets, size);
    captain_arena_init(&arena, memory, room < sizeof memory ? room : sizeof memory);
    memset(value_, 0xa5, type->size);
    status = captain_decode_exact(type, value_, copy, size, &arena);
    if (status == CAPTAIN_OK)
        status = captain_json_write(type, value_, put, &to);
    free(copy);
    return status;
}

/* Decodes, and encodes what came out. */
captain_status test_again(const char *name, const unsigned char *octets, size_t size, unsigned char *again, size_t room, size_t *bits)
{
    const captain_type *type = captain_find_message(name)->pdu;
    captain_arena arena;
    captain_status status;
    captain_arena_init(&arena, memory, sizeof memory);
    memset(value_, 0xa5, type->size);
    status = captain_decode_exact(type, value_, octets, size, &arena);
    return status == CAPTAIN_OK ? captain_encode(type, value_, again, room, bits) : status;
}

/* Reads JSON of one dialect and writes the other. report: of the reader. */
captain_status test_translate(const char *name, const char *json, bool to_plain, char *text, size_t room, char *why)
{
    const captain_type *type = captain_find_message(name)->pdu;
    output to = {text, text + room};
    captain_arena arena;
    captain_report report;
    captain_arena_init(&arena, memory, sizeof memory);
    captain_status status = (to_plain ? captain_json_read : captain_json_read_plain)(type, value_, json, strlen(json), &arena, &report);
    strcpy(why, report.path);
    strcat(strcat(why, ": "), report.text);
    if (status == CAPTAIN_OK)
        status = (to_plain ? captain_json_write_plain : captain_json_write)(type, value_, put, &to);
    return status;
}

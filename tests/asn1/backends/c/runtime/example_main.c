/* Examples of every message of a library, in arenas of every size; fields that are set by random paths and texts.
 *
 *     example RUNS
 *
 * It prints per message: its name, the status of its example, the number of settings that succeeded. */
#include <captain/messages.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ROOM = 1 << 16, RUNS_OF_ONE = 4 };

static _Alignas(16) unsigned char value[ROOM], again[ROOM];
static unsigned char octets[ROOM];
static uint64_t state = 88172645463325252u;

static uint64_t next_random(void)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return state;
}

static void fail(const captain_message *message, const char *what, captain_status status)
{
    printf("%s: %s: %s\n", message->name, what, captain_status_text(status));
    exit(1);
}

/* Return the status of the example in an arena of exactly so many octets. */
static captain_status example(const captain_message *message, size_t room, void **memory)
{
    captain_arena arena;
    *memory = malloc(room + 1);
    captain_arena_init(&arena, *memory, room);
    memset(value, 0xa5, message->pdu->size);
    return captain_example(message, value, &arena);
}

static void check_encoding(const captain_message *message)
{
    size_t bits;
    captain_arena arena;
    void *memory = malloc(ROOM);
    captain_arena_init(&arena, memory, ROOM);
    captain_status status = captain_encode(message->pdu, value, octets, sizeof octets, &bits);
    if (status != CAPTAIN_OK)
        fail(message, "the example does not encode", status);
    status = captain_decode_exact(message->pdu, again, octets, bits == 0 ? 1 : (bits + 7) / 8, &arena);
    if (status != CAPTAIN_OK || !captain_equal(message->pdu, value, again))
        fail(message, "the example does not decode", status);
    free(memory);
}

/* Make a random path of the names of the type, and of what does not belong there. */
static void make_path(const captain_type *type, char *path, size_t room)
{
    size_t used = 0;
    for (unsigned steps = 0; steps < 8 && used + 80 < room; steps++) {
        const char *name = type != NULL && type->fields_count > 0 ? type->fields[next_random() % type->fields_count].name : "x";
        unsigned kind = (unsigned)(next_random() % 8);
        if (kind == 0 || (type != NULL && type->kind == CAPTAIN_LIST)) {
            used += (size_t)snprintf(path + used, room - used, "[%u]", (unsigned)(next_random() % 3));
            type = type != NULL ? type->element : NULL;
        } else {
            used += (size_t)snprintf(path + used, room - used, "%s%s", used > 0 ? "." : "", kind == 1 ? "*" : name);
            for (unsigned i = 0; type != NULL && i < type->fields_count; i++)
                if (type->fields[i].name == name) {
                    type = type->fields[i].type;
                    break;
                }
        }
        if (type != NULL && type->kind == CAPTAIN_OPEN && type->rows_count > 0)
            type = type->rows[next_random() % type->rows_count].type;
        if (next_random() % 4 == 0 || (type != NULL && type->kind < CAPTAIN_SEQUENCE))
            break;
    }
    if (strpbrk(path, ".[") == NULL) /* a path of one component ends in a point, else it is a short name */
        snprintf(path + used, room - used, ".");
}

static const char *const TEXTS[] = {"0", "1", "-1", "2.5", "1e3", "99999999999999999999999", "red", "x", "A", "1234", "true", "null", "[]",
                                    "[{}]", "{}", "\"", "", "0.0", "{\"a\": 1, \"b\": true}", "123456", "00", "e", ".", "-", "1e999", "1e-999"};

static unsigned set_fields(const captain_message *message, unsigned long runs)
{
    unsigned set = 0;
    for (unsigned long run = 0; run < runs; run++) {
        void *memory, *more = malloc(ROOM);
        captain_arena arena;
        captain_report report;
        example(message, ROOM, &memory);
        captain_arena_init(&arena, more, next_random() % 8 == 0 ? 40 : ROOM);
        for (unsigned i = 0; i < RUNS_OF_ONE; i++) {
            char path[1024] = "";
            make_path(message->pdu, path, sizeof path);
            const char *text = TEXTS[next_random() % (sizeof TEXTS / sizeof *TEXTS)];
            captain_status status = captain_set(message, value, path, text, &arena, &report);
            if (status != report.status || (status != CAPTAIN_OK && report.text[0] == 0))
                fail(message, path, report.status);
            if (status != CAPTAIN_OK)
                break;
            set++;
            check_encoding(message);
        }
        free(memory);
        free(more);
    }
    return set;
}

int main(int count, char **arguments)
{
    unsigned long runs = count > 1 ? strtoul(arguments[1], NULL, 10) : 100;
    for (size_t i = 0; i < captain_messages_count; i++) {
        const captain_message *message = captain_messages[i];
        captain_status status = CAPTAIN_NO_MEMORY;
        for (size_t room = 0; status == CAPTAIN_NO_MEMORY && room < ROOM; room += 8) {
            void *memory;
            status = example(message, room, &memory);
            if (status != CAPTAIN_NO_MEMORY)
                check_encoding(message);
            free(memory);
        }
        printf("%s|%s|%u\n", message->name, captain_status_text(status), set_fields(message, runs));
    }
    return 0;
}

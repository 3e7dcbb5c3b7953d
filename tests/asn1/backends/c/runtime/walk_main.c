/* Commands on lines of standard input: "<verb> <type> <argument>"; one answer each, ended by a line with a point.
 *
 *   json T TEXT      reads it, writes it again
 *   print T TEXT     reads it, prints the tree
 *   check T TEXT     reads it, checks it as validate does
 *   equal T TEXT|TEXT
 *   unit T N|UNIT    prints a number of a type of its own that has this unit
 *   init T           writes a value to start from
 *   explain T HEX    steps, then the status
 *   fuzz T RUNS TEXT explain over octets at random, json_read and what follows over a text with errors at random, both dialects
 */
#define _POSIX_C_SOURCE 200809L /* fmemopen */
#include "every.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MEMORY = 1 << 20, LINE = 1 << 19 };
static uint64_t memory[MEMORY / 8];
static uint64_t values[2][512];
static char line[LINE];
static uint8_t octets[LINE];

static bool put(void *context, const char *text, size_t count)
{
    return fwrite(text, 1, count, context) == count;
}

static bool swallow(void *context, const char *text, size_t count)
{
    size_t *total = context;
    *total += count + (unsigned char)text[count - 1] % 2;
    return true;
}

static void tell(captain_status status, const captain_report *report)
{
    printf("%s|%zu|%s|%s\n", captain_status_text(status), report->bit, report->path, report->text);
}

static captain_status read_json(const captain_type *type, void *value, const char *text, size_t count, captain_arena *arena)
{
    captain_report report;
    captain_status status = captain_json_read(type, value, text, count, arena, &report);
    if (status != CAPTAIN_OK)
        tell(status, &report);
    return status;
}

static bool print_step(void *context, const captain_step *step)
{
    static const char *const WHAT[] = {"value", "enter", "leave", "extension", "presence", "length", "choice", "open", "unknown", "padding"};
    (void)context;
    printf("%s %zu+%zu %s [%s] %s\n", WHAT[step->what], step->bit, step->width, step->path, step->text, step->clause);
    return true;
}

static bool count_step(void *context, const captain_step *step)
{
    size_t *bits = context;
    *bits += step->width + strlen(step->text) + strlen(step->path);
    return true;
}

static size_t from_hex(const char *text)
{
    size_t count = 0;
    unsigned octet;
    for (; sscanf(text, "%2x", &octet) == 1; text += 2)
        octets[count++] = (uint8_t)octet;
    return count;
}

/* ---------------------------------------------------------------- fuzz */

static uint64_t random_state = 88172645463325252u;

static uint64_t next_random(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return random_state;
}

static void fuzz_octets(const captain_type *type)
{
    captain_report report;
    size_t seen = 0, count = next_random() % 300;
    for (size_t i = 0; i < count; i++)
        octets[i] = (uint8_t)(next_random() % 3 == 0 ? next_random() : next_random() % 2 ? 0 : 0xff);
    uint8_t *exact = malloc(count + 1);
    memcpy(exact, octets, count);
    captain_status first = captain_explain(type, exact, count, count_step, &seen, &report);
    if (first != CAPTAIN_OK && (report.text[0] == 0 || report.bit > count * 8))
        abort();
    if (captain_explain_decode(type, exact, count, true, &report) != first)
        abort();
    free(exact);
}

static void fuzz_json(const captain_type *type, bool is_plain, const char *seed, size_t length)
{
    captain_status (*read)(const captain_type *, void *, const char *, size_t, captain_arena *, captain_report *) =
        is_plain ? captain_json_read_plain : captain_json_read;
    static const char PARTS[] = "{}[]\",:0123456789-+.eE\\u\x80\xff\x01tfn ";
    static char written[LINE];
    size_t count = length, seen = 0;
    char *text = malloc(length + 64);
    memcpy(text, seed, length);
    for (uint64_t edits = next_random() % 4; edits > 0 && count > 2; edits--) {
        size_t at = next_random() % count;
        switch (next_random() % 4) {
        case 0: text[at] = PARTS[next_random() % (sizeof PARTS - 1)]; break;
        case 1: memmove(text + at, text + at + 1, --count - at); break;
        case 2: text[at] = (char)next_random(); break;
        default: count = next_random() % 8 == 0 ? at : count;
        }
    }
    text = realloc(text, count + 1);
    captain_arena arena;
    captain_report report;
    captain_arena_init(&arena, memory, next_random() % 16 == 0 ? 64 : sizeof memory);
    if (read(type, values[0], text, count, &arena, &report) == CAPTAIN_OK) {
        FILE *out = fmemopen(written, sizeof written, "w");
        if ((is_plain ? captain_json_write_plain : captain_json_write)(type, values[0], put, out) != CAPTAIN_OK)
            abort();
        long end = ftell(out);
        fclose(out);
        if (captain_print(type, values[0], swallow, &seen) != CAPTAIN_OK || captain_explain_value(type, values[0], false, &report) != CAPTAIN_OK)
            abort();
        captain_arena_init(&arena, memory + MEMORY / 16, sizeof memory / 2);
        if (read(type, values[1], written, (size_t)end, &arena, &report) != CAPTAIN_OK || !captain_equal(type, values[0], values[1]))
            abort();
    } else if (report.text[0] == 0) {
        abort();
    }
    free(text);
}

/* argument: the number of runs, a blank, JSON to start from. */
static void fuzz(const captain_type *type, char *argument)
{
    char *seed;
    unsigned long runs = strtoul(argument, &seed, 10);
    size_t length = strlen(++seed);
    static char plain[LINE];
    captain_arena arena;
    captain_arena_init(&arena, memory, sizeof memory);
    bool is_whole = captain_json_read(type, values[0], seed, length, &arena, NULL) == CAPTAIN_OK;
    FILE *out = fmemopen(plain, sizeof plain, "w");
    if (is_whole && captain_json_write_plain(type, values[0], put, out) != CAPTAIN_OK)
        abort();
    fclose(out);
    for (unsigned long i = 0; i < runs; i++) {
        fuzz_octets(type);
        fuzz_json(type, false, seed, length);
        fuzz_json(type, true, is_whole ? plain : seed, is_whole ? strlen(plain) : length);
    }
    puts("done");
}

/* ---------------------------------------------------------------- commands */

static void print_number(char *argument)
{
    char *unit = strchr(argument, '|');
    *unit++ = 0;
    int64_t number = strtoll(argument, NULL, 10);
    const captain_type type = {.name = "Number", .unit = unit, .kind = CAPTAIN_INTEGER, .width = 8, .size = 8,
                               .flags = CAPTAIN_SIGNED | CAPTAIN_UNBOUNDED_LOW | CAPTAIN_UNBOUNDED_HIGH};
    captain_print(&type, &number, put, stdout);
}

static void run(const char *verb, const captain_type *type, char *argument)
{
    captain_arena arena;
    captain_report report;
    captain_arena_init(&arena, memory, sizeof memory);
    size_t count = strlen(argument);
    if (strcmp(verb, "json") == 0 && read_json(type, values[0], argument, count, &arena) == CAPTAIN_OK)
        printf("\n%s", captain_json_write(type, values[0], put, stdout) == CAPTAIN_OK ? "" : "FAILED\n");
    if (strcmp(verb, "print") == 0 && read_json(type, values[0], argument, count, &arena) == CAPTAIN_OK)
        captain_print(type, values[0], put, stdout);
    if (strcmp(verb, "check") == 0 && read_json(type, values[0], argument, count, &arena) == CAPTAIN_OK)
        tell(captain_explain_value(type, values[0], true, &report), &report);
    if (strcmp(verb, "equal") == 0) {
        char *second = strchr(argument, '|');
        *second++ = 0;
        if (read_json(type, values[0], argument, strlen(argument), &arena) == CAPTAIN_OK && read_json(type, values[1], second, strlen(second), &arena) == CAPTAIN_OK)
            printf("%s\n", captain_equal(type, values[0], values[1]) ? "equal" : "different");
    }
    if (strcmp(verb, "unit") == 0)
        print_number(argument);
    if (strcmp(verb, "init") == 0) {
        captain_init(type, values[0]);
        printf("\n%s", captain_print(type, values[0], put, stdout) == CAPTAIN_OK ? "" : "FAILED\n");
    }
    if (strcmp(verb, "explain") == 0) {
        size_t size = from_hex(argument);
        uint8_t *exact = malloc(size + 1);
        memcpy(exact, octets, size);
        tell(captain_explain(type, exact, size, print_step, NULL, &report), &report);
        free(exact);
    }
    if (strcmp(verb, "fuzz") == 0)
        fuzz(type, argument);
}

int main(void)
{
    while (fgets(line, sizeof line, stdin) != NULL) {
        line[strcspn(line, "\n")] = 0;
        char *type = strchr(line, ' ');
        *type++ = 0;
        char *argument = strchr(type, ' ');
        *argument++ = 0;
        const captain_type *found = every_find(type);
        if (found == NULL)
            return 1;
        run(line, found, argument);
        puts(".");
        fflush(stdout);
    }
    return 0;
}

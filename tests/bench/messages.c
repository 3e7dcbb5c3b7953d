/* Times of captain_decode and captain_encode. Reads lines "<message> <hex>", writes lines "<message> <decode ns> <encode ns>":
 * the best of some repetitions, because everything that disturbs makes it slower. */
#include <captain/runtime.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MAX_OCTETS = 65536, REPETITIONS = 5 };
static const double REPETITION_S = 0.004;

static unsigned char octets[MAX_OCTETS], again[MAX_OCTETS];
static _Alignas(16) unsigned char memory[1 << 24];

static double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static size_t from_hex(const char *hex)
{
    size_t count = strlen(hex) / 2;
    for (size_t at = 0; at < count; at++) {
        char pair[3] = {hex[2 * at], hex[2 * at + 1], 0};
        octets[at] = (unsigned char)strtoul(pair, NULL, 16);
    }
    return count;
}

/* The value, made anew from the front of the memory. */
static void *decode(const captain_type *type, size_t count)
{
    captain_arena arena;
    captain_arena_init(&arena, memory, sizeof memory);
    void *value = captain_arena_take(&arena, type->size);
    captain_status status = captain_decode(type, value, octets, count, &arena, NULL);
    if (status == CAPTAIN_OK)
        return value;
    fprintf(stderr, "decode: %s\n", captain_status_text(status));
    exit(1);
}

static void encode(const captain_type *type, const void *value)
{
    size_t bits;
    captain_status status = captain_encode(type, value, again, sizeof again, &bits);
    if (status == CAPTAIN_OK)
        return;
    fprintf(stderr, "encode: %s\n", captain_status_text(status));
    exit(1);
}

/* ns for one: value NULL decodes. */
static double time_ns(const captain_type *type, size_t count, const void *value)
{
    double best = 1e9;
    long loops = 64;
    for (int repetition = 0; repetition < REPETITIONS;) {
        double start = now_s();
        for (long loop = 0; loop < loops; loop++) {
            if (value == NULL)
                decode(type, count);
            else
                encode(type, value);
        }
        double taken = now_s() - start;
        if (taken < REPETITION_S) {
            loops *= 2;
            continue;
        }
        repetition++;
        if (taken / (double)loops < best)
            best = taken / (double)loops;
    }
    return best * 1e9;
}

int main(void)
{
    static char line[2 * MAX_OCTETS + 128], hex[2 * MAX_OCTETS + 1];
    char name[64];
    while (fgets(line, sizeof line, stdin) != NULL) {
        if (sscanf(line, "%63s %131072s", name, hex) != 2)
            continue;
        const captain_message *message = captain_find_message(name);
        if (message == NULL) {
            fprintf(stderr, "no message %s\n", name);
            return 1;
        }
        size_t count = from_hex(hex);
        double decode_ns = time_ns(message->pdu, count, NULL);
        const void *value = decode(message->pdu, count);
        encode(message->pdu, value);
        if (memcmp(octets, again, count) != 0)
            fprintf(stderr, "%s: re-encoded otherwise\n", name);
        printf("%s %.2f %.2f\n", name, decode_ns, time_ns(message->pdu, count, value));
    }
    return 0;
}

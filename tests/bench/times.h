/* The times of a codec, whichever: a program includes this and defines the four functions below. Reads lines
 * "<message> <hex>", writes lines "<message> <decode ns> <encode ns>": the best of some repetitions, because everything
 * that disturbs makes it slower. Ends with 1, and says why on stderr, where the octets are not understood or come back
 * otherwise. */
#ifndef CAPTAIN_BENCH_TIMES_H
#define CAPTAIN_BENCH_TIMES_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MAX_OCTETS = 65536, REPETITIONS = 5 };
static const double REPETITION_S = 0.004;

static unsigned char octets[MAX_OCTETS], again[MAX_OCTETS];

static void use(const char *message);  /* these four fail() where they cannot */
static void *decode(size_t count);     /* the value of octets */
static void release(void *value);      /* what decode made */
static void encode(const void *value); /* to again */

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

/* ns for one: value NULL decodes, and releases what was made. */
static double time_ns(size_t count, const void *value)
{
    double best = 1e9;
    long loops = 64;
    for (int repetition = 0; repetition < REPETITIONS;) {
        double start = now_s();
        for (long loop = 0; loop < loops; loop++) {
            if (value == NULL)
                release(decode(count));
            else
                encode(value);
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

static void fail(const char *what, const char *why)
{
    fprintf(stderr, "%s%s\n", what, why);
    exit(1);
}

int main(void)
{
    static char line[2 * MAX_OCTETS + 128], hex[2 * MAX_OCTETS + 1];
    char name[64];
    while (fgets(line, sizeof line, stdin) != NULL) {
        if (sscanf(line, "%63s %131072s", name, hex) != 2)
            continue;
        use(name);
        size_t count = from_hex(hex);
        void *value = decode(count);
        encode(value);
        if (memcmp(octets, again, count) != 0)
            fail("encodes it otherwise", "");
        release(value);
        double decode_ns = time_ns(count, NULL);
        value = decode(count);
        printf("%s %.2f %.2f\n", name, decode_ns, time_ns(count, value));
        release(value);
    }
    return 0;
}

#endif

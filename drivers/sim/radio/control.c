/* Changes of the radio at run time, by commands and by timers. */
#define _POSIX_C_SOURCE 200809L
#include <signal.h>
#include <stdio.h>
#include <sys/resource.h>
#include <time.h>

#include "radio.h"

enum { MS = 1000000 };

static int64_t change_at; /* time when the module disappears or returns; 0: never */

int64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 * MS + now.tv_nsec;
}

static void set_down(bool is_down)
{
    unsigned next = is_down ? radio.settings.down_for : 0;
    radio.settings.is_down = is_down;
    change_at = next ? now_ns() + (int64_t)next * MS : 0;
    if (is_down) {
        radio.epoch++;
        casters_wake();
    }
}

void control_start(void)
{
    unsigned after = radio.settings.down_after;
    change_at = after ? now_ns() + (int64_t)after * MS : 0;
}

int control_presence(void)
{
    if (!change_at)
        return -1;
    int64_t left = change_at - now_ns();
    if (left > 0)
        return (int)(left / MS) + 1;
    set_down(!radio.settings.is_down);
    return control_presence();
}

static void crash(void)
{
    setrlimit(RLIMIT_CORE, &(struct rlimit){0, 0});
    raise(SIGSEGV);
}

void control_answer(const char *command, char *answer, size_t size)
{
    struct settings wanted = radio.settings;
    char fault[64];
    if (!settings_read(&wanted, command, fault, sizeof fault)) {
        snprintf(answer, size, "not understood: %s", fault);
        return;
    }
    bool was_down = radio.settings.is_down;
    radio.settings = wanted;
    if (wanted.is_down != was_down)
        set_down(wanted.is_down);
    casters_wake(); /* hanging calls check the settings again */
    if (wanted.crashes)
        crash();
    const struct counters *seen = &radio.counters;
    snprintf(answer, size,
             "sent=%u heard=%u lost=%u faded=%u away=%u foreign=%u own=%u duplicate=%u no_caster=%u overflow=%u "
             "delivered=%u created=%u",
             seen->sent, seen->heard, seen->lost, seen->faded, seen->away, seen->foreign, seen->own,
             seen->duplicate, seen->no_caster, seen->overflow, seen->delivered, seen->created);
}

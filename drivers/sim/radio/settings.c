#define _POSIX_C_SOURCE 200809L
#include "settings.h"

#include <arpa/inet.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAX_WORD 512 /* characters of key=value */

/* Caster ids of the vehicleCAPTAIN profile, by the standard's BTP ports (TS 103 248). */
static const struct profile PROFILES[] = {
    {2001, 0}, {2002, 1}, {2003, 2}, {2004, 3}, {2006, 4}, {2009, 5}, {2013, 6}, {2018, 7},
};

static const char *const CALL_NAMES[CALLS] = {"init", "create", "tx", "rx", "release"};

void settings_default(struct settings *settings)
{
    *settings = (struct settings){
        .seed = 1, .limit = 32, .handler_bits = 8, .has_texts = true, .rssi = -71, .tx_ms = 1,
        .sensitivity = -92, .mac = {0x02, 0, 0, 0, 0x30, 0x1e}, .profile_count = sizeof PROFILES / sizeof *PROFILES,
    };
    memcpy(settings->profiles, PROFILES, sizeof PROFILES);
}

static bool whole(const char *text, long low, long high, long *value)
{
    char *end;
    *value = strtol(text, &end, 10);
    return end != text && *end == '\0' && low <= *value && *value <= high;
}

static bool count(const char *text, unsigned *value)
{
    long number;
    if (!whole(text, 0, INT_MAX, &number))
        return false;
    *value = (unsigned)number;
    return true;
}

static bool flag(const char *text, bool *value)
{
    long number;
    if (!whole(text, 0, 1, &number))
        return false;
    *value = number == 1;
    return true;
}

static bool share(const char *text, double *value)
{
    char *end;
    *value = strtod(text, &end);
    return end != text && *end == '\0' && 0.0 <= *value && *value <= 1.0;
}

static bool decibel(const char *text, double *value)
{
    char *end;
    *value = strtod(text, &end);
    return end != text && *end == '\0' && -200.0 <= *value && *value <= 200.0;
}

static bool endpoint(char *text, struct sockaddr_in *value)
{
    char *colon = strrchr(text, ':');
    long port;
    if (!colon)
        return false;
    *colon = '\0';
    *value = (struct sockaddr_in){.sin_family = AF_INET};
    if (!whole(colon + 1, 0, UINT16_MAX, &port) || inet_pton(AF_INET, text, &value->sin_addr) != 1)
        return false;
    value->sin_port = htons((uint16_t)port);
    return true;
}

/* Calls a function for each item of a comma-separated list; stops at the first invalid item. */
static bool each(char *list, struct settings *settings, bool (*take)(char *item, struct settings *settings))
{
    char *rest = list;
    for (char *item; (item = strtok_r(rest, ",", &rest));)
        if (!take(item, settings))
            return false;
    return true;
}

static bool take_peer(char *item, struct settings *settings)
{
    return settings->peer_count < MAX_PEERS && endpoint(item, &settings->peers[settings->peer_count++]);
}

static bool take_profile(char *item, struct settings *settings)
{
    unsigned port, id;
    char rest;
    if (settings->profile_count >= MAX_PROFILES || sscanf(item, "%u:%u%c", &port, &id, &rest) != 2 ||
        port > UINT16_MAX || id > UINT16_MAX)
        return false;
    settings->profiles[settings->profile_count++] = (struct profile){(uint16_t)port, (uint16_t)id};
    return true;
}

static bool take_building(char *item, struct settings *settings)
{
    struct building building;
    char rest;
    if (settings->building_count >= MAX_BUILDINGS ||
        sscanf(item, "%d:%d:%d:%d%c", &building.corner.latitude, &building.corner.longitude,
               &building.opposite.latitude, &building.opposite.longitude, &rest) != 4)
        return false;
    settings->buildings[settings->building_count++] = building;
    return true;
}

static bool find_call(const char *name, enum call *call)
{
    for (*call = CALL_INIT; *call < CALLS; ++*call)
        if (strcmp(name, CALL_NAMES[*call]) == 0)
            return true;
    return false;
}

static bool take_failure(char *item, struct settings *settings)
{
    struct failure failure;
    char name[16], rest;
    if (sscanf(item, "%15[a-z]:%d:%u%c", name, &failure.number, &failure.times, &rest) != 3 ||
        !find_call(name, &failure.call))
        return false;
    for (size_t at = 0; at < MAX_FAILURES; at++)
        if (!settings->failures[at].times) {
            settings->failures[at] = failure;
            return true;
        }
    return false;
}

static bool take_hang(const char *value, struct settings *settings)
{
    enum call call;
    if (strcmp(value, "none") == 0) {
        memset(settings->is_hanging, 0, sizeof settings->is_hanging);
        return true;
    }
    return find_call(value, &call) && (settings->is_hanging[call] = true);
}

static bool take_mac(const char *value, struct settings *settings)
{
    unsigned octets[6];
    char rest;
    if (sscanf(value, "%2x:%2x:%2x:%2x:%2x:%2x%c", &octets[0], &octets[1], &octets[2], &octets[3], &octets[4],
               &octets[5], &rest) != 6)
        return false;
    for (size_t at = 0; at < 6; at++)
        settings->mac[at] = (uint8_t)octets[at];
    return true;
}

static bool take_position(const char *value, struct settings *settings)
{
    char rest;
    return sscanf(value, "%d:%d%c", &settings->latitude, &settings->longitude, &rest) == 2;
}

static bool take_rssi(const char *value, struct settings *settings)
{
    long number;
    if (!whole(value, INT16_MIN, INT16_MAX, &number))
        return false;
    settings->rssi = (int16_t)number;
    return true;
}

static bool take_seed(const char *value, struct settings *settings)
{
    char *end;
    settings->seed = strtoull(value, &end, 10);
    return end != value && *end == '\0';
}

static bool take(struct settings *to, const char *key, char *value)
{
#define KEY(name) (strcmp(key, name) == 0)
    if (KEY("listen"))
        return endpoint(value, &to->listen);
    if (KEY("control"))
        return endpoint(value, &to->control);
    if (KEY("peers"))
        return to->peer_count = 0, each(value, to, take_peer);
    if (KEY("profiles"))
        return to->profile_count = 0, each(value, to, take_profile);
    if (KEY("buildings"))
        return to->building_count = 0, each(value, to, take_building);
    if (KEY("power"))
        return to->has_power = decibel(value, &to->power);
    if (KEY("fail"))
        return each(value, to, take_failure);
    if (KEY("hang"))
        return take_hang(value, to);
    if (KEY("sdk"))
        return (to->is_old = strcmp(value, "1.7") == 0) || strcmp(value, "1.13") == 0;
    if (KEY("handler_bits"))
        return count(value, &to->handler_bits) && (to->handler_bits == 8 || to->handler_bits == 32);
    return KEY("loss")         ? share(value, &to->loss)
           : KEY("reorder")    ? share(value, &to->reorder)
           : KEY("fading")     ? decibel(value, &to->fading)
           : KEY("sensitivity") ? decibel(value, &to->sensitivity)
           : KEY("delay_ms")   ? count(value, &to->delay_ms)
           : KEY("jitter_ms")  ? count(value, &to->jitter_ms)
           : KEY("seed")       ? take_seed(value, to)
           : KEY("down")       ? flag(value, &to->is_down)
           : KEY("down_after") ? count(value, &to->down_after)
           : KEY("down_for")   ? count(value, &to->down_for)
           : KEY("crash")      ? flag(value, &to->crashes)
           : KEY("limit")      ? count(value, &to->limit)
           : KEY("texts")      ? flag(value, &to->has_texts)
           : KEY("mac")        ? take_mac(value, to)
           : KEY("position")   ? take_position(value, to)
           : KEY("rssi")       ? take_rssi(value, to)
           : KEY("tx_ms")      ? count(value, &to->tx_ms)
                               : false;
#undef KEY
}

bool settings_read(struct settings *settings, const char *text, char *fault, size_t size)
{
    while (*(text += strspn(text, " \t\r\n"))) {
        size_t length = strcspn(text, " \t\r\n");
        char word[MAX_WORD], whole_word[MAX_WORD];
        if (length >= sizeof word)
            length = sizeof word - 1; /* too long for every key, so it is refused */
        snprintf(word, sizeof word, "%.*s", (int)length, text);
        memcpy(whole_word, word, sizeof word);
        text += length;
        char *equals = strchr(word, '=');
        if (equals)
            *equals = '\0';
        if (!equals || !take(settings, word, equals + 1)) {
            snprintf(fault, size, "%s", whole_word);
            return false;
        }
    }
    return true;
}

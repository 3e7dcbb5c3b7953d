/* Calls of the library, as strict as in the real one: only the thread that created a handler may use it. */
#define _POSIX_C_SOURCE 200809L
#include "v2xcast.h"

#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "casters.h"
#include "fault.h"

/* Epoch of ITS time, 2004-01-01, as Unix time; less the leap seconds since then (5 since 2017; IERS Bulletin C). */
enum { EPOCH_S = 1072915200 - 5 };
enum { DEFAULT_TRAFFIC_CLASS = 2, DEFAULT_HOP_LIMIT = 10 }; /* defaults of the profile */
enum { MS = 1000000 };
#define FOREVER INT64_MAX

struct radio radio = {.lock = PTHREAD_MUTEX_INITIALIZER};

static int leave(int result)
{
    pthread_mutex_unlock(&radio.lock);
    return result;
}

static int refuse(enum fault fault)
{
    return leave(fault_number(fault, radio.settings.is_old));
}

/* Takes the lock. Returns the error number that the settings demand for a call, or 0; hangs while they demand it. */
static int enter(enum call call)
{
    pthread_mutex_lock(&radio.lock);
    while (radio.settings.is_hanging[call])
        casters_wait(FOREVER);
    for (struct failure *failure = radio.settings.failures; failure < radio.settings.failures + MAX_FAILURES; failure++)
        if (failure->times && failure->call == call) {
            failure->times--;
            return failure->number;
        }
    return 0;
}

static void rest(unsigned ms)
{
    pthread_mutex_unlock(&radio.lock);
    nanosleep(&(struct timespec){ms / 1000, (long)(ms % 1000) * MS}, NULL);
    pthread_mutex_lock(&radio.lock);
}

static bool read_environment(void)
{
    const char *text = getenv("CAPTAIN_SIM_RADIO");
    char fault[64];
    settings_default(&radio.settings);
    if (settings_read(&radio.settings, text ? text : "", fault, sizeof fault))
        return true;
    fprintf(stderr, "CAPTAIN_SIM_RADIO: not understood: %s\n", fault);
    return false;
}

int eu_caster_init(void)
{
    pthread_mutex_lock(&radio.lock);
    if (radio.is_running)
        return leave(0);
    if (!read_environment())
        return refuse(FAULT_CONFIG);
    pthread_mutex_unlock(&radio.lock);
    int forced = enter(CALL_INIT);
    if (forced)
        return leave(forced);
    control_start();
    radio.is_running = true;
    if (radio.settings.listen.sin_family && !air_open())
        return refuse(FAULT_NOT_INITIALISED);
    return leave(0);
}

int eu_caster_deinit(void)
{
    pthread_mutex_lock(&radio.lock);
    bool has_air = radio.is_running && radio.settings.listen.sin_family;
    radio.is_running = false;
    pthread_mutex_unlock(&radio.lock);
    if (has_air)
        air_close();
    return 0;
}

static int hand_out(void *handler, int number)
{
    if (radio.settings.handler_bits == 8)
        *(uint8_t *)handler = (uint8_t)number;
    else
        memcpy(handler, &number, sizeof number);
    return leave(0);
}

int eu_caster_create(void *handler, const struct config *config)
{
    struct in_addr address;
    int forced = enter(CALL_CREATE);
    if (forced)
        return leave(forced);
    if (!radio.is_running)
        return refuse(FAULT_NOT_INITIALISED);
    if (!handler || !config || (config->mode != MODE_TX && config->mode != MODE_RX))
        return refuse(FAULT_CONFIG);
    if (!config->ip || inet_pton(AF_INET, config->ip, &address) != 1)
        return refuse(FAULT_IP);
    const struct profile *profile = casters_profile(config->caster_id);
    if (!profile || radio.settings.is_down || !radio.settings.listen.sin_family)
        return refuse(FAULT_NOT_AVAILABLE);
    int number = casters_open(config->mode, profile);
    return number < 0 ? refuse(FAULT_OVER_LIMIT) : hand_out(handler, number);
}

int eu_caster_release(int handler)
{
    int forced = enter(CALL_RELEASE);
    if (forced)
        return leave(forced);
    struct caster *caster = casters_find(handler);
    if (!caster)
        return refuse(FAULT_RELEASE_UNKNOWN);
    if (!pthread_equal(caster->owner, pthread_self()))
        return refuse(FAULT_RELEASE_THREAD);
    caster->is_open = false;
    return leave(0);
}

static void transmit(const struct caster *caster, const struct tx_info *info, const uint8_t *octets, size_t length)
{
    static const struct tx_info NOTHING;
    static uint16_t sequence;
    struct timespec now;
    uint8_t frame[MAX_FRAME];
    if (!info)
        info = &NOTHING;
    clock_gettime(CLOCK_REALTIME, &now);
    struct sender sender = {
        .timestamp = (uint32_t)((now.tv_sec - EPOCH_S) * 1000 + now.tv_nsec / MS),
        .position = {radio.settings.latitude, radio.settings.longitude},
    };
    memcpy(sender.mac, radio.settings.mac, sizeof sender.mac);
    struct packet packet = {
        .btp_port = info->has_btp_port ? info->btp_port : caster->btp_port,
        .traffic_class = info->has_traffic_class ? info->traffic_class : DEFAULT_TRAFFIC_CLASS,
        .hop_limit = DEFAULT_HOP_LIMIT,
        .has_area = info->has_area && info->has_position && info->area.type <= 2,
        .area = info->area,
        .centre = info->position,
        .payload = octets,
        .length = length,
    };
    if (packet.has_area)
        packet.sequence = sequence++;
    air_send(frame, geonet_encode(frame, &sender, &packet));
    radio.counters.sent++;
}

int eu_caster_tx(int handler, const struct tx_info *info, const uint8_t *octets, size_t length)
{
    int forced = enter(CALL_TX);
    if (forced)
        return leave(forced);
    struct caster *caster = casters_find(handler);
    if (!caster)
        return refuse(FAULT_TX_UNKNOWN);
    if (!pthread_equal(caster->owner, pthread_self()))
        return refuse(FAULT_TX_THREAD);
    if (caster->mode != MODE_TX)
        return refuse(FAULT_TX_MODE);
    if (!octets || length > MAX_PAYLOAD)
        return refuse(FAULT_TX_TOO_LONG);
    rest(radio.settings.tx_ms);
    if (radio.settings.is_down || caster->epoch != radio.epoch)
        return refuse(FAULT_TX_ANSWER);
    transmit(caster, info, octets, length);
    return leave(0);
}

static int take(struct caster *caster, struct rx_info *info, uint8_t *octets, size_t *length)
{
    const struct received *first = &caster->queue[caster->first];
    caster->first = (caster->first + 1) % QUEUE;
    caster->count--;
    if (info)
        *info = first->info;
    memcpy(octets, first->octets, first->length);
    *length = first->length;
    return leave(0);
}

int eu_caster_rx_timeout(int handler, struct rx_info *info, uint8_t *octets, size_t size, size_t *length, int timeout_ms)
{
    int64_t until = now_ns() + (int64_t)timeout_ms * MS;
    int forced = enter(CALL_RX);
    if (forced)
        return leave(forced);
    struct caster *caster = casters_find(handler);
    if (!caster)
        return refuse(FAULT_RX_UNKNOWN);
    if (!pthread_equal(caster->owner, pthread_self()))
        return refuse(FAULT_RX_THREAD);
    if (caster->mode != MODE_RX)
        return refuse(FAULT_RX_MODE);
    if (!octets || !length || size < MAX_PAYLOAD)
        return refuse(FAULT_RX_BUFFER);
    bool has_time = true;
    while (caster->epoch == radio.epoch && !caster->count && has_time) {
        while (radio.settings.is_hanging[CALL_RX])
            casters_wait(FOREVER);
        has_time = casters_wait(until);
    }
    if (caster->epoch != radio.epoch)
        return refuse(FAULT_RX_LOST);
    return caster->count ? take(caster, info, octets, length) : refuse(FAULT_RX_TIMEOUT);
}

const char *error_msg(int code)
{
    pthread_mutex_lock(&radio.lock);
    bool is_old = radio.settings.is_old, has_texts = radio.settings.has_texts;
    pthread_mutex_unlock(&radio.lock);
    return has_texts ? fault_text(code, is_old) : "";
}

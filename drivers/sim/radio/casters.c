#define _POSIX_C_SOURCE 200809L
#include "casters.h"

#include <string.h>
#include <time.h>

enum { DATA_RATE = 12 }; /* in 500 kbit/s: 6 Mbit/s, as ITS-G5 uses on the control channel (EN 302 663) */
enum { NS = 1000000000 };

static struct caster casters[MAX_HANDLERS];
static pthread_cond_t changed;
static pthread_once_t once = PTHREAD_ONCE_INIT;

static void prepare(void)
{
    pthread_condattr_t attributes;
    pthread_condattr_init(&attributes);
    pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    pthread_cond_init(&changed, &attributes);
}

int casters_open(int mode, const struct profile *profile)
{
    unsigned open = 0;
    int free = -1;
    for (int at = 0; at < MAX_HANDLERS; at++)
        if (casters[at].is_open)
            open++;
        else if (free < 0)
            free = at;
    if (free < 0 || open >= radio.settings.limit)
        return -1;
    struct caster *caster = &casters[free];
    caster->is_open = true;
    caster->owner = pthread_self();
    caster->epoch = radio.epoch;
    caster->mode = mode;
    caster->caster_id = profile->caster_id;
    caster->btp_port = profile->btp_port;
    caster->first = caster->count = 0;
    radio.counters.created++;
    return free;
}

struct caster *casters_find(int handler)
{
    return 0 <= handler && handler < MAX_HANDLERS && casters[handler].is_open ? &casters[handler] : NULL;
}

const struct profile *casters_profile(uint16_t caster_id)
{
    const struct settings *settings = &radio.settings;
    for (size_t at = 0; at < settings->profile_count; at++)
        if (settings->profiles[at].caster_id == caster_id)
            return &settings->profiles[at];
    return NULL;
}

static void describe(struct rx_info *info, const struct packet *packet)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    *info = (struct rx_info){
        .timestamp = {now.tv_sec, now.tv_nsec / 1000},
        .rssi = packet->rssi,
        .data_rate = DATA_RATE,
        .traffic_class = packet->traffic_class,
        .hop_limit = packet->hop_limit,
        .position = packet->source,
        .area = packet->area,
    };
    memcpy(info->source_mac, packet->source_mac, sizeof info->source_mac);
}

static void append(struct caster *caster, const struct packet *packet)
{
    if (caster->count == QUEUE) { /* the queue is full: drop the oldest */
        caster->first = (caster->first + 1) % QUEUE;
        caster->count--;
        radio.counters.overflow++;
        radio.counters.delivered--;
    }
    struct received *place = &caster->queue[(caster->first + caster->count++) % QUEUE];
    describe(&place->info, packet);
    place->length = packet->length;
    memcpy(place->octets, packet->payload, packet->length);
    radio.counters.delivered++;
}

void casters_receive(const struct packet *packet)
{
    bool is_taken = false;
    for (struct caster *caster = casters; caster < casters + MAX_HANDLERS; caster++)
        if (caster->is_open && caster->mode == MODE_RX && caster->epoch == radio.epoch &&
            caster->btp_port == packet->btp_port) {
            append(caster, packet);
            is_taken = true;
        }
    if (is_taken)
        casters_wake();
    else
        radio.counters.no_caster++;
}

void casters_wake(void)
{
    pthread_once(&once, prepare);
    pthread_cond_broadcast(&changed);
}

bool casters_wait(int64_t until_ns)
{
    struct timespec until = {until_ns / NS, until_ns % NS};
    pthread_once(&once, prepare);
    return pthread_cond_timedwait(&changed, &radio.lock, &until) == 0;
}

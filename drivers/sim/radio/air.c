/* Simulated air: UDP datagrams, each a whole Ethernet frame as Vanetza's tools send them. One thread receives. */
#define _GNU_SOURCE /* M_PI */
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "path.h"
#include "radio.h"

enum { MS = 1000000 };
enum { BATCH = 64 };       /* frames received per turn of the loop */
enum { MAX_DELAYED = 512 }; /* frames in transit: 100 ms at 5000 per second */
enum { REORDER_MS = 20 };  /* delay of a reordered frame: 20 frames overtake it at 1000 per second */
enum { MAX_TEXT = 1024 };  /* characters of a command */
enum { MAX_HOPPED = 64 };  /* multi-hop packets remembered for duplicate detection */

static struct delayed {
    int64_t due_ns;
    size_t length; /* 0: the place is free */
    int16_t rssi;
    uint8_t frame[MAX_FRAME];
} delayed[MAX_DELAYED];

static struct hopped {
    uint8_t mac[6];
    uint16_t sequence;
    bool is_used;
} hopped[MAX_HOPPED];
static size_t hopped_next;

static int air = -1, control = -1, stop = -1;
static pthread_t thread;
static uint64_t state; /* of the random number generator */

/* Returns a random number from 0 to 1, 1 excluded; xorshift64* (Vigna, 2016). */
static double chance(void)
{
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return (double)((state * 0x2545F4914F6CDD1DULL) >> 11) * 0x1.0p-53;
}

static bool seen_before(const struct packet *packet)
{
    for (size_t at = 0; at < MAX_HOPPED; at++)
        if (hopped[at].is_used && hopped[at].sequence == packet->sequence &&
            memcmp(hopped[at].mac, packet->maker_mac, 6) == 0)
            return true;
    struct hopped *place = &hopped[hopped_next++ % MAX_HOPPED];
    *place = (struct hopped){.sequence = packet->sequence, .is_used = true};
    memcpy(place->mac, packet->maker_mac, 6);
    return false;
}

static void deliver(const uint8_t *frame, size_t length, int16_t rssi)
{
    struct packet packet;
    if (radio.settings.is_down)
        radio.counters.away++;
    else if (!geonet_decode(&packet, frame, length))
        radio.counters.foreign++;
    else if (memcmp(packet.source_mac, radio.settings.mac, 6) == 0 ||
             memcmp(packet.maker_mac, radio.settings.mac, 6) == 0)
        radio.counters.own++;
    else if (packet.is_multi_hop && seen_before(&packet))
        radio.counters.duplicate++;
    else {
        packet.rssi = rssi;
        casters_receive(&packet);
    }
}

static void delay(const uint8_t *frame, size_t length, int16_t rssi, double delay_ms)
{
    for (size_t at = 0; at < MAX_DELAYED; at++)
        if (!delayed[at].length) {
            delayed[at].due_ns = now_ns() + (int64_t)(delay_ms * MS);
            delayed[at].length = length;
            delayed[at].rssi = rssi;
            memcpy(delayed[at].frame, frame, length);
            return;
        }
    radio.counters.overflow++;
}

/* Returns the received power of a frame in dBm. The transmitter is at the position of the packet's source: these radios
 * forward nothing. */
static double strength(const uint8_t *frame, size_t length)
{
    struct packet packet;
    if (!radio.settings.has_power || !geonet_decode(&packet, frame, length))
        return radio.settings.rssi;
    double one = chance(), other = chance(); /* Box and Muller, 1958 */
    return path_power_dbm(&radio.settings, packet.source, sqrt(-2 * log(1 - one)) * cos(2 * M_PI * other));
}

/* Processes a frame that the air delivers; length is 0 for an empty or oversized frame. */
static void arrive(const uint8_t *frame, size_t length)
{
    const struct settings *settings = &radio.settings;
    radio.counters.heard++;
    if (!length) {
        radio.counters.foreign++;
        return;
    }
    if (settings->loss > 0 && chance() < settings->loss) {
        radio.counters.lost++;
        return;
    }
    double rssi = strength(frame, length);
    if (settings->has_power && rssi < settings->sensitivity) {
        radio.counters.faded++;
        return;
    }
    double delay_ms = settings->delay_ms;
    if (settings->jitter_ms)
        delay_ms += settings->jitter_ms * chance();
    if (settings->reorder > 0 && chance() < settings->reorder)
        delay_ms += REORDER_MS;
    if (delay_ms > 0)
        delay(frame, length, (int16_t)lround(rssi), delay_ms);
    else
        deliver(frame, length, (int16_t)lround(rssi));
}

static struct delayed *next_delayed(void)
{
    struct delayed *next = NULL;
    for (size_t at = 0; at < MAX_DELAYED; at++)
        if (delayed[at].length && (!next || delayed[at].due_ns < next->due_ns))
            next = &delayed[at];
    return next;
}

/* Delivers frames that are due; returns the ms until the next one, or -1. */
static int deliver_due(void)
{
    for (struct delayed *next; (next = next_delayed());) {
        int64_t left = next->due_ns - now_ns();
        if (left > 0)
            return (int)(left / MS) + 1;
        deliver(next->frame, next->length, next->rssi);
        next->length = 0;
    }
    return -1;
}

static void hear(void)
{
    uint8_t frame[MAX_FRAME + 1];
    for (int count = 0; count < BATCH; count++) {
        ssize_t length = recv(air, frame, sizeof frame, MSG_DONTWAIT);
        if (length < 0)
            return;
        arrive(frame, length > MAX_FRAME ? 0 : (size_t)length);
    }
}

static void obey(void)
{
    char text[MAX_TEXT], answer[MAX_TEXT];
    struct sockaddr_in from;
    socklen_t size = sizeof from;
    ssize_t length = recvfrom(control, text, sizeof text - 1, MSG_DONTWAIT, (struct sockaddr *)&from, &size);
    if (length < 0)
        return;
    text[length] = '\0';
    control_answer(text, answer, sizeof answer);
    sendto(control, answer, strlen(answer), 0, (struct sockaddr *)&from, size);
}

static int sooner(int one, int other)
{
    return one < 0 ? other : other < 0 || one < other ? one : other;
}

static void *listen_on(void *unused)
{
    struct pollfd watched[] = {{stop, POLLIN, 0}, {air, POLLIN, 0}, {control, POLLIN, 0}};
    (void)unused;
    while (!(watched[0].revents & POLLIN)) {
        pthread_mutex_lock(&radio.lock);
        if (watched[1].revents & POLLIN)
            hear();
        if (watched[2].revents & POLLIN)
            obey();
        int wait_ms = sooner(control_presence(), deliver_due());
        pthread_mutex_unlock(&radio.lock);
        if (poll(watched, 3, wait_ms) < 0)
            watched[0].revents = watched[1].revents = watched[2].revents = 0; /* a signal interrupted poll() */
    }
    return NULL;
}

static int open_socket(const struct sockaddr_in *at)
{
    int descriptor = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (descriptor >= 0 && bind(descriptor, (const struct sockaddr *)at, sizeof *at) < 0) {
        perror("simulated radio: bind");
        close(descriptor);
        return -1;
    }
    return descriptor;
}

bool air_open(void)
{
    const struct settings *settings = &radio.settings;
    state = settings->seed * 0x9E3779B97F4A7C15ULL | 1; /* never 0, and very different for consecutive seeds */
    stop = eventfd(0, EFD_CLOEXEC);
    air = open_socket(&settings->listen);
    if (settings->control.sin_family)
        control = open_socket(&settings->control);
    bool is_open = stop >= 0 && air >= 0 && (control >= 0 || !settings->control.sin_family);
    return is_open && pthread_create(&thread, NULL, listen_on, NULL) == 0;
}

void air_send(const uint8_t *frame, size_t length)
{
    for (size_t at = 0; at < radio.settings.peer_count; at++) {
        const struct sockaddr_in *peer = &radio.settings.peers[at];
        /* Errors are ignored: without a receiver, or with a full queue, the frame is lost, as on the air. */
        (void)!sendto(air, frame, length, MSG_DONTWAIT, (const struct sockaddr *)peer, sizeof *peer);
    }
}

void air_close(void)
{
    uint64_t one = 1;
    if (write(stop, &one, sizeof one) == sizeof one)
        pthread_join(thread, NULL);
    close(air);
    close(stop);
    if (control >= 0)
        close(control);
    air = control = stop = -1;
}

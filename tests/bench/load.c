#define _GNU_SOURCE
#include "load.h"

#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <zmq.h>

enum { RECEIVE_BUFFER = 32 << 20 };

/* linux/sock_diag.h: SO_MEMINFO gives nine u32, the last of them SK_MEMINFO_DROPS. */
enum { MEMINFO_WORDS = 9, MEMINFO_DROPS = 8 };

void stop_with(const char *what)
{
    fprintf(stderr, "%s: %s\n", what, errno != 0 ? zmq_strerror(errno) : "cannot be meant");
    exit(1);
}

static void read_prefix(struct load *load, const char *hex)
{
    size_t octets = strlen(hex) / 2;
    if (octets > MAX_PREFIX) {
        stop_with("prefix");
    }
    for (size_t i = 0; i < octets; i++) {
        unsigned value;
        if (sscanf(hex + 2 * i, "%2x", &value) != 1) {
            stop_with("prefix");
        }
        load->prefix[i] = (unsigned char)value;
    }
    load->prefix_octets = octets;
}

static void read_word(struct load *load, const char *name, const char *value)
{
    const struct { const char *name; unsigned *port; } ports[] = {
        {"from_users", &load->from_users}, {"to_users", &load->to_users}, {"report", &load->report},
        {"listen", &load->listen},         {"peer", &load->peer},
    };
    const struct { const char *name; double *number; } numbers[] = {
        {"rate", &load->rate}, {"duration", &load->duration_s}, {"grace", &load->grace_s},
        {"denm_rate", &load->denm_rate},
    };
    for (size_t i = 0; i < sizeof ports / sizeof *ports; i++) {
        if (strcmp(name, ports[i].name) == 0) {
            *ports[i].port = (unsigned)strtoul(value, NULL, 10);
            return;
        }
    }
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        if (strcmp(name, numbers[i].name) == 0) {
            *numbers[i].number = strtod(value, NULL);
            return;
        }
    }
    if (strcmp(name, "count") == 0) {
        load->count = strtoull(value, NULL, 10);
    } else if (strcmp(name, "way") == 0) {
        load->to_station = strcmp(value, "user-interface") == 0;
    } else if (strcmp(name, "push") == 0) {
        load->push = atoi(value);
    } else if (strcmp(name, "raw") == 0) {
        load->raw = atoi(value);
    } else if (strcmp(name, "prefix") == 0) {
        read_prefix(load, value);
    } else {
        stop_with(name);
    }
}

void load_read(struct load *load, int argc, char **argv)
{
    *load = (struct load){.duration_s = 10, .grace_s = 1};
    for (int i = 1; i < argc; i++) {
        char *equals = strchr(argv[i], '=');
        if (equals == NULL) {
            stop_with(argv[i]);
        }
        *equals = '\0';
        read_word(load, argv[i], equals + 1);
    }
}

uint64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

void sleep_until_ns(uint64_t when)
{
    struct timespec moment = {.tv_sec = (time_t)(when / 1000000000u), .tv_nsec = (long)(when % 1000000000u)};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &moment, NULL) == EINTR) {
    }
}

size_t message_make(unsigned char *message, const struct load *load, unsigned char message_id)
{
    memcpy(message, load->prefix, load->prefix_octets);
    unsigned char *pdu = message + load->prefix_octets;
    memset(pdu, 0, PDU_OCTETS);
    pdu[0] = 2; /* protocolVersion */
    pdu[1] = message_id;
    pdu[5] = 42; /* stationID */
    return load->prefix_octets + PDU_OCTETS;
}

void message_stamp(unsigned char *message, const struct load *load, uint64_t number, uint64_t time_ns)
{
    unsigned char *pdu = message + load->prefix_octets;
    memcpy(pdu + AT_NUMBER, &number, sizeof number);
    memcpy(pdu + AT_TIME, &time_ns, sizeof time_ns);
}

uint64_t pdu_time(const unsigned char *pdu)
{
    uint64_t time_ns;
    memcpy(&time_ns, pdu + AT_TIME, sizeof time_ns);
    return time_ns;
}

static struct sockaddr_in loopback(unsigned port)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
}

int udp_open(unsigned port, unsigned to)
{
    int descriptor = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    struct sockaddr_in here = loopback(port);
    int octets = RECEIVE_BUFFER;
    /* The sink must not be what loses: beyond rmem_max where that is allowed. */
    if (setsockopt(descriptor, SOL_SOCKET, SO_RCVBUFFORCE, &octets, sizeof octets) != 0) {
        setsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &octets, sizeof octets);
    }
    if (bind(descriptor, (struct sockaddr *)&here, sizeof here) != 0) {
        stop_with("UDP bind");
    }
    struct sockaddr_in there = loopback(to);
    if (to != 0 && connect(descriptor, (struct sockaddr *)&there, sizeof there) != 0) {
        stop_with("UDP connect");
    }
    return descriptor;
}

uint64_t udp_drops(int descriptor)
{
    uint32_t words[MEMINFO_WORDS] = {0};
    socklen_t octets = sizeof words;
    if (getsockopt(descriptor, SOL_SOCKET, SO_MEMINFO, words, &octets) != 0) {
        stop_with("SO_MEMINFO");
    }
    return words[MEMINFO_DROPS];
}

void *user_socket(void *context, int type, unsigned port, const char *subscription)
{
    void *socket = zmq_socket(context, type);
    char address[64];
    int unbounded = 0;
    int linger_ms = 0;
    int reconnect_ms = 2;
    snprintf(address, sizeof address, "tcp://127.0.0.1:%u", port);
    zmq_setsockopt(socket, ZMQ_LINGER, &linger_ms, sizeof linger_ms);
    zmq_setsockopt(socket, ZMQ_RECONNECT_IVL, &reconnect_ms, sizeof reconnect_ms);
    if (type == ZMQ_SUB) {
        zmq_setsockopt(socket, ZMQ_RCVHWM, &unbounded, sizeof unbounded);
        zmq_setsockopt(socket, ZMQ_SUBSCRIBE, subscription, strlen(subscription));
    }
    if (zmq_connect(socket, address) != 0) {
        stop_with(address);
    }
    return socket;
}

static int ascending(const void *left, const void *right)
{
    uint64_t a = *(const uint64_t *)left;
    uint64_t b = *(const uint64_t *)right;
    return (a > b) - (a < b);
}

void print_latencies(const char *name, uint64_t *values_ns, size_t count)
{
    qsort(values_ns, count, sizeof *values_ns, ascending);
    double median = count > 0 ? (double)values_ns[count / 2] / 1e3 : -1;
    double p99 = count > 0 ? (double)values_ns[(count * 99) / 100] / 1e3 : -1;
    double most = count > 0 ? (double)values_ns[count - 1] / 1e3 : -1;
    printf("\"%s\": {\"count\": %zu, \"median_us\": %.1f, \"p99_us\": %.1f, \"max_us\": %.1f}", name, count, median,
           p99, most);
}

/* The floor: what a forwarder of the same work costs in C on libzmq. It receives, classifies and sends, nothing else.
 *
 * usage: floor FROM_USERS TO_USERS LISTEN PEER     TCP, TCP, UDP, UDP port, all on 127.0.0.1
 *
 * user -> interface: two frames; `v2x.` is classified by octet 1 of the PDU, `v2x.<type>.` is believed; one datagram.
 * interface -> user: a datagram is classified by octet 1 and published as `v2x.<type>.` and the PDU. */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>
#include <zmq.h>

enum {
    ITS_HEADER = 6,
    MAX_PDU = 1500,
    TURN = 64, /* messages taken from one side before the other is looked at */
    /* The station's own values: else buffers would be compared, not work. */
    RECEIVE_BUFFER = 4 << 20,
    FROM_USERS_HIGH_WATER = 10000,
    TO_USERS_HIGH_WATER = 8192,
};

/* messageID -> type, TS 102 894-2 and the vehicleCAPTAIN envelope names. */
static const char *const TYPES[256] = {
    [1] = "denm",    [2] = "cam",                [3] = "poi",    [4] = "spatem", [5] = "mapem",
    [6] = "ivim",    [7] = "ev_rsr",             [9] = "srem",   [10] = "ssem",  [11] = "evcsn",
    [8] = "tistpgtransaction", [12] = "saem",    [13] = "rtcmem", [14] = "cpm",  [16] = "vam",
    [102] = "vam",
};

struct envelope {
    char text[32];
    size_t octets;
};

struct floor {
    void *from_users; /* SUB */
    void *to_users;   /* PUB */
    int in;           /* UDP */
    int out;          /* UDP, connected */
};

static struct envelope envelopes[256];

static void stop_with(const char *what)
{
    fprintf(stderr, "floor: %s: %s\n", what, zmq_strerror(errno));
    exit(1);
}

static void make_envelopes(void)
{
    for (int id = 0; id < 256; id++) {
        if (TYPES[id] != NULL) {
            int octets = snprintf(envelopes[id].text, sizeof envelopes[id].text, "v2x.%s.", TYPES[id]);
            envelopes[id].octets = (size_t)octets;
        }
    }
}

static int is_known(const char *text, size_t octets)
{
    for (int id = 0; id < 256; id++) {
        if (envelopes[id].octets == octets && memcmp(envelopes[id].text, text, octets) == 0) {
            return 1;
        }
    }
    return 0;
}

static int may_leave(zmq_msg_t *envelope, zmq_msg_t *pdu)
{
    const char *text = zmq_msg_data(envelope);
    const unsigned char *octets = zmq_msg_data(pdu);
    size_t count = zmq_msg_size(pdu);
    if (zmq_msg_size(envelope) == 4 && memcmp(text, "v2x.", 4) == 0) {
        return count >= ITS_HEADER && count <= MAX_PDU && envelopes[octets[1]].octets != 0;
    }
    return count > 0 && count <= MAX_PDU && is_known(text, zmq_msg_size(envelope));
}

/* Returns 0 when nothing is left to read. */
static int forward_request(const struct floor *floor)
{
    zmq_msg_t frames[3]; /* envelope, PDU, and room for all that follow */
    for (int i = 0; i < 3; i++) {
        zmq_msg_init(&frames[i]);
    }
    int count = 0;
    int is_more = 1;
    while (is_more && zmq_msg_recv(&frames[count < 2 ? count : 2], floor->from_users, ZMQ_DONTWAIT) >= 0) {
        is_more = zmq_msg_more(&frames[count < 2 ? count : 2]);
        count++;
    }
    if (count >= 2 && may_leave(&frames[0], &frames[1])) {
        send(floor->out, zmq_msg_data(&frames[1]), zmq_msg_size(&frames[1]), 0);
    }
    for (int i = 0; i < 3; i++) {
        zmq_msg_close(&frames[i]);
    }
    return count > 0;
}

static int forward_indication(const struct floor *floor)
{
    unsigned char pdu[MAX_PDU + 1];
    ssize_t octets = recv(floor->in, pdu, sizeof pdu, MSG_DONTWAIT);
    if (octets < 0) {
        return 0;
    }
    if (octets >= ITS_HEADER && octets <= MAX_PDU && envelopes[pdu[1]].octets != 0) {
        const struct envelope *envelope = &envelopes[pdu[1]];
        zmq_send(floor->to_users, envelope->text, envelope->octets, ZMQ_SNDMORE);
        zmq_send(floor->to_users, pdu, (size_t)octets, 0);
    }
    return 1;
}

static void *user_socket(void *context, int type, const char *port)
{
    void *socket = zmq_socket(context, type);
    char address[64];
    int high_water = type == ZMQ_SUB ? FROM_USERS_HIGH_WATER : TO_USERS_HIGH_WATER;
    snprintf(address, sizeof address, "tcp://127.0.0.1:%s", port);
    if (type == ZMQ_SUB) {
        zmq_setsockopt(socket, ZMQ_SUBSCRIBE, "", 0);
    }
    zmq_setsockopt(socket, type == ZMQ_SUB ? ZMQ_RCVHWM : ZMQ_SNDHWM, &high_water, sizeof high_water);
    if (zmq_bind(socket, address) != 0) {
        stop_with(address);
    }
    return socket;
}

static struct sockaddr_in loopback(const char *port)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(port))};
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
}

static int open_in(const char *port)
{
    int descriptor = socket(AF_INET, SOCK_DGRAM, 0);
    int octets = RECEIVE_BUFFER;
    struct sockaddr_in here = loopback(port);
    setsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &octets, sizeof octets);
    if (bind(descriptor, (struct sockaddr *)&here, sizeof here) != 0) {
        stop_with("UDP bind");
    }
    return descriptor;
}

static int open_out(const char *port)
{
    int descriptor = socket(AF_INET, SOCK_DGRAM, 0);
    struct sockaddr_in there = loopback(port);
    if (connect(descriptor, (struct sockaddr *)&there, sizeof there) != 0) {
        stop_with("UDP connect");
    }
    return descriptor;
}

static void watch(int epoll, int descriptor)
{
    struct epoll_event event = {.events = EPOLLIN, .data.fd = descriptor};
    if (epoll_ctl(epoll, EPOLL_CTL_ADD, descriptor, &event) != 0) {
        stop_with("epoll");
    }
}

static int descriptor_of(void *socket)
{
    int descriptor;
    size_t octets = sizeof descriptor;
    zmq_getsockopt(socket, ZMQ_FD, &descriptor, &octets);
    return descriptor;
}

int main(int argc, char **argv)
{
    if (argc != 5) {
        fprintf(stderr, "usage: floor FROM_USERS TO_USERS LISTEN PEER\n");
        return 2;
    }
    make_envelopes();
    void *context = zmq_ctx_new();
    struct floor floor = {
        .from_users = user_socket(context, ZMQ_SUB, argv[1]),
        .to_users = user_socket(context, ZMQ_PUB, argv[2]),
        .in = open_in(argv[3]),
        .out = open_out(argv[4]),
    };
    int epoll = epoll_create1(0);
    watch(epoll, descriptor_of(floor.from_users));
    watch(epoll, floor.in);
    /* The descriptor of a ZeroMQ socket tells of changes only: go round until a side has nothing left. */
    int is_busy = 1;
    for (;;) {
        struct epoll_event events[2];
        epoll_wait(epoll, events, 2, is_busy ? 0 : -1);
        int requests = 0;
        int indications = 0;
        while (requests < TURN && forward_request(&floor)) {
            requests++;
        }
        while (indications < TURN && forward_indication(&floor)) {
            indications++;
        }
        is_busy = requests == TURN || indications == TURN;
    }
}

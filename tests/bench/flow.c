/* Sends PDUs through a subject one way at a fixed rate, or as fast as it goes, and tells what arrived and when.
 *
 * One process and one clock. The sender paces by absolute times; the receiver is a thread that blocks.
 * Bounded by count, duration and grace. The result is one JSON object on stdout. */
#define _GNU_SOURCE
#include "load.h"

#include <netinet/in.h>
#include <netinet/udp.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <zmq.h>

enum {
    TICK_NS = 100000,       /* at high rates messages leave in bundles, at most one per tick */
    LATENCY_RATE = 1000,    /* the highest at which single messages are timed: each by itself, sink blocked */
    MAX_VALUES = 1 << 20,   /* latencies kept; those beyond are counted only */
    PATIENCE_MS = 20,       /* how long a blocked receiver goes without looking whether it is over */
    SETTLE_MS = 250,        /* a subscription must have travelled; PUB and SUB cannot tell */
    SECOND_NS = 1000000000,
};

struct arrivals {
    uint64_t *values_ns;
    size_t kept;
    uint64_t count;
};

struct flow;
typedef uint64_t send_function(struct flow *flow, unsigned char messages[][MAX_DATAGRAM], uint64_t count);

struct flow {
    struct load load;
    send_function *send;
    void *context;
    void *user;        /* PUB or PUSH to the subject, or SUB */
    int udp;           /* towards the subject, or the sink */
    int flood;         /* towards the subject, cut into datagrams by the kernel */
    atomic_bool over;
    atomic_uint_fast64_t received;
    uint64_t last_ns;  /* when the latest arrived */
    uint64_t watched;  /* messages of raw. and of the report port */
    struct arrivals cams;
    struct arrivals denms;
};

/* --- receiving --- */

static void note(struct flow *flow, const unsigned char *pdu, uint64_t now)
{
    struct arrivals *arrivals = pdu[1] == DENM ? &flow->denms : &flow->cams;
    if (arrivals->kept < MAX_VALUES) {
        arrivals->values_ns[arrivals->kept++] = now - pdu_time(pdu);
    }
    arrivals->count++;
    flow->last_ns = now;
    atomic_fetch_add_explicit(&flow->received, 1, memory_order_relaxed);
}

static void *receive_as_user(void *argument)
{
    struct flow *flow = argument;
    unsigned char pdu[MAX_DATAGRAM];
    while (!atomic_load(&flow->over)) {
        if (zmq_recv(flow->user, pdu, sizeof pdu, 0) < 0) {
            continue;
        }
        int octets = zmq_recv(flow->user, pdu, sizeof pdu, 0);
        if (octets == PDU_OCTETS) {
            note(flow, pdu, now_ns());
        }
    }
    return NULL;
}

static void *receive_as_interface(void *argument)
{
    struct flow *flow = argument;
    static unsigned char buffers[BATCH][MAX_DATAGRAM];
    struct iovec parts[BATCH];
    struct mmsghdr messages[BATCH];
    memset(messages, 0, sizeof messages);
    for (int i = 0; i < BATCH; i++) {
        parts[i] = (struct iovec){buffers[i], MAX_DATAGRAM};
        messages[i].msg_hdr.msg_iov = &parts[i];
        messages[i].msg_hdr.msg_iovlen = 1;
    }
    size_t expected = flow->load.prefix_octets + PDU_OCTETS;
    /* A sink that blocks is woken by every datagram, at the sender's cost, the more the slower the sender is. */
    int is_lazy = flow->load.rate > LATENCY_RATE || flow->load.rate <= 0;
    while (!atomic_load(&flow->over)) {
        int count = recvmmsg(flow->udp, messages, BATCH, is_lazy ? MSG_DONTWAIT : MSG_WAITFORONE, NULL);
        uint64_t now = now_ns();
        if (count < 0 && is_lazy) {
            sleep_until_ns(now + TICK_NS);
        }
        for (int i = 0; i < count; i++) {
            if (messages[i].msg_len == expected) {
                note(flow, buffers[i] + flow->load.prefix_octets, now);
            }
        }
    }
    return NULL;
}

/* A user who reads everything else that the subject tells, so that the subject has to tell it. */
static void *watch(void *argument)
{
    struct flow *flow = argument;
    void *sockets[2];
    zmq_pollitem_t items[2];
    int count = 0;
    if (flow->load.raw) {
        sockets[count++] = user_socket(flow->context, ZMQ_SUB, flow->load.to_users, "raw.");
    }
    if (flow->load.report != 0) {
        sockets[count++] = user_socket(flow->context, ZMQ_SUB, flow->load.report, "");
    }
    for (int i = 0; i < count; i++) {
        items[i] = (zmq_pollitem_t){.socket = sockets[i], .events = ZMQ_POLLIN};
    }
    while (!atomic_load(&flow->over)) {
        zmq_poll(items, count, PATIENCE_MS);
        for (int i = 0; i < count; i++) {
            char octets[MAX_DATAGRAM];
            while (zmq_recv(sockets[i], octets, sizeof octets, ZMQ_DONTWAIT) >= 0) {
                flow->watched++;
            }
        }
    }
    for (int i = 0; i < count; i++) {
        zmq_close(sockets[i]);
    }
    return NULL;
}

/* --- sending --- */

static uint64_t send_as_user(struct flow *flow, unsigned char messages[][MAX_DATAGRAM], uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        const unsigned char *pdu = messages[i] + flow->load.prefix_octets;
        zmq_send(flow->user, "v2x.", 4, ZMQ_SNDMORE);
        zmq_send(flow->user, pdu, PDU_OCTETS, 0);
    }
    return count;
}

static uint64_t send_as_interface(struct flow *flow, unsigned char messages[][MAX_DATAGRAM], uint64_t count)
{
    struct iovec parts[BATCH];
    struct mmsghdr headers[BATCH];
    memset(headers, 0, sizeof headers);
    for (uint64_t i = 0; i < count; i++) {
        parts[i] = (struct iovec){messages[i], flow->load.prefix_octets + PDU_OCTETS};
        headers[i].msg_hdr.msg_iov = &parts[i];
        headers[i].msg_hdr.msg_iovlen = 1;
    }
    int sent = sendmmsg(flow->udp, headers, (unsigned)count, 0);
    return sent > 0 ? (uint64_t)sent : 0;
}

/* As send_as_interface, for what has no rate: one system call and one way through the stack, where the kernel cuts
 * the datagrams apart (UDP_SEGMENT, udp(7)). All of them go to the socket that the first one is steered to, so a
 * DENM travels by itself. */
static uint64_t flood_as_interface(struct flow *flow, unsigned char messages[][MAX_DATAGRAM], uint64_t count)
{
    static unsigned char segments[BATCH * (MAX_PREFIX + PDU_OCTETS)];
    size_t octets = flow->load.prefix_octets + PDU_OCTETS;
    uint64_t sent = 0;
    if (messages[0][flow->load.prefix_octets + 1] == DENM) {
        sent = send_as_interface(flow, messages, 1);
        messages++;
        count--;
    }
    for (uint64_t i = 0; i < count; i++) {
        memcpy(segments + i * octets, messages[i], octets);
    }
    return sent + (count > 0 && send(flow->flood, segments, count * octets, 0) > 0 ? count : 0);
}

struct sending {
    unsigned char messages[BATCH][MAX_DATAGRAM];
    uint64_t start;
    uint64_t end;
    uint64_t sent;
    uint64_t denms;
};

/* How many messages are due; sleeps where none is. */
static uint64_t due(const struct load *load, struct sending *sending)
{
    uint64_t left = load->count == 0 ? BATCH : load->count - sending->sent;
    if (load->rate <= 0) {
        return left < BATCH ? left : BATCH;
    }
    uint64_t next = sending->start + (uint64_t)((double)sending->sent / load->rate * SECOND_NS);
    uint64_t now = now_ns();
    if (now < next) {
        uint64_t tick = load->rate > LATENCY_RATE ? now + TICK_NS : 0;
        sleep_until_ns(next > tick ? next : tick);
        now = now_ns();
    }
    uint64_t wanted = (uint64_t)((double)(now - sending->start) * load->rate / SECOND_NS) + 1 - sending->sent;
    wanted = wanted < left ? wanted : left;
    return wanted < BATCH ? wanted : BATCH;
}

static void send_all(struct flow *flow, struct sending *sending)
{
    const struct load *load = &flow->load;
    size_t id_at = load->prefix_octets + 1;
    for (int i = 0; i < BATCH; i++) {
        message_make(sending->messages[i], load, CAM);
    }
    sending->start = now_ns();
    sending->end = sending->start + (uint64_t)(load->duration_s * SECOND_NS);
    while ((load->count == 0 || sending->sent < load->count) && now_ns() < sending->end) {
        uint64_t count = due(load, sending);
        uint64_t now = now_ns();
        for (uint64_t i = 0; i < count; i++) {
            message_stamp(sending->messages[i], load, sending->sent + i, now);
            sending->messages[i][id_at] = CAM;
        }
        double elapsed_s = (double)(now - sending->start) / SECOND_NS;
        int is_denm = count > 0 && (double)sending->denms < elapsed_s * load->denm_rate;
        if (is_denm) {
            sending->messages[0][id_at] = DENM;
        }
        uint64_t sent = flow->send(flow, sending->messages, count);
        sending->denms += is_denm && sent > 0;
        sending->sent += sent;
    }
    sending->end = now_ns();
}

/* --- both --- */

static void open_sockets(struct flow *flow)
{
    const struct load *load = &flow->load;
    if (load->to_station) {
        struct timeval patience = {.tv_usec = PATIENCE_MS * 1000};
        flow->user = user_socket(flow->context, load->push ? ZMQ_PUSH : ZMQ_PUB, load->from_users, "");
        flow->udp = udp_open(load->peer, 0);
        setsockopt(flow->udp, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    } else {
        int patience_ms = PATIENCE_MS;
        int octets = (int)load->prefix_octets + PDU_OCTETS;
        flow->user = user_socket(flow->context, ZMQ_SUB, load->to_users, "v2x.");
        zmq_setsockopt(flow->user, ZMQ_RCVTIMEO, &patience_ms, sizeof patience_ms);
        flow->udp = udp_open(0, load->listen);
        flow->flood = udp_open(0, load->listen);
        setsockopt(flow->flood, IPPROTO_UDP, UDP_SEGMENT, &octets, sizeof octets);
    }
    sleep_until_ns(now_ns() + SETTLE_MS * 1000000ull);
}

static void wait_for_the_rest(struct flow *flow, uint64_t sent)
{
    uint64_t end = now_ns() + (uint64_t)(flow->load.grace_s * SECOND_NS);
    while (atomic_load(&flow->received) < sent && now_ns() < end) {
        sleep_until_ns(now_ns() + 1000000);
    }
    atomic_store(&flow->over, 1);
}

static void report(struct flow *flow, const struct sending *sending)
{
    double elapsed_s = (double)(sending->end - sending->start) / SECOND_NS;
    double lag_ms = flow->last_ns > sending->end ? (double)(flow->last_ns - sending->end) / 1e6 : 0;
    printf("{\"sent\": %lu, \"received\": %lu, \"denms_sent\": %lu, \"sink_drops\": %lu, \"watched\": %lu, ",
           sending->sent, flow->cams.count + flow->denms.count, sending->denms,
           flow->load.to_station ? udp_drops(flow->udp) : 0, flow->watched);
    printf("\"elapsed_s\": %.4f, \"rate\": %.0f, \"lag_ms\": %.2f, ", elapsed_s, (double)sending->sent / elapsed_s,
           lag_ms);
    print_latencies("cam", flow->cams.values_ns, flow->cams.kept);
    printf(", ");
    print_latencies("denm", flow->denms.values_ns, flow->denms.kept);
    printf("}\n");
}

int main(int argc, char **argv)
{
    static struct flow flow;
    static struct sending sending;
    load_read(&flow.load, argc, argv);
    flow.context = zmq_ctx_new();
    flow.cams.values_ns = calloc(MAX_VALUES, sizeof(uint64_t));
    flow.denms.values_ns = calloc(MAX_VALUES, sizeof(uint64_t));
    pthread_t receiver;
    pthread_t watcher;
    int has_watcher = flow.load.raw || flow.load.report != 0;
    if (has_watcher) {
        pthread_create(&watcher, NULL, watch, &flow);
    }
    open_sockets(&flow);
    flow.send = flow.load.to_station ? send_as_user : flow.load.rate > 0 ? send_as_interface : flood_as_interface;
    pthread_create(&receiver, NULL, flow.load.to_station ? receive_as_interface : receive_as_user, &flow);
    send_all(&flow, &sending);
    wait_for_the_rest(&flow, sending.sent);
    pthread_join(receiver, NULL);
    if (has_watcher) {
        pthread_join(watcher, NULL);
    }
    report(&flow, &sending);
    zmq_close(flow.user);
    zmq_ctx_term(flow.context);
    return 0;
}

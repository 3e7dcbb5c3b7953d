/* What the generators and sinks of the benchmark share: time, PDUs that carry it, sockets, results. */
#ifndef LOAD_H
#define LOAD_H

#include <stddef.h>
#include <stdint.h>

enum {
    PDU_OCTETS = 300,
    ITS_HEADER = 6,   /* protocolVersion, messageID, stationID: TS 102 894-2, ItsPduHeader */
    AT_NUMBER = 6,    /* sequence number, u64 of this host */
    AT_TIME = 14,     /* CLOCK_MONOTONIC when it was sent, ns, u64 of this host */
    MAX_PREFIX = 64,  /* octets of lower layers in front of the PDU */
    MAX_DATAGRAM = 2048,
    BATCH = 64,       /* datagrams of one sendmmsg or recvmmsg */
    CAM = 2,
    DENM = 1,
};

/* Where the subject listens, how it is loaded. Read from words `name=value` of the command line. */
struct load {
    int to_station;       /* true: user -> interface; false: interface -> user */
    int push;             /* user -> interface through PUSH instead of PUB */
    unsigned from_users;  /* TCP port of the subject's SUB or PULL */
    unsigned to_users;    /* TCP port of the subject's PUB */
    unsigned report;      /* TCP port whose messages are read and counted; 0: none */
    unsigned listen;      /* UDP port of the subject */
    unsigned peer;        /* UDP port that it sends to: ours */
    int raw;              /* subscribe to raw. as well, on a socket of its own */
    double rate;          /* messages per second; 0: as many as go */
    uint64_t count;       /* messages, at most; 0: only duration_s ends it */
    double duration_s;
    double grace_s;       /* wait this long for what is still on its way */
    double denm_rate;     /* DENMs per second among the CAMs */
    unsigned char prefix[MAX_PREFIX];
    size_t prefix_octets;
};

/* Ends the program with a message when the words cannot be read. */
void load_read(struct load *load, int argc, char **argv);

void stop_with(const char *what) __attribute__((noreturn));

uint64_t now_ns(void);
void sleep_until_ns(uint64_t when);

/* message becomes prefix + PDU of PDU_OCTETS; returns its octets. */
size_t message_make(unsigned char *message, const struct load *load, unsigned char message_id);
/* Number and time of sending into a message made so. */
void message_stamp(unsigned char *message, const struct load *load, uint64_t number, uint64_t time_ns);
uint64_t pdu_time(const unsigned char *pdu);

/* A UDP socket bound to 127.0.0.1:port (0: any) with a large receive buffer; sends to 127.0.0.1:to if to is not 0. */
int udp_open(unsigned port, unsigned to);
/* Datagrams that the kernel dropped before the socket was read (SO_MEMINFO, SK_MEMINFO_DROPS). */
uint64_t udp_drops(int descriptor);

/* A connected socket of the context; subscription is for SUB only. */
void *user_socket(void *context, int type, unsigned port, const char *subscription);

/* Sorts values; prints `"name": {"count":, "median":, "p99":, "max":}` in microseconds. */
void print_latencies(const char *name, uint64_t *values_ns, size_t count);

#endif

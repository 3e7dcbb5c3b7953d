/* Handlers of a process, each with its owner thread and its queue of received PDUs. */
#ifndef CASTERS_H
#define CASTERS_H

#include "radio.h"

enum { MAX_HANDLERS = 64, QUEUE = 32 };

struct received {
    struct rx_info info;
    size_t length;
    uint8_t octets[MAX_PAYLOAD];
};

struct caster {
    bool is_open;
    pthread_t owner; /* the thread that created it; other threads are refused */
    unsigned epoch;
    int mode;
    uint16_t caster_id;
    uint16_t btp_port; /* of its profile */
    size_t first, count;
    struct received queue[QUEUE]; /* ring buffer */
};

/* All of these need the lock held by the caller. */
int casters_open(int mode, const struct profile *profile); /* returns the handler; -1 above the limit */
struct caster *casters_find(int handler);                  /* NULL if it does not exist */
const struct profile *casters_profile(uint16_t caster_id); /* NULL if the module has none */
bool casters_wait(int64_t until_ns);                       /* waits for a change; returns false on timeout */

#endif

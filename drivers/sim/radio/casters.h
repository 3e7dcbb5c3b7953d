/* The handlers of a process: who may use each, and what was received for it. */
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
    pthread_t owner; /* the thread that made it: no other may use it */
    unsigned epoch;
    int mode;
    uint16_t caster_id;
    uint16_t btp_port; /* of its profile */
    size_t first, count;
    struct received queue[QUEUE]; /* a ring */
};

/* The lock is held in all of them. */
int casters_open(int mode, const struct profile *profile); /* the handler, or -1: too many */
struct caster *casters_find(int handler);                  /* NULL: there is none */
const struct profile *casters_profile(uint16_t caster_id); /* NULL: the module has none */
bool casters_wait(int64_t until_ns);                       /* for a change; false when the time is over */

#endif

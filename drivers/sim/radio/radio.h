/* State of the simulated module of a process, shared by the library's calls, the casters and the air. */
#ifndef RADIO_H
#define RADIO_H

#include <pthread.h>

#include "geonet.h"
#include "settings.h"

/* Counters that the control port answers. Each frame in `heard` is also counted as one of lost, away, foreign, own,
 * duplicate, faded, no_caster, overflow or delivered, or is still in transit. */
struct counters {
    unsigned sent;      /* frames sent by casters */
    unsigned heard;     /* received frames */
    unsigned lost;      /* lost by settings.loss */
    unsigned faded;     /* below settings.sensitivity */
    unsigned away;      /* the module was absent */
    unsigned foreign;   /* frames other than unsecured broadcasts of a PDU */
    unsigned own;       /* frames sent by this radio */
    unsigned duplicate; /* repeated multi-hop packets */
    unsigned no_caster; /* for a BTP port without a receiving caster */
    unsigned overflow;  /* a caster's queue was full, or too many frames were delayed */
    unsigned delivered; /* put into a caster's queue */
    unsigned created;   /* handlers created since the start */
};

struct radio {
    pthread_mutex_t lock; /* protects all following fields */
    struct settings settings;
    struct counters counters;
    bool is_running; /* true between eu_caster_init and eu_caster_deinit */
    unsigned epoch;  /* how often the module has disappeared; handlers of an earlier epoch are invalid */
};

extern struct radio radio;

int64_t now_ns(void);

/* casters.c */
void casters_receive(const struct packet *packet); /* needs the lock held */
void casters_wake(void);                           /* wakes waiting calls after a change */

/* air.c */
bool air_open(void);                                /* needs the lock held */
void air_send(const uint8_t *frame, size_t length); /* needs the lock held */
void air_close(void);                               /* needs the lock released */

/* control.c; these need the lock held */
void control_start(void);
int control_presence(void); /* applies down_after and down_for; returns ms until the next change, or -1 */
void control_answer(const char *command, char *answer, size_t size);

#endif

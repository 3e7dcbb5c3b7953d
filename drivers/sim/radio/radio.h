/* The one simulated module of a process: what the library's calls, the casters and the air have in common. */
#ifndef RADIO_H
#define RADIO_H

#include <pthread.h>

#include "geonet.h"
#include "settings.h"

/* What the control port answers. All that was heard is counted once more: lost, away, foreign, own, duplicate,
 * faded, no_caster, overflow or delivered; or it is still on its way. */
struct counters {
    unsigned sent;      /* by casters */
    unsigned heard;     /* frames that the air brought */
    unsigned lost;      /* by settings.loss */
    unsigned faded;     /* weaker than settings.sensitivity */
    unsigned away;      /* the module was not there */
    unsigned foreign;   /* frames without a PDU to everybody in the clear */
    unsigned own;       /* frames of this radio */
    unsigned duplicate; /* of a packet that is passed on from station to station */
    unsigned no_caster; /* for a BTP port that no receiving caster is for */
    unsigned overflow;  /* a caster's queue was full, or too many were delayed */
    unsigned delivered; /* put into a caster's queue */
    unsigned created;   /* handlers, ever */
};

struct radio {
    pthread_mutex_t lock; /* of all that follows */
    struct settings settings;
    struct counters counters;
    bool is_running; /* between eu_caster_init and eu_caster_deinit, with a module to talk to */
    unsigned epoch;  /* counts how often the module went away: a handler of an earlier epoch is dead */
};

extern struct radio radio;

int64_t now_ns(void);

/* casters.c */
void casters_receive(const struct packet *packet); /* the lock is held */
void casters_wake(void);                           /* something changed: who waits looks again */

/* air.c */
bool air_open(void);                                /* the lock is held */
void air_send(const uint8_t *frame, size_t length); /* the lock is held */
void air_close(void);                               /* the lock is not held */

/* control.c; the lock is held */
void control_start(void);
int control_presence(void); /* goes away and comes back as the settings say; ms until the next change, or -1 */
void control_answer(const char *command, char *answer, size_t size);

#endif

/* Settings of the simulated radio: read from CAPTAIN_SIM_RADIO, changed by datagrams to its control port.
 *
 * Settings are words `key=value`, separated by blanks. The comment of each field has an example and the meaning.
 */
#ifndef SETTINGS_H
#define SETTINGS_H

#include <netinet/in.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "v2xcast.h"

#define MAX_PEERS 16
#define MAX_PROFILES 32
#define MAX_FAILURES 16
#define MAX_BUILDINGS 8

enum call { CALL_INIT, CALL_CREATE, CALL_TX, CALL_RX, CALL_RELEASE, CALLS };

/* Makes the next calls fail, with an error number and a count: fail=create:-6156:3 */
struct failure {
    enum call call;
    int number;
    unsigned times;
};

/* Service in the profile of the module. */
struct profile {
    uint16_t btp_port, caster_id;
};

/* Building between radios, with walls along parallels and meridians; corners in 1e-7 degree. */
struct building {
    struct position corner, opposite;
};

struct settings {
    struct sockaddr_in listen;  /* listen=127.0.0.1:8947   address that receives frames; without it, no module */
    struct sockaddr_in control; /* control=127.0.0.1:8900  control port: accepts settings, answers with counters */
    struct sockaddr_in peers[MAX_PEERS]; /* peers=127.0.0.1:8949,127.0.0.1:8950  addresses that frames are sent to */
    size_t peer_count;

    double loss;        /* loss=0.1      share of received frames that are lost */
    double reorder;     /* reorder=0.05  share of frames delayed by REORDER_MS; later frames overtake them */
    unsigned delay_ms;  /* delay_ms=5    delay of received frames */
    unsigned jitter_ms; /* jitter_ms=2   additional random delay, uniform from 0 to this */
    uint64_t seed;      /* seed=1        of the random numbers */

    /* With a power, path.h computes the received power of each frame, and rssi is replaced by it. */
    bool has_power;
    double power;       /* power=23          dBm, transmit power of every radio, with antenna gains */
    double fading;      /* fading=3          dB, standard deviation of each frame's received power */
    double sensitivity; /* sensitivity=-92   dBm; weaker frames are not received */
    struct building buildings[MAX_BUILDINGS]; /* buildings=LAT:LON:LAT:LON,...  two opposite corners of each */
    size_t building_count;

    bool is_down;        /* down=1             the module is absent */
    unsigned down_after; /* down_after=30000   ms from eu_caster_init() until it disappears; 0: never */
    unsigned down_for;   /* down_for=30000     ms until it returns; 0: never */
    bool is_hanging[CALLS]; /* hang=tx  calls of this kind do not return until hang=none */
    bool crashes;        /* crash=1            the process ends by SIGSEGV */
    struct failure failures[MAX_FAILURES];

    struct profile profiles[MAX_PROFILES]; /* profiles=2001:0,2002:1  BTP port and caster id */
    size_t profile_count;
    unsigned limit;        /* limit=4          largest number of open handlers */
    unsigned handler_bits; /* handler_bits=32  size of a handler: 8, or 32 as in older SDKs */
    bool is_old;           /* sdk=1.7          use the error numbers of SDK 1.7 */
    bool has_texts;        /* texts=0          error_msg() returns an empty text */

    uint8_t mac[6];              /* mac=02:00:00:00:00:01 */
    int32_t latitude, longitude; /* position=476208330:128064540   1e-7 degree */
    int16_t rssi;                /* rssi=-71   dBm of every received frame, unless power is set */
    unsigned tx_ms;              /* tx_ms=1    duration of eu_caster_tx() */
};

/* Sets the defaults, which an empty text leaves unchanged. */
void settings_default(struct settings *settings);

/* Applies the settings of a text; returns false for an invalid word, and copies it to fault. */
bool settings_read(struct settings *settings, const char *text, char *fault, size_t size);

#endif

/* How the simulated radio behaves: read from CAPTAIN_SIM_RADIO, changed by datagrams at its control port.
 *
 * Words `key=value`, separated by blanks; what a key means stands beside its field.
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

/* The next so many calls fail with a number: fail=create:-6156:3 */
struct failure {
    enum call call;
    int number;
    unsigned times;
};

/* A service in the profile that is on the module. */
struct profile {
    uint16_t btp_port, caster_id;
};

/* What stands between radios: walls along parallels and meridians, 1e-7 degree. */
struct building {
    struct position corner, opposite;
};

struct settings {
    struct sockaddr_in listen;  /* listen=127.0.0.1:8947   where the air reaches it; without it there is no module */
    struct sockaddr_in control; /* control=127.0.0.1:8900  where it is told more settings; it answers with counters */
    struct sockaddr_in peers[MAX_PEERS]; /* peers=127.0.0.1:8949,127.0.0.1:8950  who hears it */
    size_t peer_count;

    double loss;        /* loss=0.1      of what the air brings, this share is lost */
    double reorder;     /* reorder=0.05  this share comes REORDER_MS later, behind what follows it */
    unsigned delay_ms;  /* delay_ms=5    from the air to the caster */
    unsigned jitter_ms; /* jitter_ms=2   up to so much longer, evenly spread */
    uint64_t seed;      /* seed=1        of all that is random */

    /* With a power, what a frame loses on its way decides, by path.h: rssi is how strong it arrives. */
    bool has_power;
    double power;       /* power=23          dBm that each radio sends with, antennas included */
    double fading;      /* fading=3          dB, standard deviation of each frame's strength */
    double sensitivity; /* sensitivity=-92   dBm: what is weaker is not received */
    struct building buildings[MAX_BUILDINGS]; /* buildings=LAT:LON:LAT:LON,...  two corners of each */
    size_t building_count;

    bool is_down;        /* down=1             the module is not there */
    unsigned down_after; /* down_after=30000   ms from eu_caster_init() until it goes away; 0: never */
    unsigned down_for;   /* down_for=30000     ms until it is back; 0: never */
    bool is_hanging[CALLS]; /* hang=tx  such calls do not return until hang=none */
    bool crashes;        /* crash=1            the process ends by SIGSEGV */
    struct failure failures[MAX_FAILURES];

    struct profile profiles[MAX_PROFILES]; /* profiles=2001:0,2002:1  BTP port and caster id */
    size_t profile_count;
    unsigned limit;        /* limit=4          handlers at a time */
    unsigned handler_bits; /* handler_bits=32  as in older SDKs */
    bool is_old;           /* sdk=1.7          its error numbers */
    bool has_texts;        /* texts=0          error_msg() says nothing */

    uint8_t mac[6];              /* mac=02:00:00:00:00:01 */
    int32_t latitude, longitude; /* position=476208330:128064540   1e-7 degree */
    int16_t rssi;                /* rssi=-71   dBm of all that is heard */
    unsigned tx_ms;              /* tx_ms=1    how long eu_caster_tx takes */
};

/* What an empty text means. */
void settings_default(struct settings *settings);

/* Take what a text says; false when a word of it is not understood, which is then named at fault. */
bool settings_read(struct settings *settings, const char *text, char *fault, size_t size);

#endif

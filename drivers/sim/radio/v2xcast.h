/* Calls of the vendor's library, as drivers/som301e/library.py loads them.
 *
 * Only names and layouts are the vendor's, known from public programs that use them (V2Xcast SDK 1.7 to 1.13).
 * Structs have natural alignment; a result of 0 or more is success.
 */
#ifndef V2XCAST_H
#define V2XCAST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/time.h>

#define MAX_PAYLOAD 1500 /* octets of a facilities PDU */
#define MAX_SSP 32

struct position {
    int32_t latitude, longitude; /* 1e-7 degree, WGS84 */
};

struct area {
    uint32_t type;                           /* 0 circle, 1 rectangle, 2 ellipse */
    uint16_t distance_a, distance_b, angle; /* metres; degrees from north */
};

struct security {
    uint32_t status; /* received: 0 none, 1 invalid, 2 verified, 3 not verifiable; sent: 0 unsecured, 1 signed */
    uint32_t its_aid;
    uint8_t ssp_length;
    uint8_t ssp[MAX_SSP];
};

struct rx_info {
    struct timeval timestamp;
    int16_t rssi;       /* dBm */
    uint16_t data_rate; /* in 500 kbit/s */
    uint8_t traffic_class;
    uint8_t hop_limit; /* remaining */
    struct security security;
    struct position position;
    struct area area;
    uint8_t source_mac[6];
};

/* A field is used only if its flag is set; otherwise the caster's profile on the module decides. */
struct tx_info {
    uint16_t btp_port;
    uint8_t data_rate; /* in 500 kbit/s */
    int8_t power;      /* dBm */
    uint8_t traffic_class;
    struct security security;
    struct position position; /* centre of the area */
    struct area area;
    bool has_btp_port, has_data_rate, has_power, has_traffic_class, has_security, has_position, has_area;
};

enum mode { MODE_TX = 0, MODE_RX = 1, MODE_POTI = 3 };

struct config {
    const char *ip;
    uint16_t caster_id;
    int mode;
};

#if UINTPTR_MAX == UINT64_MAX
_Static_assert(sizeof(struct rx_info) == 96 && offsetof(struct rx_info, rssi) == 16, "rx_info");
_Static_assert(offsetof(struct rx_info, security) == 24 && offsetof(struct rx_info, position) == 68, "rx_info");
_Static_assert(offsetof(struct rx_info, area) == 76 && offsetof(struct rx_info, source_mac) == 88, "rx_info");
_Static_assert(sizeof(struct config) == 16 && offsetof(struct config, mode) == 12, "config");
#endif
_Static_assert(sizeof(struct tx_info) == 80 && offsetof(struct tx_info, traffic_class) == 4, "tx_info");
_Static_assert(offsetof(struct tx_info, security) == 8 && offsetof(struct tx_info, position) == 52, "tx_info");
_Static_assert(offsetof(struct tx_info, area) == 60 && offsetof(struct tx_info, has_btp_port) == 72, "tx_info");

#define VISIBLE __attribute__((visibility("default")))

VISIBLE int eu_caster_init(void);
VISIBLE int eu_caster_deinit(void);

/* Creates a caster. A handler has 8 bits in SDK 1.13 and 32 bits before; the call writes only that many. */
VISIBLE int eu_caster_create(void *handler, const struct config *config);
VISIBLE int eu_caster_tx(int handler, const struct tx_info *info, const uint8_t *octets, size_t length);
VISIBLE int eu_caster_rx_timeout(int handler, struct rx_info *info, uint8_t *octets, size_t size, size_t *length,
                                 int timeout_ms);
VISIBLE int eu_caster_release(int handler);
VISIBLE const char *error_msg(int code);

#endif

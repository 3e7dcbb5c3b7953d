/* Ethernet, GeoNetworking (EN 302 636-4-1 V1.4.1) and BTP-B around a PDU: what the module does between caster and air. */
#ifndef GEONET_H
#define GEONET_H

#include <stddef.h>
#include <stdint.h>

#include "v2xcast.h"

/* Ethernet 14, basic header 4, common header 8, GeoBroadcast 44, BTP-B 4, and the PDU. */
#define MAX_FRAME (14 + 4 + 8 + 44 + 4 + MAX_PAYLOAD)

/* Who sends: the end of its GeoNetworking address, and its position vector. */
struct sender {
    uint8_t mac[6];
    uint32_t timestamp; /* ITS time in ms modulo 2**32 */
    struct position position;
};

/* A PDU with all that its headers say. */
struct packet {
    uint16_t btp_port;
    uint8_t traffic_class;
    uint8_t hop_limit; /* remaining; sent: of a GeoBroadcast */
    bool has_area;     /* a GeoBroadcast, else a single hop broadcast */
    bool is_multi_hop; /* others pass it on: its maker and sequence number tell it from others */
    uint16_t sequence;
    struct area area;
    struct position centre;
    struct position source;
    int16_t rssi;          /* dBm, of what arrived */
    uint8_t source_mac[6]; /* of the frame: who passed it on last */
    uint8_t maker_mac[6];  /* of the position vector: who made it */
    const uint8_t *payload;
    size_t length;
};

/* The frame of a packet; its length, at most MAX_FRAME. */
size_t geonet_encode(uint8_t frame[MAX_FRAME], const struct sender *sender, const struct packet *packet);

/* Takes a frame apart; the payload stays where it is. False for what carries no PDU to everybody in the clear. */
bool geonet_decode(struct packet *packet, const uint8_t *frame, size_t length);

#endif

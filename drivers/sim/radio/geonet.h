/* Codec for Ethernet, GeoNetworking (EN 302 636-4-1 V1.4.1) and BTP-B around a PDU, as in the module. */
#ifndef GEONET_H
#define GEONET_H

#include <stddef.h>
#include <stdint.h>

#include "v2xcast.h"

/* Ethernet 14, basic header 4, common header 8, GeoBroadcast 44, BTP-B 4, and the PDU. */
#define MAX_FRAME (14 + 4 + 8 + 44 + 4 + MAX_PAYLOAD)

/* Sending station: the MAC of its GeoNetworking address, and its position vector. */
struct sender {
    uint8_t mac[6];
    uint32_t timestamp; /* ITS time in ms modulo 2**32 */
    struct position position;
};

/* PDU with the fields of its headers. */
struct packet {
    uint16_t btp_port;
    uint8_t traffic_class;
    uint8_t hop_limit; /* received: remaining hop limit; to send: hop limit of a GeoBroadcast */
    bool has_area;     /* true for a GeoBroadcast, false for a single hop broadcast */
    bool is_multi_hop; /* other stations forward it; source and sequence number identify it */
    uint16_t sequence;
    struct area area;
    struct position centre;
    struct position source;
    int16_t rssi;          /* dBm, of a received frame */
    uint8_t source_mac[6]; /* of the frame: the last forwarder */
    uint8_t maker_mac[6];  /* of the position vector: the packet's source */
    const uint8_t *payload;
    size_t length;
};

/* Writes the frame of a packet; returns its length, at most MAX_FRAME. */
size_t geonet_encode(uint8_t frame[MAX_FRAME], const struct sender *sender, const struct packet *packet);

/* Parses a frame; payload points into it. Returns false for other frames than unsecured broadcasts of a PDU. */
bool geonet_decode(struct packet *packet, const uint8_t *frame, size_t length);

#endif

#include "geonet.h"

#include <string.h>

enum {
    ETHERNET = 14,
    BASIC = 4,
    COMMON = 8,
    LONG_POSITION = 24,
    SINGLE_HOP = LONG_POSITION + 4, /* clause 9.8.4: media-dependent data follows */
    TOPOLOGICAL = 4 + LONG_POSITION, /* clause 9.8.3 */
    GEO_BROADCAST = 4 + LONG_POSITION + 16, /* clause 9.8.5 */
    BTP = 4,
};
enum { ETHERTYPE = 0x8947, VERSION = 1, NEXT_COMMON = 1, NEXT_BTP_A = 1, NEXT_BTP_B = 2 };
enum { TYPE_GBC = 0x40, TYPE_SHB = 0x50, TYPE_TSB = 0x51 };
enum { LIFETIME = 6 << 2 | 2 };  /* itsGnDefaultPacketLifetime, 60 s, as 6 x 10 s */
enum { MOBILE = 0x80 };          /* itsGnIsMobile */
enum { ACCURATE = 0x8000 };      /* PAI of the position vector */

static uint8_t *put8(uint8_t *to, unsigned value)
{
    *to = (uint8_t)value;
    return to + 1;
}

static uint8_t *put16(uint8_t *to, unsigned value)
{
    return put8(put8(to, value >> 8), value & 0xFF);
}

static uint8_t *put32(uint8_t *to, uint32_t value)
{
    return put16(put16(to, value >> 16), value & 0xFFFF);
}

static uint8_t *put(uint8_t *to, const void *octets, size_t length)
{
    memcpy(to, octets, length);
    return to + length;
}

static unsigned get16(const uint8_t *from)
{
    return (unsigned)from[0] << 8 | from[1];
}

static uint32_t get32(const uint8_t *from)
{
    return (uint32_t)get16(from) << 16 | get16(from + 2);
}

static struct position get_position(const uint8_t *from)
{
    return (struct position){(int32_t)get32(from), (int32_t)get32(from + 4)};
}

static uint8_t *put_sender(uint8_t *to, const struct sender *sender)
{
    to = put(put16(to, 0), sender->mac, sizeof sender->mac); /* GN_ADDR: automatic, station type unknown */
    to = put32(to, sender->timestamp);
    to = put32(put32(to, (uint32_t)sender->position.latitude), (uint32_t)sender->position.longitude);
    return put16(put16(to, ACCURATE), 0); /* PAI is set; speed and heading are 0 */
}

static uint8_t *put_area(uint8_t *to, const struct packet *packet)
{
    const struct area *area = &packet->area;
    int is_circle = area->type == 0; /* clause 9.8.5.2: distance a is its radius */
    to = put32(put32(to, (uint32_t)packet->centre.latitude), (uint32_t)packet->centre.longitude);
    to = put16(put16(to, area->distance_a), is_circle ? 0 : area->distance_b);
    return put16(put16(to, is_circle ? 0 : area->angle), 0);
}

size_t geonet_encode(uint8_t frame[MAX_FRAME], const struct sender *sender, const struct packet *packet)
{
    static const uint8_t EVERYBODY[6] = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF};
    unsigned hops = packet->has_area ? packet->hop_limit : 1;
    uint8_t *to = put(put(frame, EVERYBODY, 6), sender->mac, 6);
    to = put16(to, ETHERTYPE);
    to = put8(put8(put8(put8(to, VERSION << 4 | NEXT_COMMON), 0), LIFETIME), hops);
    to = put8(put8(to, NEXT_BTP_B << 4), packet->has_area ? TYPE_GBC + packet->area.type : TYPE_SHB);
    to = put8(put8(to, packet->traffic_class), MOBILE);
    to = put8(put8(put16(to, (unsigned)packet->length + BTP), hops), 0);
    if (packet->has_area)
        to = put_area(put_sender(put16(put16(to, packet->sequence), 0), sender), packet);
    else
        to = put32(put_sender(to, sender), 0);
    to = put16(put16(to, packet->btp_port), 0);
    return (size_t)(put(to, packet->payload, packet->length) - frame);
}

/* Returns the size of the extended header, and the offset of its position vector; 0 for types other than SHB, TSB and
 * GBC. */
static size_t extended(unsigned type, size_t *vector)
{
    *vector = type == TYPE_SHB ? 0 : 4;
    if (TYPE_GBC <= type && type <= TYPE_GBC + 2)
        return GEO_BROADCAST;
    return type == TYPE_SHB ? SINGLE_HOP : type == TYPE_TSB ? TOPOLOGICAL : 0;
}

bool geonet_decode(struct packet *packet, const uint8_t *frame, size_t length)
{
    *packet = (struct packet){0};
    if (length < ETHERNET + BASIC + COMMON || get16(frame + 12) != ETHERTYPE)
        return false;
    const uint8_t *basic = frame + ETHERNET, *common = basic + BASIC, *header = common + COMMON;
    unsigned next = common[0] >> 4, type = common[1];
    if (basic[0] != (VERSION << 4 | NEXT_COMMON) || basic[2] < 4 || (next != NEXT_BTP_A && next != NEXT_BTP_B))
        return false;
    size_t vector, size = extended(type, &vector), payload = get16(common + 4);
    if (!size || payload < BTP || length < (size_t)(header - frame) + size + payload)
        return false;
    if (!basic[3] || basic[3] > common[6] || payload - BTP > MAX_PAYLOAD)
        return false;
    packet->traffic_class = common[2];
    packet->hop_limit = basic[3];
    memcpy(packet->source_mac, frame + 6, 6);
    memcpy(packet->maker_mac, header + vector + 2, 6);
    packet->source = get_position(header + vector + 12);
    packet->is_multi_hop = vector > 0; /* its sequence number precedes the position vector */
    if (packet->is_multi_hop)
        packet->sequence = (uint16_t)get16(header);
    if (size == GEO_BROADCAST) {
        const uint8_t *area = header + vector + LONG_POSITION;
        packet->has_area = true;
        packet->centre = get_position(area);
        packet->area = (struct area){type - TYPE_GBC, (uint16_t)get16(area + 8), (uint16_t)get16(area + 10),
                                     (uint16_t)get16(area + 12)};
    }
    packet->btp_port = (uint16_t)get16(header + size);
    packet->payload = header + size + BTP;
    packet->length = payload - BTP;
    return true;
}

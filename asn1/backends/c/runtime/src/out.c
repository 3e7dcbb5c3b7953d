/* Output of text, buffered so that the sink is called seldom. */
#include "walk.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

void captain_out_start(captain_out *out, captain_sink sink, void *context)
{
    out->sink = sink;
    out->context = context;
    out->status = CAPTAIN_OK;
    out->count = 0;
}

static void flush(captain_out *out)
{
    if (out->status == CAPTAIN_OK && out->count > 0 && !out->sink(out->context, out->text, out->count))
        out->status = CAPTAIN_NO_SPACE;
    out->count = 0;
}

captain_status captain_out_end(captain_out *out)
{
    flush(out);
    return out->status;
}

void captain_out_put(captain_out *out, const char *text, size_t octets)
{
    while (octets > 0) {
        size_t room = sizeof out->text - out->count, part = octets < room ? octets : room;
        memcpy(out->text + out->count, text, part);
        out->count += (uint32_t)part;
        text += part;
        octets -= part;
        if (out->count == sizeof out->text)
            flush(out);
    }
}

void captain_out_string(captain_out *out, const char *text) { captain_out_put(out, text, strlen(text)); }

void captain_out_character(captain_out *out, char character) { captain_out_put(out, &character, 1); }

void captain_out_blanks(captain_out *out, unsigned count)
{
    while (count-- > 0)
        captain_out_character(out, ' ');
}

void captain_out_integer(captain_out *out, int64_t number)
{
    char text[24];
    captain_out_put(out, text, (size_t)snprintf(text, sizeof text, "%" PRId64, number));
}

void captain_out_number(captain_out *out, const captain_type *type, int64_t number)
{
    char text[CAPTAIN_RANGE_TEXT];
    captain_out_string(out, captain_number_text(type, number, text));
}

static void put_octet_hex(captain_out *out, unsigned octet)
{
    static const char DIGITS[] = "0123456789ABCDEF";
    char text[2] = {DIGITS[octet >> 4], DIGITS[octet & 15]};
    captain_out_put(out, text, 2);
}

void captain_out_hex(captain_out *out, const uint8_t *octets, size_t count)
{
    for (size_t i = 0; i < count; i++)
        put_octet_hex(out, octets[i]);
}

void captain_out_bits_hex(captain_out *out, const captain_type *type, const void *value, uint32_t count)
{
    for (uint32_t i = 0; i < count; i += 8) {
        unsigned octet = 0;
        for (uint32_t k = i; k < i + 8; k++)
            octet = octet << 1 | (k < count && captain_walk_bit(type, value, k));
        put_octet_hex(out, octet);
    }
}

static void put_escaped(captain_out *out, char character)
{
    static const char CODES[] = "\"\"\\\\\bb\ff\nn\rr\tt"; /* RFC 8259 clause 7 */
    for (unsigned i = 0; i + 1 < sizeof CODES; i += 2) {
        if (character != CODES[i])
            continue;
        char pair[2] = {'\\', CODES[i + 1]};
        captain_out_put(out, pair, 2);
        return;
    }
    captain_out_string(out, "\\u00");
    put_octet_hex(out, (unsigned char)character);
}

void captain_out_quoted(captain_out *out, const char *text, size_t octets)
{
    if (!captain_utf8_is_valid(text, octets) && out->status == CAPTAIN_OK)
        out->status = CAPTAIN_ALPHABET;
    captain_out_character(out, '"');
    size_t from = 0;
    for (size_t i = 0; i < octets; i++) {
        unsigned char code = (unsigned char)text[i];
        if (code >= 32 && code != 127 && code != '"' && code != '\\')
            continue;
        captain_out_put(out, text + from, i - from);
        put_escaped(out, text[i]);
        from = i + 1;
    }
    if (octets > from) /* the pointer may be NULL for empty text */
        captain_out_put(out, text + from, octets - from);
    captain_out_character(out, '"');
}

/* ---------------------------------------------------------------- object identifiers (X.690 8.19.2 to 8.19.4, 8.20) */

/* Read a subidentifier of seven bits per octet; false if it is unterminated, begins with a zero, or exceeds 64 bits. */
static bool read_arc(const captain_octets *oid, uint32_t *at, uint64_t *arc)
{
    *arc = 0;
    if (*at >= oid->count || oid->octets[*at] == 0x80)
        return false;
    while (*at < oid->count) {
        uint8_t octet = oid->octets[(*at)++];
        if (*arc >> 57)
            return false;
        *arc = *arc << 7 | (octet & 0x7fu);
        if (octet < 0x80)
            return true;
    }
    return false;
}

static bool is_readable(const captain_octets *oid)
{
    uint64_t arc;
    for (uint32_t at = 0; at < oid->count;) /* check that each one ends, begins without a zero, and has at most 64 bits */
        if (!read_arc(oid, &at, &arc))
            return false;
    return oid->count > 0;
}

static void put_arc(captain_out *out, bool is_first, uint64_t arc)
{
    char text[24];
    captain_out_put(out, text, (size_t)snprintf(text, sizeof text, "%s%" PRIu64, is_first ? "" : ".", arc));
}

void captain_out_oid(captain_out *out, bool is_relative, const captain_octets *oid)
{
    if (!is_readable(oid)) {
        captain_out_character(out, '[');
        captain_out_hex(out, oid->octets, oid->count);
        captain_out_character(out, ']');
        return;
    }
    uint64_t arc;
    bool is_first = true;
    for (uint32_t at = 0; at < oid->count; is_first = false) {
        read_arc(oid, &at, &arc);
        if (is_first && !is_relative) { /* the first two numbers share a subidentifier: 40 x + y */
            uint64_t root = arc < 80 ? arc / 40 : 2;
            put_arc(out, true, root);
            put_arc(out, false, arc - 40 * root);
        } else {
            put_arc(out, is_first, arc);
        }
    }
}

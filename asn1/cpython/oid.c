#include "oid.h"

#include <inttypes.h>
#include <stdint.h>
#include <stdio.h>

static bool read_arc(const unsigned char *octets, size_t count, size_t *at, uint64_t *arc)
{
    *arc = 0;
    do {
        if (*at == count || *arc >> 57 != 0)
            return false;
        *arc = *arc << 7 | (octets[*at] & 0x7f);
    } while (octets[(*at)++] & 0x80);
    return true;
}

static bool print_arc(uint64_t arc, char *text, size_t size, size_t *used)
{
    int length = snprintf(text + *used, size - *used, *used == 0 ? "%" PRIu64 : ".%" PRIu64, arc);
    if (length < 0 || (size_t)length >= size - *used)
        return false;
    *used += (size_t)length;
    return true;
}

bool oid_text(const unsigned char *octets, size_t count, bool is_relative, char *text, size_t size)
{
    size_t used = 0, at = 0;
    uint64_t arc;
    if (size == 0)
        return false;
    text[0] = 0;
    while (at < count) {
        bool is_first = at == 0 && !is_relative;
        if (!read_arc(octets, count, &at, &arc))
            return false;
        if (is_first) { /* X.690 8.19.4: the first two arcs are one number */
            uint64_t top = arc < 80 ? arc / 40 : 2;
            if (!print_arc(top, text, size, &used))
                return false;
            arc -= 40 * top;
        }
        if (!print_arc(arc, text, size, &used))
            return false;
    }
    return true;
}

static bool parse_arc(const char *text, size_t length, size_t *at, uint64_t *arc)
{
    size_t first = *at;
    *arc = 0;
    for (; *at < length && text[*at] >= '0' && text[*at] <= '9'; (*at)++) {
        uint64_t digit = (uint64_t)(text[*at] - '0');
        if (*arc > (UINT64_MAX - digit) / 10)
            return false;
        *arc = *arc * 10 + digit;
    }
    if (*at == first)
        return false;
    if (*at == length)
        return true;
    return text[(*at)++] == '.' && *at < length;
}

static bool write_arc(uint64_t arc, unsigned char *octets, size_t size, size_t *used)
{
    size_t count = 1;
    for (uint64_t rest = arc >> 7; rest != 0; rest >>= 7)
        count++;
    if (count > size - *used)
        return false;
    for (size_t index = count; index-- > 0;)
        octets[(*used)++] = (unsigned char)((arc >> (7 * index) & 0x7f) | (index > 0 ? 0x80 : 0));
    return true;
}

size_t oid_octets(const char *text, size_t length, bool is_relative, unsigned char *octets, size_t size)
{
    size_t used = 0, at = 0;
    uint64_t arc, second;
    if (!is_relative) {
        if (!parse_arc(text, length, &at, &arc) || at == length || !parse_arc(text, length, &at, &second))
            return 0;
        if (arc > 2 || (arc < 2 && second > 39) || second > UINT64_MAX - 80)
            return 0;
        if (!write_arc(40 * arc + second, octets, size, &used))
            return 0;
    }
    while (at < length)
        if (!parse_arc(text, length, &at, &arc) || !write_arc(arc, octets, size, &used))
            return 0;
    return used;
}

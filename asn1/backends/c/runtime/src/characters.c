/* Characters: alphabets (30.5), UTF-8, object identifiers. */
#include "characters.h"

static const captain_range ia5[] = {{0, 127}};
static const captain_range visible[] = {{32, 126}};
static const captain_range printable[] = {{32, 32}, {39, 41}, {43, 58}, {61, 61}, {63, 63}, {65, 90}, {97, 122}};
static const captain_range numeric[] = {{32, 32}, {48, 57}};

captain_characters captain_whole_alphabet(const captain_type *type)
{
    switch (type->kind) {
    case CAPTAIN_VISIBLE:
        return (captain_characters){visible, 1, 7, false};
    case CAPTAIN_PRINTABLE:
        return (captain_characters){printable, sizeof printable / sizeof *printable, 7, false};
    case CAPTAIN_NUMERIC:
        return (captain_characters){numeric, 2, 4, true};
    default:
        return (captain_characters){ia5, 1, 7, false};
    }
}

captain_characters captain_alphabet(const captain_type *type)
{
    captain_characters found = captain_whole_alphabet(type);
    if (type->alphabet != NULL) {
        found.ranges = type->alphabet;
        found.count = type->alphabet_count;
        found.bits = type->character_bits;
        found.by_index = found.ranges[found.count - 1].high >> found.bits != 0;
    }
    return found;
}

int captain_character(const captain_characters *set, unsigned code)
{
    unsigned first = 0;
    if (set->count == 1 && !set->by_index)
        return (int64_t)code >= set->ranges->low && (int64_t)code <= set->ranges->high ? (int)code : -1;
    for (unsigned i = 0; i < set->count; i++) {
        const captain_range *range = &set->ranges[i];
        unsigned size = (unsigned)(range->high - range->low) + 1;
        if (set->by_index ? code < first + size : (int64_t)code >= range->low && (int64_t)code <= range->high)
            return set->by_index ? (int)range->low + (int)(code - first) : (int)code;
        first += size;
    }
    return -1;
}

int captain_code_of(const captain_characters *set, unsigned char point)
{
    int first = 0;
    for (unsigned i = 0; i < set->count; i++) {
        const captain_range *range = &set->ranges[i];
        if (point >= range->low && point <= range->high)
            return set->by_index ? first + (int)(point - range->low) : (int)point;
        first += (int)(range->high - range->low) + 1;
    }
    return -1;
}

size_t captain_utf8_count(const unsigned char *text, size_t octets)
{
    size_t count = 0;
    for (size_t i = 0; i < octets; count++) {
        unsigned first = text[i++], more = first < 0x80 ? 0 : first < 0xe0 ? 1 : first < 0xf0 ? 2 : 3;
        uint32_t point = more == 0 ? first : first & (0x3fu >> more);
        if ((first >= 0x80 && first < 0xc2) || first > 0xf4 || more > octets - i)
            return SIZE_MAX;
        for (unsigned left = more; left != 0; left--, i++) {
            if ((text[i] & 0xc0) != 0x80)
                return SIZE_MAX;
            point = point << 6 | (text[i] & 0x3fu);
        }
        if ((more == 2 && point < 0x800) || (more == 3 && (point < 0x10000 || point > 0x10ffff)) || (point >= 0xd800 && point <= 0xdfff))
            return SIZE_MAX;
    }
    return count;
}

bool captain_is_oid(const uint8_t *octets, size_t count)
{
    bool begins = true;
    for (size_t i = 0; i < count; i++) {
        if (begins && octets[i] == 0x80)
            return false;
        begins = octets[i] < 0x80;
    }
    return count != 0 && begins;
}

size_t captain_text_count(const captain_text *text)
{
    return captain_utf8_count((const unsigned char *)text->text, text->count);
}

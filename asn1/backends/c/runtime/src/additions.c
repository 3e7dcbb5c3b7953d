/* Extension additions of a SEQUENCE: bitmap, and unknown additions (19.7 to 19.9). */
#include "bits.h"

size_t captain_get_bitmap(captain_reader *reader, size_t at, captain_bitmap *bitmap)
{
    bool more = false;
    size_t start = at;
    if (reader->end - at < 7)
        return captain_fail(reader, at, CAPTAIN_TRUNCATED);
    if (captain_peek(reader, at) >> 63 == 0) {
        bitmap->count = (uint32_t)(captain_peek(reader, at) >> 57) + 1;
        at += 7;
    } else {
        at = captain_get_length(reader, at + 1, &bitmap->count, &more);
        if (at == CAPTAIN_FAILED)
            return at;
        if (more || bitmap->count == 0)
            return captain_fail(reader, start, CAPTAIN_LENGTH);
    }
    if (reader->end - at < bitmap->count)
        return captain_fail(reader, at, CAPTAIN_TRUNCATED);
    bitmap->at = at;
    if (bitmap->count > 32)
        bitmap->known = (captain_peek(reader, at) >> 32) << 32 | captain_peek(reader, at + 32) >> 32;
    else
        bitmap->known = captain_peek(reader, at);
    if (bitmap->count < 64)
        bitmap->known &= ~(UINT64_MAX >> bitmap->count);
    return at + bitmap->count;
}

static bool is_set(const captain_reader *reader, const captain_bitmap *bitmap, uint32_t index)
{
    size_t at = bitmap->at + index;
    return (reader->octets[at >> 3] >> (7 - (at & 7)) & 1) != 0;
}

size_t captain_get_additions(captain_reader *reader, size_t at, const captain_bitmap *bitmap, uint32_t count,
                             const captain_additions **additions)
{
    captain_additions *kept;
    captain_addition *unknown;
    uint32_t found = 0;
    for (uint32_t i = count; i < bitmap->count; i++)
        found += is_set(reader, bitmap, i);
    if (bitmap->count == count && bitmap->known != 0)
        return at;
    if (!captain_is_believed(reader, at, found, 8))
        return CAPTAIN_FAILED;
    kept = captain_take(reader, at, sizeof *kept + found * sizeof *unknown);
    if (kept == NULL)
        return CAPTAIN_FAILED;
    unknown = (captain_addition *)(void *)(kept + 1);
    *kept = (captain_additions){bitmap->count, found, unknown};
    *additions = kept;
    for (uint32_t i = count; i < bitmap->count; i++) {
        if (!is_set(reader, bitmap, i))
            continue;
        unknown->index = i;
        at = captain_get_unknown(reader, at, &unknown->octets);
        if (at == CAPTAIN_FAILED)
            return at;
        unknown++;
    }
    return at;
}

size_t captain_get_all_additions(captain_reader *reader, size_t at, const captain_additions **additions)
{
    captain_bitmap bitmap;
    at = captain_get_bitmap(reader, at, &bitmap);
    return at == CAPTAIN_FAILED ? at : captain_get_additions(reader, at, &bitmap, 0, additions);
}

/* Return the length of the bitmap: the received one, unless known additions need a longer one. */
static uint32_t bitmap_count(uint32_t count, uint64_t known, const captain_additions *additions)
{
    uint32_t bits = additions == NULL ? count : additions->bits;
    if (bits < count && (bits == 0 || (bits < 64 && known << bits != 0)))
        bits = count;
    for (uint32_t i = 0; additions != NULL && i < additions->count; i++)
        if (additions->unknown[i].index >= bits)
            bits = additions->unknown[i].index + 1;
    return bits;
}

size_t captain_encode_bitmap(captain_writer *writer, size_t at, uint32_t count, uint64_t known, const captain_additions *additions)
{
    uint32_t bits = bitmap_count(count, known, additions), unknown = additions == NULL ? 0 : additions->count, next = 0;
    if (bits - 1 >= CAPTAIN_MAX_ADDITIONS)
        return captain_refuse(writer, CAPTAIN_SIZE);
    at = bits <= 64 ? captain_put_bits(writer, at, bits - 1, 7) : captain_put_length(writer, captain_put_bits(writer, at, 1, 1), bits);
    for (uint32_t i = 0; i < bits; i++) {
        bool is_unknown = i >= count && next < unknown && additions->unknown[next].index == i;
        next += is_unknown;
        at = captain_put_bits(writer, at, is_unknown || (i < 64 && known << i >> 63 != 0), 1);
    }
    /* It fails if unknown additions are out of order, or have the index of a known one. */
    return next == unknown ? at : captain_refuse(writer, CAPTAIN_PRESENCE);
}

size_t captain_put_additions(captain_writer *writer, size_t at, const captain_additions *additions)
{
    for (uint32_t i = 0; additions != NULL && i < additions->count; i++)
        at = captain_put_unknown(writer, at, &additions->unknown[i].octets);
    return at;
}

/* Memory of decoded values, and lists. */
#include "bits.h"

bool captain_is_believed(captain_reader *reader, size_t at, size_t count, unsigned minimal)
{
    if (minimal == 0 && count > CAPTAIN_MAX_EMPTY)
        captain_fail(reader, at, CAPTAIN_SIZE);
    else if (minimal != 0 && count > (reader->end - at) / minimal)
        captain_fail(reader, at, CAPTAIN_TRUNCATED);
    else
        return true;
    return false;
}

void *captain_take(captain_reader *reader, size_t at, size_t octets)
{
    void *taken = captain_arena_take(reader->arena, octets);
    if (taken == NULL)
        captain_fail(reader, at, CAPTAIN_NO_MEMORY);
    return taken;
}

void *captain_take_items(captain_reader *reader, size_t at, uint32_t count, size_t size, unsigned minimal)
{
    return captain_is_believed(reader, at, count, minimal) ? captain_take(reader, at, count * size) : NULL;
}

size_t captain_decode_items(captain_reader *reader, size_t at, captain_list *list, size_t size, unsigned minimal,
                            size_t (*item)(captain_reader *, size_t, void *))
{
    unsigned char *items = NULL;
    size_t count = 0, room = 0;
    uint32_t length = 0;
    bool more;
    do {
        at = captain_get_length(reader, at, &length, &more);
        if (at == CAPTAIN_FAILED || !captain_is_believed(reader, at, minimal == 0 ? count + length : length, minimal))
            return CAPTAIN_FAILED;
        if (length > room - count) {
            /* Double the capacity each time: with the abandoned blocks, a list takes less than four times its size. */
            unsigned char *larger;
            room = count == 0 ? length : 2 * (count + length);
            larger = captain_take(reader, at, room * size);
            if (larger == NULL)
                return CAPTAIN_FAILED;
            if (count != 0)
                memcpy(larger, items, count * size);
            items = larger;
        }
        for (; length != 0; length--) {
            at = item(reader, at, items + count++ * size);
            if (at == CAPTAIN_FAILED)
                return at;
        }
    } while (more);
    list->count = (uint32_t)count;
    list->items = items;
    return at;
}

size_t captain_encode_items(captain_writer *writer, size_t at, const void *items, uint32_t count, size_t size,
                            size_t (*item)(captain_writer *, size_t, const void *))
{
    const unsigned char *next = items;
    size_t left = count, length;
    bool more;
    do {
        at = captain_put_fragment(writer, at, left, &length, &more);
        left -= length;
        for (; length != 0; length--, next += size) {
            at = item(writer, at, next);
            if (at == CAPTAIN_FAILED)
                return at;
        }
    } while (more);
    return at;
}

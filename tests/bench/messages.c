/* Times of captain_decode and captain_encode. */
#include "times.h"

#include <captain/runtime.h>

static _Alignas(16) unsigned char memory[1 << 24];
static const captain_type *type;

static void use(const char *message)
{
    const captain_message *found = captain_find_message(message);
    if (found == NULL)
        fail("no message ", message);
    type = found->pdu;
}

/* Made anew from the front of the memory. */
static void *decode(size_t count)
{
    captain_arena arena;
    captain_arena_init(&arena, memory, sizeof memory);
    void *value = captain_arena_take(&arena, type->size);
    captain_status status = captain_decode(type, value, octets, count, &arena, NULL);
    if (status != CAPTAIN_OK)
        fail("does not decode: ", captain_status_text(status));
    return value;
}

static void release(void *value)
{
    (void)value;
}

static void encode(const void *value)
{
    size_t bits;
    captain_status status = captain_encode(type, value, again, sizeof again, &bits);
    if (status != CAPTAIN_OK)
        fail("does not encode: ", captain_status_text(status));
}

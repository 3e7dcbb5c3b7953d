/* Memory of one call or one view: an arena that begins in a stretch of the caller and grows by chunks up to a budget. */
#ifndef CAPTAIN_MEMORY_H
#define CAPTAIN_MEMORY_H

#include <captain/runtime.h>

/* Octets of the shortest message that may hold a fragment: 16384 elements of one bit. */
enum { FRAGMENT = 2048 };

typedef struct memory {
    captain_arena arena;
    struct chunk *chunks;
    size_t budget;      /* octets that further chunks may take */
    bool is_exhausted;  /* malloc had none, which is not the budget's doing */
} memory;

/* What decoding a message of so many octets may take beyond its first stretch: what runtime.h promises, four times that where
 * fragments fit in; all of it twice, because a chunk may end half used; and a few chunks. */
static inline size_t decode_budget(const captain_message *message, size_t octets)
{
    size_t promised = (size_t)message->arena * octets * (octets < FRAGMENT ? 1 : 4);
    return message->pdu->size + 65536 + 2 * promised;
}

/* Stays where it is until memory_close: the arena points to it. */
void memory_open(memory *memory, void *first, size_t octets, size_t budget);
void memory_free(memory *memory);

static inline void memory_close(memory *memory)
{
    if (memory->chunks != NULL)
        memory_free(memory);
}

#endif

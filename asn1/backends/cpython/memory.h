/* Memory of one call or one view: an arena that begins in a block of the caller and grows by chunks up to a budget. */
#ifndef CAPTAIN_MEMORY_H
#define CAPTAIN_MEMORY_H

#include <captain/runtime.h>

/* Fewest octets of a message with a fragment: 16384 elements of one bit. */
enum { FRAGMENT = 2048 };

typedef struct memory {
    captain_arena arena;
    struct chunk *chunks;
    size_t budget;      /* octets that further chunks may have */
    bool is_exhausted;  /* malloc failed, though the budget was not exceeded */
} memory;

/* Return the limit for decoding a message of so many octets, beyond the first block: the bound of runtime.h; four times that if
 * fragments fit in; twice that, because a chunk may remain half empty; and a few chunks. */
static inline size_t decode_budget(const captain_message *message, size_t octets)
{
    size_t promised = (size_t)message->arena * octets * (octets < FRAGMENT ? 1 : 4);
    return message->pdu->size + 65536 + 2 * promised;
}

/* The object must not move until memory_close, because the arena points to it. */
void memory_open(memory *memory, void *first, size_t octets, size_t budget);
void memory_free(memory *memory);

static inline void memory_close(memory *memory)
{
    if (memory->chunks != NULL)
        memory_free(memory);
}

#endif

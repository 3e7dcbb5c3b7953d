/* Memory of one call or one view: an arena that begins in a stretch of the caller and grows by chunks up to a budget. */
#ifndef CAPTAIN_MEMORY_H
#define CAPTAIN_MEMORY_H

#include <captain/runtime.h>

/* What decoding may take: a struct is at most some 128 octets for one bit of the message (what is larger stands behind a
 * pointer that only a present one gets), so this refuses nothing that is a message. */
#define DECODE_BUDGET(type, octets) ((type)->size + 65536 + 1024 * (octets))

typedef struct memory {
    captain_arena arena;
    struct chunk *chunks;
    size_t budget;      /* octets that further chunks may take */
    bool is_exhausted;  /* malloc had none, which is not the budget's doing */
} memory;

/* Stays where it is until memory_close: the arena points to it. */
void memory_open(memory *memory, void *first, size_t octets, size_t budget);
void memory_free(memory *memory);

static inline void memory_close(memory *memory)
{
    if (memory->chunks != NULL)
        memory_free(memory);
}

#endif

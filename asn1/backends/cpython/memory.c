#include "memory.h"

#include <stdlib.h>

/* malloc in place of PyMem, because large messages are decoded without the GIL. */

typedef struct chunk {
    struct chunk *before;
    _Alignas(max_align_t) unsigned char octets[];
} chunk;

enum { CHUNK = 16384, ALIGNMENT = 16 };

static bool memory_more(captain_arena *arena, size_t octets)
{
    memory *memory = arena->context;
    size_t wanted = octets + ALIGNMENT;
    if (wanted < octets || wanted > memory->budget)
        return false;
    if (wanted < CHUNK)
        wanted = memory->budget < CHUNK ? memory->budget : CHUNK;
    chunk *new = malloc(sizeof *new + wanted);
    if (new == NULL) {
        memory->is_exhausted = true;
        return false;
    }
    new->before = memory->chunks;
    memory->chunks = new;
    memory->budget -= wanted;
    arena->next = new->octets;
    arena->end = new->octets + wanted;
    return true;
}

void memory_open(memory *memory, void *first, size_t octets, size_t budget)
{
    captain_arena_init(&memory->arena, first, octets);
    memory->arena.more = memory_more;
    memory->arena.context = memory;
    memory->chunks = NULL;
    memory->budget = budget;
    memory->is_exhausted = false;
}

void memory_free(memory *memory)
{
    chunk *chunk = memory->chunks;
    while (chunk != NULL) {
        struct chunk *before = chunk->before;
        free(chunk);
        chunk = before;
    }
    memory->chunks = NULL;
}

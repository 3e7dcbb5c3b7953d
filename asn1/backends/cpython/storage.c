#include "view.h"

#include <stdlib.h>

/* Sizes of reused storages in octets. Most messages fit one of them, and views are seldom kept for long. */
static const size_t ROOMS[] = {1024, 4096};
enum { CLASSES = sizeof ROOMS / sizeof *ROOMS, KEPT = 16 };

static storage *spare[CLASSES];
static int spare_count[CLASSES];

static int class_of(size_t octets)
{
    int class = 0;
    while (class < CLASSES && octets > ROOMS[class])
        class++;
    return class;
}

storage *storage_new(const captain_message *message, size_t octets)
{
    size_t wanted = message->pdu->size + 4 * octets + 64; /* lists usually take less than 4 octets per octet of it */
    int class = class_of(wanted);
    storage *storage;
    if (class < CLASSES && spare[class] != NULL) {
        storage = spare[class];
        spare[class] = storage->next;
        spare_count[class]--;
    } else {
        size_t room = class < CLASSES ? ROOMS[class] : wanted;
        storage = malloc(sizeof *storage + room);
        if (storage == NULL) {
            PyErr_NoMemory();
            return NULL;
        }
        storage->room = room;
    }
    storage->holders = 1;
    memory_open(&storage->memory, storage->first, storage->room, decode_budget(message, octets));
    return storage;
}

void storage_free(storage *storage)
{
    int class = class_of(storage->room);
    memory_close(&storage->memory);
    if (class < CLASSES && spare_count[class] < KEPT) {
        storage->next = spare[class];
        spare[class] = storage;
        spare_count[class]++;
    } else {
        free(storage);
    }
}

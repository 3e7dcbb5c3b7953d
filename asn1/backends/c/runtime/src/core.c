/* Memory, status texts, and entry functions, which set up a reader or writer and call the generated code. */
#include "bits.h"

/* Limit in octets: offsets in bits of larger messages would overflow. */
#define MAX_OCTETS (SIZE_MAX / 16)

void captain_arena_init(captain_arena *arena, void *memory, size_t octets)
{
    arena->next = memory;
    arena->end = memory == NULL ? NULL : (unsigned char *)memory + octets;
    arena->more = NULL;
    arena->context = NULL;
}

/* An alignment of eight octets is sufficient for every type of the library. */
static size_t padding(const captain_arena *arena)
{
    return (size_t)(-(uintptr_t)arena->next & 7u);
}

static bool fits(const captain_arena *arena, size_t octets)
{
    size_t left = (size_t)(arena->end - arena->next);
    size_t pad = padding(arena);
    return arena->next != NULL && pad <= left && octets <= left - pad;
}

void *captain_arena_take(captain_arena *arena, size_t octets)
{
    unsigned char *taken;
    if (!fits(arena, octets)) {
        if (arena->more == NULL || octets > SIZE_MAX - 8 || !arena->more(arena, octets + 8) || !fits(arena, octets))
            return NULL;
    }
    taken = arena->next + padding(arena);
    arena->next = taken + octets;
    return taken;
}

const char *captain_status_text(captain_status status)
{
    static const char *const texts[] = {
        [CAPTAIN_OK] = "ok",
        [CAPTAIN_TRUNCATED] = "truncated",
        [CAPTAIN_RANGE] = "out of range",
        [CAPTAIN_SIZE] = "wrong size",
        [CAPTAIN_ALPHABET] = "character not allowed",
        [CAPTAIN_ALTERNATIVE] = "no such alternative",
        [CAPTAIN_PRESENCE] = "missing or not allowed",
        [CAPTAIN_LENGTH] = "malformed length",
        [CAPTAIN_DEPTH] = "nested too deeply",
        [CAPTAIN_NO_MEMORY] = "out of memory",
        [CAPTAIN_NO_SPACE] = "buffer too small",
        [CAPTAIN_TRAILING] = "octets behind the end",
        [CAPTAIN_SYNTAX] = "syntax error",
        [CAPTAIN_INNER] = "breaks a constraint",
    };
    size_t index = (size_t)status;
    return index < sizeof texts / sizeof *texts ? texts[index] : "unknown status";
}

static captain_status decode(const captain_type *type, void *value, const void *octets, size_t size, captain_arena *arena, size_t *bits)
{
    captain_arena none;
    captain_reader reader;
    if (arena == NULL) {
        captain_arena_init(&none, NULL, 0);
        arena = &none;
    }
    reader = (captain_reader){.octets = octets, .size = size, .end = size * 8, .arena = arena};
    *bits = 0;
    if (size > MAX_OCTETS || type->decode == NULL)
        return size > MAX_OCTETS ? CAPTAIN_LENGTH : CAPTAIN_SYNTAX;
    *bits = type->decode(&reader, 0, value);
    if (*bits != CAPTAIN_FAILED)
        return CAPTAIN_OK;
    *bits = reader.reached;
    return reader.status;
}

captain_status captain_decode(const captain_type *type, void *value, const void *octets, size_t size, captain_arena *arena, size_t *bits)
{
    size_t used;
    return decode(type, value, octets, size, arena, bits == NULL ? &used : bits);
}

captain_status captain_decode_exact(const captain_type *type, void *value, const void *octets, size_t size, captain_arena *arena)
{
    const uint8_t *at = octets;
    size_t bits, whole;
    captain_status status = decode(type, value, octets, size, arena, &bits);
    if (status != CAPTAIN_OK)
        return status;
    whole = bits == 0 ? 1 : (bits + 7) / 8;
    if (size != whole || (at[whole - 1] & (bits == 0 ? 0xffu : 0xffu >> ((bits + 7) % 8 + 1))) != 0)
        return size < whole ? CAPTAIN_TRUNCATED : CAPTAIN_TRAILING;
    return CAPTAIN_OK;
}

captain_status captain_encode(const captain_type *type, const void *value, void *octets, size_t size, size_t *bits)
{
    captain_writer writer = {.octets = octets, .size = size};
    size_t at;
    if (bits != NULL)
        *bits = 0;
    if (type->encode == NULL)
        return CAPTAIN_SYNTAX;
    at = type->encode(&writer, 0, value);
    if (at == 0)
        at = captain_put_bits(&writer, 0, 0, 8);
    if (bits != NULL && at != CAPTAIN_FAILED)
        *bits = at;
    return writer.status;
}

captain_status captain_validate(const captain_type *type, const void *value)
{
    return type->validate == NULL ? CAPTAIN_OK : type->validate(value);
}

const captain_message *captain_find_message(const char *name)
{
    const captain_message *best = NULL;
    for (size_t i = 0; i < captain_messages_count; i++) {
        const captain_message *message = captain_messages[i];
        if (strcmp(message->name, name) == 0)
            return message;
        if (strcmp(message->type, name) == 0 && (best == NULL || message->rank < best->rank))
            best = message;
    }
    return best;
}

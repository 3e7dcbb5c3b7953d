/* What has to hold for any octets; libFuzzer thinks them up. One program per message: FUZZ_HEADER and FUZZ_TYPE say which.
 *
 *  - decode reads nothing beyond the octets (ASan), does nothing undefined (UBSan), and ends
 *  - where it fails, the explanation fails with the same status; where it succeeds, both have used as many bits
 *  - where it succeeds: encode gives octets that decode to an equal value, and encoding that gives the same octets
 *  - validate and its explanation agree
 *  - text can be written; JSON comes back as an equal value
 *
 * Explanation, text and JSON take ten times as long as the codec. With the argument --every=N one input in N is explained, and another one
 * in N is written; the octets alone say which. Without it every input is, so what --every=N has found shows again without it.
 */
#include FUZZ_HEADER

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

extern const captain_type FUZZ_TYPE; /* the header of a module has not the tables of its forms */

#define ROOM ((size_t)1 << 24) /* what a decoded input may take; more is CAPTAIN_NO_MEMORY and no finding */
#define OCTETS ((size_t)1 << 20)

/* In place of the library's list, which would bring every other message into the program. */
const captain_message *const captain_messages[] = {NULL};
const size_t captain_messages_count = 0;

typedef struct text {
    size_t count;
    char characters[1 << 22];
} text;

enum { EXPLAINED, WRITTEN }; /* what is left out of most inputs */

int LLVMFuzzerInitialize(int *count, char ***arguments);
int LLVMFuzzerTestOneInput(const uint8_t *octets, size_t size);

static uint32_t every = 1;
static _Alignas(16) unsigned char room[2][ROOM];
static unsigned char encoded[2][OCTETS];
static text json;

static void require(bool holds, const char *what)
{
    if (!holds) {
        fprintf(stderr, "finding: %s\n", what);
        abort();
    }
}

static bool append(void *context, const char *characters, size_t count)
{
    text *to = context;
    if (count > sizeof to->characters - to->count)
        return false;
    memcpy(to->characters + to->count, characters, count);
    to->count += count;
    return true;
}

static bool count_only(void *context, const char *characters, size_t count)
{
    (void)characters;
    *(size_t *)context += count;
    return true;
}

static bool follow(void *context, const captain_step *step)
{
    size_t *at = context;
    require(step->what == CAPTAIN_STEP_LEAVE || step->bit >= *at, "explain goes backwards");
    if (step->what != CAPTAIN_STEP_LEAVE)
        *at = step->bit;
    return true;
}

/* FNV-1a, then the last step of MurmurHash3, so that the remainder by any N depends on every octet. */
__attribute__((no_sanitize("address", "undefined", "coverage")))
static uint32_t hash(uint32_t seed, const uint8_t *octets, size_t size)
{
    uint32_t mixed = 0x811C9DC5u ^ seed;
    for (size_t at = 0; at < size; at++)
        mixed = (mixed ^ octets[at]) * 0x01000193u;
    mixed = (mixed ^ mixed >> 16) * 0x85EBCA6Bu;
    mixed = (mixed ^ mixed >> 13) * 0xC2B2AE35u;
    return mixed ^ mixed >> 16;
}

static bool is_chosen(uint32_t what, const uint8_t *octets, size_t size)
{
    return every == 1 || hash(what, octets, size) % every == 0;
}

static void *start(captain_arena *arena, int which)
{
    captain_arena_init(arena, room[which], ROOM);
    return captain_arena_take(arena, FUZZ_TYPE.size);
}

/* Of octets that are cut off and wrong before their end either may be told, so one of the two may say "truncated". */
static bool agree(captain_status decoded, captain_status told)
{
    bool is_cut = decoded == CAPTAIN_TRUNCATED || told == CAPTAIN_TRUNCATED;
    return decoded == told || (is_cut && decoded != CAPTAIN_OK && told != CAPTAIN_OK);
}

static void explained(captain_status status, captain_status exact, const uint8_t *octets, size_t size, size_t bits)
{
    captain_report report;
    size_t at = 0;
    memset(&report, 0, sizeof report);
    captain_status told = captain_explain_decode(&FUZZ_TYPE, octets, size, false, &report);
    require(agree(status, told), "explanation has another status");
    require(report.status == told, "report has another status");
    require(report.bit <= 8 * size, "report points behind the octets");
    require(told != CAPTAIN_OK || report.bit == bits, "explanation ends at another bit");
    require(told == CAPTAIN_OK || report.text[0] != '\0', "report says nothing");
    require(agree(exact, captain_explain(&FUZZ_TYPE, octets, size, follow, &at, &report)), "steps end in another status");
}

static void written_as_json(const void *value, bool is_plain)
{
    captain_arena arena;
    json.count = 0;
    captain_status status = (is_plain ? captain_json_write_plain : captain_json_write)(&FUZZ_TYPE, value, append, &json);
    if (status == CAPTAIN_NO_SPACE)
        return;
    require(status == CAPTAIN_OK, "JSON cannot be written");
    void *again = start(&arena, 1);
    status = (is_plain ? captain_json_read_plain : captain_json_read)(&FUZZ_TYPE, again, json.characters, json.count, &arena, NULL);
    if (status == CAPTAIN_NO_MEMORY)
        return;
    require(status == CAPTAIN_OK, "JSON cannot be read back");
    require(captain_equal(&FUZZ_TYPE, value, again), "JSON comes back as another value");
}

static void written(const void *value)
{
    size_t count = 0;
    require(captain_print(&FUZZ_TYPE, value, count_only, &count) == CAPTAIN_OK && count > 0, "print fails");
    written_as_json(value, false);
    written_as_json(value, true);
}

static void encoded_again(const void *value)
{
    captain_arena arena;
    size_t bits, bits_again;
    require(captain_encode(&FUZZ_TYPE, value, encoded[0], OCTETS, &bits) == CAPTAIN_OK, "what was decoded cannot be encoded");
    void *again = start(&arena, 1);
    captain_status status = captain_decode_exact(&FUZZ_TYPE, again, encoded[0], bits == 0 ? 1 : (bits + 7) / 8, &arena);
    if (status == CAPTAIN_NO_MEMORY)
        return;
    require(status == CAPTAIN_OK, "what was encoded cannot be decoded");
    require(captain_equal(&FUZZ_TYPE, value, again), "decoding again gives another value");
    require(captain_encode(&FUZZ_TYPE, again, encoded[1], OCTETS, &bits_again) == CAPTAIN_OK && bits == bits_again &&
            memcmp(encoded[0], encoded[1], (bits + 7) / 8) == 0, "encoding again gives other octets");
}

static void validated(const void *value, bool is_explained)
{
    captain_report report;
    /* Of several faults each may find another: WITH COMPONENTS is looked at behind what it is about, or before. */
    bool is_valid = captain_validate(&FUZZ_TYPE, value) == CAPTAIN_OK;
    if (!is_explained)
        return;
    memset(&report, 0, sizeof report);
    require(is_valid == (captain_explain_value(&FUZZ_TYPE, value, true, &report) == CAPTAIN_OK),
            "validate and its explanation differ");
    require(is_valid || report.text[0] != '\0', "explanation of validate says nothing");
}

/* libFuzzer leaves alone what begins with two hyphens. */
int LLVMFuzzerInitialize(int *count, char ***arguments)
{
    for (int at = 1; at < *count; at++)
        if (strncmp((*arguments)[at], "--every=", 8) == 0)
            every = (uint32_t)strtoul((*arguments)[at] + 8, NULL, 10);
    require(every > 0, "--every=N: N is 1 or more");
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *octets, size_t size)
{
    captain_arena arena;
    size_t bit = 0;
    void *value = start(&arena, 0);
    captain_status status = captain_decode(&FUZZ_TYPE, value, octets, size, &arena, &bit);
    if (status == CAPTAIN_NO_MEMORY)
        return 0;
    void *again = start(&arena, 1);
    captain_status exact = captain_decode_exact(&FUZZ_TYPE, again, octets, size, &arena);
    require(status == CAPTAIN_OK ? exact == CAPTAIN_OK || exact == CAPTAIN_TRAILING : exact == status,
            "decode and decode_exact differ");
    bool is_explained = is_chosen(EXPLAINED, octets, size);
    if (is_explained)
        explained(status, exact, octets, size, bit);
    if (status != CAPTAIN_OK)
        return 0;
    require(bit <= 8 * size, "more bits used than there are");
    validated(value, is_explained);
    encoded_again(value);
    if (is_chosen(WRITTEN, octets, size))
        written(value);
    return 0;
}

/* The walkers against the generated code, over every message of a library: values at random from the tables, their encodings
 * whole and with errors. Arguments: runs for each message, and seed. Prints "name runs decoded" a line and ends with 1 at a
 * difference.
 */
#define _POSIX_C_SOURCE 200809L /* fmemopen */
#include <captain/runtime.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MEMORY = 1 << 22, ENCODED = 1 << 17, WRITTEN = 1 << 20 };
static uint64_t memory[3][MEMORY / 8];
static uint64_t values[3][8192];
static uint8_t encoded[ENCODED], again[ENCODED];
static char written[WRITTEN];

static uint64_t state;

static uint64_t next_random(void)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return state;
}

static bool chance(unsigned one_in) { return next_random() % one_in == 0; }

/* Now and then a value goes as deep into a type that contains itself as decode and encode allow, and deeper. */
enum { DEEPEST = 60, MOST_CONTAINERS = 2000 };
static bool is_deep;
static unsigned containers; /* of the value that is made: what contains itself twice would have no end */

static bool goes_deep(const captain_type *type, unsigned depth)
{
    return is_deep && depth < DEEPEST && containers < MOST_CONTAINERS / 4 && (type->flags & CAPTAIN_RECURS);
}

/* Only what has to be there, and the shortest. */
static bool is_short(unsigned depth) { return depth > 8 || containers > MOST_CONTAINERS; }

/* ---------------------------------------------------------------- values */

static void make(const captain_type *type, void *value, captain_arena *arena, unsigned depth);

static void *take(captain_arena *arena, size_t octets)
{
    void *memory_ = captain_arena_take(arena, octets);
    if (memory_ == NULL)
        exit(2);
    return memory_;
}

/* At the ends as often as between them; now and then outside of an extensible root. */
static int64_t make_number(const captain_type *type)
{
    int64_t low = type->flags & CAPTAIN_UNBOUNDED_LOW ? -100000 : type->low, high = type->flags & CAPTAIN_UNBOUNDED_HIGH ? low + 100000 : type->high;
    if ((type->flags & CAPTAIN_EXTENSIBLE) && chance(4))
        return (int64_t)(next_random() >> (next_random() % 60));
    if (chance(3))
        return chance(2) ? low : high;
    uint64_t range = (uint64_t)high - (uint64_t)low;
    return (int64_t)((uint64_t)low + (range == UINT64_MAX ? next_random() : next_random() % (range + 1)));
}

static uint32_t make_count(const captain_type *type, unsigned depth)
{
    uint64_t low = (uint64_t)type->low, high = type->flags & CAPTAIN_UNBOUNDED_HIGH ? low + 5 : (uint64_t)type->high;
    uint64_t most = is_short(depth) ? low : depth > 6 ? low + 1 : low + 4;
    if ((type->flags & CAPTAIN_EXTENSIBLE) && chance(8))
        return (uint32_t)(high + 1 + next_random() % 3);
    if (depth < 3 && chance(50) && high < 300)
        return (uint32_t)high;
    if (type->kind != CAPTAIN_LIST && chance(200) && (type->flags & CAPTAIN_UNBOUNDED_HIGH))
        return (uint32_t)(16384 * (1 + next_random() % 5) + next_random() % 3);
    high = high < most ? high : most;
    return (uint32_t)(low + next_random() % (high - low + 1));
}

static void make_text(const captain_type *type, captain_text *text, captain_arena *arena)
{
    static const char *const BASES[] = {"aZ09~", "aZ09~", "aZ09 ", "09 "};
    uint32_t count = type->kind == CAPTAIN_UTF8 ? (uint32_t)(next_random() % 4) : make_count(type, 0);
    char *octets = take(arena, 2 * (size_t)count + 1);
    for (uint32_t i = 0; i < count; i++) {
        const captain_range *range = type->alphabet == NULL ? NULL : &type->alphabet[next_random() % type->alphabet_count];
        const char *base = type->kind == CAPTAIN_UTF8 ? "aZ\"\\" : BASES[type->kind - CAPTAIN_IA5];
        octets[i] = range != NULL ? (char)(chance(2) ? range->low : range->high) : base[next_random() % strlen(base)];
    }
    *text = (captain_text){count, octets};
}

static captain_octets make_octets(uint32_t count, captain_arena *arena)
{
    uint8_t *octets = take(arena, (size_t)count + 1);
    for (uint32_t i = 0; i < count; i++)
        octets[i] = (uint8_t)next_random();
    return (captain_octets){count, octets};
}

static void make_bits(const captain_type *type, captain_bits *bits, captain_arena *arena)
{
    uint32_t count = make_count(type, 0);
    if ((type->flags & CAPTAIN_NAMED_BITS) && chance(4)) /* trailing zeros may be left out, X.680 22.7 */
        count = (uint32_t)(next_random() % (count + 1));
    captain_octets octets = make_octets((count + 7) / 8, arena);
    uint8_t *last = (uint8_t *)(uintptr_t)octets.octets;
    if (count % 8 != 0)
        last[count / 8] = (uint8_t)(last[count / 8] & (0xff00u >> (count % 8)));
    *bits = (captain_bits){count, octets.octets};
}

static void *place(const captain_field *field, void *structure, captain_arena *arena)
{
    char *at = (char *)structure + field->offset;
    if (!(field->flags & CAPTAIN_POINTER))
        return at;
    void *pointed = take(arena, field->type->size);
    memcpy(at, &pointed, sizeof pointed);
    return pointed;
}

static void make_open(const captain_type *type, const captain_type *holder, const char *structure, captain_open *open, captain_arena *arena, unsigned depth)
{
    const captain_field *selector = &holder->fields[type->selector];
    int64_t id = 0;
    memcpy(&id, structure + selector->offset, selector->type->size); /* an unsigned number of little-endian order, or small */
    *open = (captain_open){.type = NULL};
    for (unsigned i = 0; i < type->rows_count; i++)
        if (type->rows[i].id == id)
            open->type = type->rows[i].type;
    if (open->type == NULL) {
        open->octets = make_octets((uint32_t)(1 + next_random() % 5), arena);
        return;
    }
    open->value = take(arena, open->type->size);
    make(open->type, open->value, arena, depth + 1);
}

static void make_sequence(const captain_type *type, char *structure, captain_arena *arena, unsigned depth)
{
    unsigned rare = containers > MOST_CONTAINERS ? UINT32_MAX : depth > 8 ? 8 : 2;
    containers++;
    bool group = false;
    captain_init(type, structure);
    for (unsigned i = 0; i < type->fields_count; i++) {
        const captain_field *field = &type->fields[i];
        bool is_first = i == 0 || type->fields[i - 1].addition != field->addition;
        if (field->addition > 0 && is_first)
            group = chance(rare);
        bool is_there = field->addition > 0 ? group && ((field->flags & CAPTAIN_MANDATORY) || chance(rare)) : field->present == CAPTAIN_NOWHERE || chance(rare);
        is_there |= field->addition == 0 && goes_deep(field->type, depth) && !chance(20);
        if (field->present != CAPTAIN_NOWHERE)
            structure[field->present] = (char)is_there;
        if (!is_there)
            continue;
        if (field->type->kind == CAPTAIN_OPEN)
            make_open(field->type, type, structure, (captain_open *)(void *)(structure + field->offset), arena, depth);
        else
            make(field->type, place(field, structure, arena), arena, depth + 1);
    }
    if (type->additions == CAPTAIN_NOWHERE || !chance(6) || type->additions_count > 60)
        return;
    captain_additions *additions = take(arena, sizeof *additions);
    captain_addition *unknown = take(arena, 2 * sizeof *unknown);
    uint32_t count = (uint32_t)(next_random() % 3), index = type->additions_count;
    for (uint32_t i = 0; i < count; i++, index++) {
        index += (uint32_t)(next_random() % 3 + (chance(10) ? 70 : 0));
        unknown[i] = (captain_addition){index, make_octets((uint32_t)(next_random() % 5), arena)};
    }
    *additions = (captain_additions){index + (uint32_t)(next_random() % 3) + (index == 0), count, unknown};
    memcpy(structure + type->additions, &additions, sizeof additions);
}

static void make_choice(const captain_type *type, char *structure, captain_arena *arena, unsigned depth)
{
    uint32_t choice = (uint32_t)(next_random() % (is_short(depth) ? 1 : type->fields_count)) + 1;
    containers++;
    memset(structure, 0, type->size);
    for (uint32_t i = 0; i < type->root_count; i++)
        choice = goes_deep(type->fields[i].type, depth) ? i + 1 : choice;
    if ((type->flags & CAPTAIN_EXTENSIBLE) && chance(is_deep ? 200 : 20)) {
        captain_octets octets = make_octets((uint32_t)(next_random() % 5), arena);
        choice = (uint32_t)CAPTAIN_UNKNOWN + type->fields_count - type->root_count + (uint32_t)(next_random() % 80);
        memcpy(structure + type->fields[0].offset, &octets, sizeof octets);
    } else {
        make(type->fields[choice - 1].type, place(&type->fields[choice - 1], structure, arena), arena, depth + 1);
    }
    memcpy(structure, &choice, sizeof choice);
}

static void make_list(const captain_type *type, captain_list *list, captain_arena *arena, unsigned depth)
{
    uint32_t count = goes_deep(type, depth) ? (uint32_t)type->low + (type->low == 0) : make_count(type, depth);
    size_t size = type->element->size;
    char *items = take(arena, count * size + 1);
    for (uint32_t i = 0; i < count; i++)
        make(type->element, items + i * size, arena, depth + 1);
    captain_list made = {count, items};
    memcpy(list, &made, sizeof made);
}

static void make_item(const captain_type *type, int32_t *value)
{
    *value = (int32_t)type->names[next_random() % type->names_count].value;
    if ((type->flags & CAPTAIN_EXTENSIBLE) && chance(10))
        *value = CAPTAIN_UNKNOWN + type->names_count - type->root_count + (int32_t)(next_random() % 100);
}

static void make(const captain_type *type, void *value, captain_arena *arena, unsigned depth)
{
    static const uint8_t OID[] = {0x2a, 0x86, 0x48, 0x86, 0xf7, 0x0d};
    uint64_t number;
    captain_octets octets = {0, NULL};
    switch (type->kind) {
    case CAPTAIN_BOOLEAN: *(bool *)value = chance(2); return;
    case CAPTAIN_NULL: *(bool *)value = false; return;
    case CAPTAIN_ENUMERATED: make_item(type, value); return;
    case CAPTAIN_INTEGER:
    case CAPTAIN_SMALL_BITS:
        number = type->kind == CAPTAIN_INTEGER ? (uint64_t)make_number(type) : type->high == 64 ? next_random() : next_random() & ((UINT64_C(1) << type->high) - 1);
        memcpy(value, &number, type->width); /* little-endian */
        return;
    case CAPTAIN_BIT_STRING: make_bits(type, value, arena); return;
    case CAPTAIN_FIXED_OCTETS: memset(value, (int)(next_random() & 0xff), type->size); return;
    case CAPTAIN_OCTET_STRING: octets = make_octets(make_count(type, 0), arena); break;
    case CAPTAIN_OID:
    case CAPTAIN_RELATIVE_OID: octets = (captain_octets){sizeof OID, OID}; break;
    case CAPTAIN_SEQUENCE: make_sequence(type, value, arena, depth); return;
    case CAPTAIN_CHOICE: make_choice(type, value, arena, depth); return;
    case CAPTAIN_LIST: make_list(type, value, arena, depth); return;
    default: make_text(type, value, arena); return;
    }
    memcpy(value, &octets, sizeof octets);
}

/* ---------------------------------------------------------------- values that are wrong */

static void *pointed(const captain_field *field, void *structure)
{
    void *at = (char *)structure + field->offset;
    if (field->flags & CAPTAIN_POINTER)
        memcpy(&at, at, sizeof at);
    return at;
}

static void spoil(const captain_type *type, void *value);

static void spoil_sequence(const captain_type *type, char *structure)
{
    if (type->fields_count == 0)
        return;
    const captain_field *field = &type->fields[next_random() % type->fields_count];
    captain_additions *additions = NULL;
    if (type->additions != CAPTAIN_NOWHERE)
        memcpy(&additions, structure + type->additions, sizeof additions);
    if (additions != NULL && additions->count > 0 && chance(4)) {
        ((captain_addition *)(uintptr_t)additions->unknown)[next_random() % additions->count].index = (uint32_t)(next_random() >> (next_random() % 32 + 32));
        return;
    }
    if (field->present != CAPTAIN_NOWHERE && !structure[field->present])
        return;
    if (field->present != CAPTAIN_NOWHERE && chance(8))
        structure[field->present] = 0;
    else
        spoil(field->type, pointed(field, structure));
}

/* Something in it becomes another value, most often one that is not allowed. Memory stays what it was. */
static void spoil(const captain_type *type, void *value)
{
    uint64_t number = next_random() >> (next_random() % 64);
    uint32_t choice = 0;
    captain_list list;
    captain_octets octets;
    captain_open *open = value;
    switch (type->kind) {
    case CAPTAIN_BOOLEAN:
    case CAPTAIN_NULL:
    case CAPTAIN_FIXED_OCTETS: return;
    case CAPTAIN_INTEGER:
    case CAPTAIN_SMALL_BITS: memcpy(value, &number, type->width); return;
    case CAPTAIN_ENUMERATED: memcpy(value, &number, 4); return;
    case CAPTAIN_SEQUENCE: spoil_sequence(type, value); return;
    case CAPTAIN_CHOICE:
        memcpy(&choice, value, sizeof choice);
        if (choice > 0 && choice <= type->fields_count && !chance(10)) {
            spoil(type->fields[choice - 1].type, pointed(&type->fields[choice - 1], value));
            return;
        }
        choice = chance(2) ? 0 : type->fields_count + 1 + (uint32_t)(number & 0xff);
        memcpy(value, &choice, sizeof choice);
        return;
    case CAPTAIN_LIST:
        memcpy(&list, value, sizeof list);
        if (list.count > 0 && chance(4))
            list.count = (uint32_t)(next_random() % list.count);
        else if (list.count > 0)
            spoil(type->element, (char *)list.items + next_random() % list.count * type->element->size);
        memcpy(value, &list, sizeof list);
        return;
    case CAPTAIN_OPEN:
        if (open->type != NULL)
            spoil(open->type, open->value);
        return;
    default:
        memcpy(&octets, value, sizeof octets);
        if (octets.count > 0 && chance(2))
            octets.count = (uint32_t)(next_random() % octets.count);
        else if (octets.count > 0 && type->kind != CAPTAIN_OID && type->kind != CAPTAIN_RELATIVE_OID)
            ((uint8_t *)(uintptr_t)octets.octets)[next_random() % (type->kind == CAPTAIN_BIT_STRING ? 1 : octets.count)] = (uint8_t)number;
        memcpy(value, &octets, sizeof octets);
    }
}

/* ---------------------------------------------------------------- comparisons */

static const char *message_name;

static void fail(const char *what, const uint8_t *octets, size_t size)
{
    printf("DIFFERENCE %s: %s: ", message_name, what);
    for (size_t i = 0; i < size; i++)
        printf("%02x", octets[i]);
    puts("");
    exit(1);
}

static bool put(void *context, const char *text, size_t count) { return fwrite(text, 1, count, context) == count; }

static bool swallow(void *context, const char *text, size_t count)
{
    *(size_t *)context += count + (unsigned char)text[count - 1];
    return true;
}

static bool next_step(void *context, const captain_step *step)
{
    size_t *bit = context; /* where the last step began, where the furthest one ended */
    if (step->what != CAPTAIN_STEP_LEAVE && step->bit < bit[0])
        fail(step->path, NULL, 0);
    if (step->width > 0 && step->bit > bit[1])
        fail(step->path, NULL, 0);
    bit[0] = step->bit;
    bit[1] = step->bit + step->width > bit[1] ? step->bit + step->width : bit[1];
    return true;
}

/* JSON with errors: what is read nevertheless can be encoded, written, and read again. */
static void check_changed_json(const captain_type *type, bool is_plain, size_t length)
{
    static const char PARTS[] = "{}[]\",:0123456789-+.eE\\u\x80\xff\x01tfn ";
    captain_report report;
    size_t bits;
    for (uint64_t changes = 1 + next_random() % 3; changes > 0 && length > 2; changes--) {
        size_t at = next_random() % length;
        if (chance(3))
            memmove(written + at, written + at + 1, --length - at);
        else
            written[at] = chance(2) ? PARTS[next_random() % (sizeof PARTS - 1)] : (char)('0' + next_random() % 10);
    }
    char *exact = malloc(length + 1);
    memcpy(exact, written, length);
    captain_arena arena;
    captain_arena_init(&arena, memory[2], chance(20) ? 100 : sizeof memory[2]);
    captain_status status = (is_plain ? captain_json_read_plain : captain_json_read)(type, values[2], exact, length, &arena, &report);
    if (status != CAPTAIN_OK && report.text[0] == 0)
        fail("a refusal of JSON says nothing", NULL, 0);
    if (status == CAPTAIN_OK && captain_encode(type, values[2], again, sizeof again, &bits) != captain_explain_value(type, values[2], false, &report))
        fail("what came from changed JSON cannot be encoded", NULL, 0);
    if (status == CAPTAIN_OK && report.status != CAPTAIN_OK)
        fail(report.text, NULL, 0);
    free(exact);
}

/* JSON of a dialect and back: the same value, the same octets. */
static void check_json(const captain_type *type, const void *value, const uint8_t *octets, size_t size)
{
    bool is_plain = chance(2);
    FILE *out = fmemopen(written, sizeof written, "w");
    captain_status status = (is_plain ? captain_json_write_plain : captain_json_write)(type, value, put, out);
    size_t length = (size_t)ftell(out), bits;
    fclose(out);
    captain_arena arena;
    captain_report report;
    captain_arena_init(&arena, memory[2], sizeof memory[2]);
    if (status != CAPTAIN_OK)
        fail("JSON cannot be written", octets, size);
    status = (is_plain ? captain_json_read_plain : captain_json_read)(type, values[2], written, length, &arena, &report);
    if (status != CAPTAIN_OK)
        printf("%.*s\n%s: %s\n", (int)length, written, report.path, report.text);
    if (status != CAPTAIN_OK)
        fail("JSON cannot be read", octets, size);
    if (!captain_equal(type, value, values[2]))
        fail("JSON gives another value", octets, size);
    if (captain_encode(type, values[2], again, sizeof again, &bits) != CAPTAIN_OK)
        fail("what came from JSON cannot be encoded", octets, size);
    captain_encode(type, value, encoded, sizeof encoded, &bits);
    if (memcmp(again, encoded, (bits + 7) / 8) != 0)
        fail("what came from JSON has other octets", octets, size);
    check_changed_json(type, is_plain, length);
}

/* What is told about octets by both decoders. */
static bool check_octets(const captain_type *type, const uint8_t *octets, size_t size)
{
    captain_arena arena;
    captain_report report, strict;
    size_t bit[2] = {0, 0}, text = 0;
    captain_arena_init(&arena, memory[1], sizeof memory[1]);
    captain_status status = captain_decode_exact(type, values[1], octets, size, &arena);
    captain_status explained = captain_explain_decode(type, octets, size, true, &report);
    bool is_cut = status == CAPTAIN_TRUNCATED && explained != CAPTAIN_OK; /* a run of fields is compared with the end as one */
    if (status != CAPTAIN_NO_MEMORY && explained != status && !is_cut) {
        printf("decode: %s, explain: %s at %zu, %s: %s\n", captain_status_text(status), captain_status_text(explained), report.bit, report.path, report.text);
        fail("the decoders differ", octets, size);
    }
    if (captain_explain(type, octets, size, next_step, bit, &report) != explained || (explained == CAPTAIN_OK && bit[1] != size * 8))
        fail("explain does not tell everything", octets, size);
    if (status != CAPTAIN_OK)
        return false;
    check_json(type, values[1], octets, size);
    if (captain_print(type, values[1], swallow, &text) != CAPTAIN_OK)
        fail("cannot be printed", octets, size);
    status = captain_explain_value(type, values[1], false, &report);
    if (status != CAPTAIN_OK)
        fail(report.text, octets, size);
    status = captain_explain_value(type, values[1], true, &strict);
    if ((status == CAPTAIN_OK) != (captain_validate(type, values[1]) == CAPTAIN_OK))
        fail(strict.text[0] ? strict.text : "validate refuses what explain_value does not", octets, size);
    return true;
}

/* Both ways to refuse a value in memory say the same. */
static void check_refusals(const captain_type *type, const void *value)
{
    captain_report report;
    size_t bits;
    captain_status status = captain_encode(type, value, again, sizeof again, &bits), told = captain_explain_value(type, value, false, &report);
    if (status != CAPTAIN_NO_SPACE && (status == CAPTAIN_OK) != (told == CAPTAIN_OK)) {
        printf("encode: %s, explain_value: %s %s %s\n", captain_status_text(status), captain_status_text(told), report.path, report.text);
        fail("what encode refuses differs", NULL, 0);
    }
    status = captain_validate(type, value);
    told = captain_explain_value(type, value, true, &report);
    if (status != CAPTAIN_OK && status == told)
        return;
    if ((status == CAPTAIN_OK) != (told == CAPTAIN_OK)) {
        printf("validate: %s, explain_value: %s %s %s\n", captain_status_text(status), captain_status_text(told), report.path, report.text);
        fail("what validate refuses differs", NULL, 0);
    }
}

static size_t change(size_t size)
{
    for (uint64_t changes = next_random() % 3; changes > 0; changes--)
        encoded[next_random() % size] ^= (uint8_t)(1u << next_random() % 8);
    return chance(4) ? next_random() % (size + 1) : size;
}

static unsigned long check_message(const captain_message *message, unsigned long runs)
{
    unsigned long decoded = 0;
    message_name = message->name;
    if (message->pdu->size > sizeof values[0])
        fail("is too large for this test", NULL, 0);
    for (unsigned long i = 0; i < runs; i++) {
        captain_arena arena;
        captain_report report;
        captain_arena_init(&arena, memory[0], sizeof memory[0]);
        is_deep = chance(8);
        containers = 0;
        make(message->pdu, values[0], &arena, 0);
        size_t bits;
        captain_status status = captain_encode(message->pdu, values[0], encoded, sizeof encoded, &bits);
        captain_status told = captain_explain_value(message->pdu, values[0], false, &report);
        if (status == CAPTAIN_NO_SPACE)
            continue;
        if (status != told) {
            printf("encode: %s, explain: %s %s %s\n", captain_status_text(status), captain_status_text(told), report.path, report.text);
            fail("encode and explain_value differ", NULL, 0);
        }
        if (status != CAPTAIN_OK)
            continue;
        size_t size = (bits + 7) / 8;
        uint8_t *exact = malloc(size + 1);
        memcpy(exact, encoded, size);
        if (check_octets(message->pdu, exact, size)) {
            decoded++;
            if (!captain_equal(message->pdu, values[0], values[1]))
                fail("is another value when decoded", exact, size);
        } else {
            printf("%s\n", captain_status_text(captain_explain_decode(message->pdu, exact, size, true, &report)));
            printf("%zu %s %s\n", report.bit, report.path, report.text);
            fail("cannot be decoded", exact, size);
        }
        memcpy(encoded, exact, size);
        free(exact);
        for (unsigned k = 0; k < 3; k++) {
            size_t part = change(size);
            exact = malloc(part + 1);
            memcpy(exact, encoded, part);
            check_octets(message->pdu, exact, part);
            free(exact);
        }
        for (unsigned k = 0; k < 5; k++) {
            spoil(message->pdu, values[0]);
            check_refusals(message->pdu, values[0]);
        }
    }
    return decoded;
}

int main(int count, char **arguments)
{
    unsigned long runs = count > 1 ? strtoul(arguments[1], NULL, 10) : 100;
    state = 88172645463325252u + (count > 2 ? strtoul(arguments[2], NULL, 10) : 0);
    for (size_t i = 0; i < captain_messages_count; i++) {
        if (count > 3 && strcmp(captain_messages[i]->name, arguments[3]) != 0)
            continue;
        printf("%s %lu %lu\n", captain_messages[i]->name, runs, check_message(captain_messages[i], runs));
        fflush(stdout);
    }
    return 0;
}

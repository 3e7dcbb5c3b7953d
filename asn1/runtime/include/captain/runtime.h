/* The part of the message library that is the same for every message: memory, errors, constant tables of the types, and
 * what walks them. Generated headers (captain/r1_cam.h, ...) declare one struct per ASN.1 type and describe it by a
 * captain_type.
 *
 * The three hot ways (decode, encode, validate) are straight-line code, generated per type. Everything else (text, JSON,
 * comparison, explanation, finding the place of an error) walks the tables below.
 *
 * Nothing here calls malloc or holds state: memory is the caller's, every function may run in several threads at once.
 */
#ifndef CAPTAIN_RUNTIME_H
#define CAPTAIN_RUNTIME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---------------------------------------------------------------- memory */

/* A stretch of the caller's memory, handed out from the front and never taken back. What decode cannot put into the
 * struct itself (lists, strings of variable length, what recurs or is large) lies here. `more`, where not NULL, is asked for
 * a further stretch of at least `octets` octets: it sets next and end and returns true, or returns false. Stretches
 * handed out before stay valid. */
typedef struct captain_arena {
    unsigned char *next;
    unsigned char *end;
    bool (*more)(struct captain_arena *arena, size_t octets);
    void *context;
} captain_arena;

void captain_arena_init(captain_arena *arena, void *memory, size_t octets);
/* Aligned for any type of the library; NULL where there is no more. */
void *captain_arena_take(captain_arena *arena, size_t octets);

/* ---------------------------------------------------------------- errors */

typedef enum captain_status {
    CAPTAIN_OK = 0,
    CAPTAIN_TRUNCATED,    /* the octets end inside a value */
    CAPTAIN_RANGE,        /* a number outside its range */
    CAPTAIN_SIZE,         /* a string or list longer or shorter than allowed */
    CAPTAIN_ALPHABET,     /* a character outside the alphabet, or octets that are not UTF-8 */
    CAPTAIN_ALTERNATIVE,  /* an alternative or enumeration item that does not exist and cannot be an extension */
    CAPTAIN_PRESENCE,     /* a component is missing that has to be there, or there where it may not be */
    CAPTAIN_LENGTH,       /* a length that is malformed: fragment sizes, an open type longer or shorter than its value */
    CAPTAIN_DEPTH,        /* nested deeper than CAPTAIN_MAX_DEPTH, or too often within itself (CAPTAIN_RECURS) */
    CAPTAIN_NO_MEMORY,    /* the arena is used up */
    CAPTAIN_NO_SPACE,     /* the caller's buffer for the octets or the text is too small */
    CAPTAIN_TRAILING,     /* octets behind the end of the message */
    CAPTAIN_SYNTAX,       /* JSON that is none, or not of this type */
    CAPTAIN_INNER         /* validate: breaks a constraint that the encoding does not see (WITH COMPONENTS, a gap in a union) */
} captain_status;

/* "truncated", "out of range", ...: a few words, lower case. */
const char *captain_status_text(captain_status status);

/* IVIM recurs; nothing else goes deeper than about 30. */
enum { CAPTAIN_MAX_DEPTH = 64 };

/* Where and why: path is "cam.camParameters.basicContainer.stationType" or "payload.cpmContainers[2].containerData",
 * without the name of the PDU itself; text is one sentence with the value and what is allowed. */
typedef struct captain_report {
    captain_status status;
    size_t bit; /* offset of the first bit of the bad value; of a value in memory 0 */
    char path[512];
    char text[512];
} captain_report;

/* ---------------------------------------------------------------- how values lie in memory
 *
 *  BOOLEAN                                bool
 *  NULL                                   bool, always false
 *  INTEGER                                int8_t .. int64_t, uint8_t .. uint64_t: the smallest that holds the effective range,
 *                                         unsigned where the lower bound is >= 0; int64_t where extensible or unbounded
 *  ENUMERATED                             int32_t: the item's number; an unknown addition: CAPTAIN_UNKNOWN + its index
 *  BIT STRING, fixed size up to 64        uint8_t .. uint64_t: bit 0 of the string is the most significant of the size bits
 *  BIT STRING, any other                  captain_bits
 *  OCTET STRING, fixed size up to 64      uint8_t [size]
 *  OCTET STRING, any other                captain_octets
 *  character strings                      captain_text
 *  OBJECT IDENTIFIER, RELATIVE-OID        captain_octets: the content octets (X.690 8.19, 8.20)
 *  SEQUENCE                               a struct. A component that may be absent has `bool has_<name>` in front of it; with a
 *                                         DEFAULT, decode writes the default into an absent one, and encode leaves out what equals
 *                                         it. Every extension addition and every member of an addition group may be absent.
 *                                         An extensible one ends in `const captain_additions *additions`, NULL unless something
 *                                         has to be kept
 *  CHOICE                                 struct { uint32_t choice; union { ... } u; }: 0 is nothing, k the k-th alternative (roots in
 *                                         canonical order, then additions); an unknown addition: CAPTAIN_UNKNOWN + its index, and
 *                                         u.unknown holds the octets of its open type
 *  SEQUENCE OF, SET OF                    struct { uint32_t count; T *items; }
 *  open type                              captain_open
 *
 *  A component or alternative is a pointer (flag CAPTAIN_POINTER) where the type recurs through it, or its struct is larger
 *  than 128 octets and it is optional, an addition or an alternative. An absent one may be anything.
 */
enum { CAPTAIN_UNKNOWN = 0x40000000 };

typedef struct captain_bits { uint32_t count; /* bits */ const uint8_t *octets; /* first bit is the top of the first octet */ } captain_bits;
typedef struct captain_octets { uint32_t count; const uint8_t *octets; } captain_octets;
typedef struct captain_text { uint32_t count; /* octets */ const char *text; /* decode ends it with a 0 that is not counted */ } captain_text;
typedef struct captain_list { uint32_t count; void *items; } captain_list; /* any SEQUENCE OF, seen by the tables */

/* type and value are NULL where the identifier is in no row of the set: then octets holds the open type, whole. With a known
 * type value points to its struct, and octets is not looked at. */
struct captain_type;
typedef struct captain_open { const struct captain_type *type; void *value; captain_octets octets; } captain_open;

/* What a newer or older sender said about additions: kept, so that it is encoded again unchanged. `bits`: length of the
 * bitmap as received. Unknown ones are ascending by index, 0 for the first addition of the type. */
typedef struct captain_addition { uint32_t index; captain_octets octets; } captain_addition;
typedef struct captain_additions { uint32_t bits; uint32_t count; const captain_addition *unknown; } captain_additions;

/* ---------------------------------------------------------------- tables of the types */

typedef enum captain_kind {
    CAPTAIN_BOOLEAN, CAPTAIN_NULL, CAPTAIN_INTEGER, CAPTAIN_ENUMERATED,
    CAPTAIN_SMALL_BITS,   /* BIT STRING in an integer: low == high <= 64 */
    CAPTAIN_BIT_STRING,
    CAPTAIN_FIXED_OCTETS, /* OCTET STRING in the struct: low == high <= 64 */
    CAPTAIN_OCTET_STRING,
    CAPTAIN_IA5, CAPTAIN_VISIBLE, CAPTAIN_PRINTABLE, CAPTAIN_NUMERIC, CAPTAIN_UTF8, /* captain_text */
    CAPTAIN_OID, CAPTAIN_RELATIVE_OID,
    CAPTAIN_SEQUENCE, CAPTAIN_CHOICE, CAPTAIN_LIST, CAPTAIN_OPEN
} captain_kind;

enum { /* captain_type.flags */
    CAPTAIN_EXTENSIBLE = 1,  /* has an extension marker that the encoding sees */
    CAPTAIN_UNBOUNDED_LOW = 2,  /* low is MIN */
    CAPTAIN_UNBOUNDED_HIGH = 4, /* high is MAX */
    CAPTAIN_SIGNED = 8,      /* an INTEGER that lies in a signed type */
    CAPTAIN_NAMED_BITS = 16, /* BIT STRING with named bits: trailing zeros do not count (X.691 16.2) */
    CAPTAIN_RECURS = 32      /* contains itself: 32 such containers may stand within one another, else CAPTAIN_DEPTH */
};
enum { /* captain_field.flags */
    CAPTAIN_OPTIONAL = 1,    /* may be absent: `present` is valid */
    CAPTAIN_DEFAULT = 2,     /* default_value is valid */
    CAPTAIN_POINTER = 4,     /* at offset lies a pointer to the struct */
    CAPTAIN_GROUP = 8,       /* member of [[ ]]: shares `addition` with its neighbours */
    CAPTAIN_MANDATORY = 16   /* of an addition or group: not OPTIONAL in the text, so present whenever its group is */
};
enum { CAPTAIN_NOWHERE = 0xffffffff };

typedef struct captain_name { const char *name; int64_t value; } captain_name;
typedef struct captain_range { int64_t low; int64_t high; } captain_range;
typedef struct captain_row { int64_t id; const struct captain_type *type; } captain_row;

typedef struct captain_field {
    const char *name;
    const struct captain_type *type;
    const void *default_value; /* as it lies in memory */
    const char *unit;          /* of the component where it has one of its own, else NULL */
    uint32_t offset;           /* from the start of the SEQUENCE's or CHOICE's struct */
    uint32_t present;          /* offset of the bool, or CAPTAIN_NOWHERE */
    uint16_t addition;         /* 0: in the root; k: the k-th extension addition */
    uint16_t flags;
} captain_field;

typedef struct captain_reader captain_reader;
typedef struct captain_writer captain_writer;
#define CAPTAIN_FAILED ((size_t)-1)

/* name, unit, standard, rule: NULL where there is none (an anonymous type inside another has no name). */
typedef struct captain_type {
    const char *name;     /* in the ASN.1: "SpeedValue" */
    const char *unit;     /* "0.01 m/s" */
    const char *standard; /* "ETSI TS 102 894-2 v1.3.1" */
    const char *rule;     /* constraints that the encoding does not see (CAPTAIN_INNER): "(with {..., a present, b absent})" */
    uint8_t kind;         /* captain_kind */
    uint8_t flags;
    uint8_t width;        /* octets of the number in memory (INTEGER, SMALL_BITS) */
    uint8_t character_bits; /* of known-multiplier strings (X.691 30.5.2): 7 for IA5, 4 for NUMERIC, or fewer by alphabet */
    uint32_t size;        /* octets of the value in memory */
    int64_t low, high;    /* effective root range of the value (INTEGER) or of the size (strings, LIST), X.691 11.5, 11.9 */
    const captain_range *alphabet;  /* code points, ascending; NULL: the whole of the string type */
    const captain_range *gaps;      /* what lies in low..high and yet is not allowed (unions): validate only */
    const captain_name *names;      /* INTEGER: named numbers; ENUMERATED: root in encoding order, then additions; bits */
    const captain_field *fields;    /* SEQUENCE: root in encoding order, then additions; CHOICE: alternatives likewise */
    const struct captain_type *element; /* LIST */
    const captain_row *rows;        /* OPEN: ascending by id */
    uint32_t selector;              /* OPEN: index, among its SEQUENCE's fields, of the component that holds the id */
    uint32_t additions;             /* SEQUENCE: offset of its captain_additions pointer, or CAPTAIN_NOWHERE */
    uint16_t names_count, fields_count, rows_count;
    uint16_t root_count;            /* of fields or names: those of the root */
    uint16_t additions_count;       /* extension additions known, a group counts once */
    uint8_t alphabet_count, gaps_count;
    /* Generated code, for captain_decode and its like. decode and encode are NULL for numbers, strings and small SEQUENCEs of
     * numbers only that never stand in a list: they are part of the code of what holds them. `at` is the
     * offset in bits; what comes back is the offset behind the value, or CAPTAIN_FAILED. */
    size_t (*decode)(captain_reader *reader, size_t at, void *value);
    size_t (*encode)(captain_writer *writer, size_t at, const void *value);
    captain_status (*validate)(const void *value);
} captain_type;

typedef struct captain_message {
    const char *name;      /* "cam-1.4.1" */
    const char *type;      /* the station's word: "cam" */
    const char *standard;  /* "ETSI EN 302 637-2 v1.4.1" */
    const char *module;    /* "CAM-PDU-Descriptions" */
    const char *form_of;   /* name of the message of which this is the -ext form: an extension marker stays through serial
                            * constraints. Both forms have one C struct; encode with the table that decoded.
                            * NULL for a strict message */
    const captain_type *pdu;
    const uint8_t *ids;      /* messageID values that announce it */
    const uint8_t *versions; /* protocolVersion values that announce it */
    uint8_t ids_count, versions_count;
    uint8_t release;       /* 1 or 2 */
    bool is_experimental;
    uint16_t btp_port;
    uint16_t rank;         /* order of preference among editions: smallest first */
    uint32_t arena;        /* decode takes at most so many octets from the arena for each octet of the message, whatever it
                            * is; what has 16384 elements or octets and more comes in fragments, and may take four times as many */
} captain_message;

/* Every message of this library, by type and rank; captain_messages_count of them. */
extern const captain_message *const captain_messages[];
extern const size_t captain_messages_count;
const captain_message *captain_find_message(const char *name); /* "cam-1.4.1", or "cam" for the one of smallest rank; NULL: none */

/* ---------------------------------------------------------------- the hot ways
 *
 * The generated headers declare the same for each PDU and named type with its own struct:
 *   captain_status r1_cam_CAM_decode(r1_cam_CAM *value, const void *octets, size_t size, captain_arena *arena, size_t *bits);
 */

/* value: pdu->size octets; need not be cleared. bits: where not NULL, the number of bits used; on an error, the offset reached.
 * Octets behind the message are left to the caller (see captain_decode_exact). Never reads past size, whatever they are. */
captain_status captain_decode(const captain_type *type, void *value, const void *octets, size_t size, captain_arena *arena, size_t *bits);
/* The same, and CAPTAIN_TRAILING where more than the padding of the last octet follows, or the padding is not zero. */
captain_status captain_decode_exact(const captain_type *type, void *value, const void *octets, size_t size, captain_arena *arena);
/* bits: number of bits written; the last octet is filled up with zeros, and an empty encoding is one zero octet (X.691 11.1.3).
 * With CAPTAIN_NO_SPACE it is the number of bits that the value takes, and what the buffer holds is nothing. */
captain_status captain_encode(const captain_type *type, const void *value, void *octets, size_t size, size_t *bits);
/* Every constraint of the standard, those that the encoding does not see included. */
captain_status captain_validate(const captain_type *type, const void *value);

/* ---------------------------------------------------------------- what walks the tables */

/* A value with every number 0, every default in place, every optional component absent, lists empty. */
void captain_init(const captain_type *type, void *value);

/* Why decode or decode_exact failed (or CAPTAIN_OK): decodes again, slowly, and finds path, bit and sentence. Of octets that are
 * cut off and wrong before their end either may be told. It needs no arena: CAPTAIN_NO_MEMORY is nothing it finds. On success
 * bit is the number of bits used. */
captain_status captain_explain_decode(const captain_type *type, const void *octets, size_t size, bool exact, captain_report *report);
/* The first value of a struct that encode (is_strict false) or validate (is_strict true) refuses. Here a pointer may be NULL. */
captain_status captain_explain_value(const captain_type *type, const void *value, bool is_strict, captain_report *report);

/* Equal as values: absent defaults equal present ones; named-bit strings without trailing zeros; kept additions count. */
bool captain_equal(const captain_type *type, const void *left, const void *right);

/* Text goes out through a sink; false from it ends the walk with CAPTAIN_NO_SPACE. */
typedef bool (*captain_sink)(void *context, const char *text, size_t octets);

/* Write the values as octets without field names, in the order of the encoding: numbers, places of set bits, indices of items
 * and alternatives, counts, octets. Two editions that decode to the same values give the same octets here. The format may
 * change. unknown: the number of additions, alternatives, items and open types that the type does not know. */
captain_status captain_leaves(const captain_type *type, const void *value, captain_sink sink, void *context, uint32_t *unknown);

/* Indented tree, one field a line, with names of special values, and all others in their unit: "speedValue: 0 (standstill)",
 * "speedValue: 2028 (20.28 m/s)" (exact: the places are those of the factor), "generationDeltaTime: 37862 ms". */
captain_status captain_print(const captain_type *type, const void *value, captain_sink sink, void *context);

/* JER (X.697) names and shapes, compact, without blanks: SEQUENCE an object, SEQUENCE OF an array, CHOICE an object of one
 * member, ENUMERATED its name, INTEGER a number, BOOLEAN true or false, NULL null, BIT STRING of fixed size its hexadecimal
 * text, any other {"value": hex, "length": bits}, OCTET STRING hexadecimal text, open types their value or, of an unknown
 * type, hexadecimal text.
 * Beyond JER: an unknown addition is a member "[3]": "hex of its open type", where 3 is its index among the additions, and the
 * length of a bitmap, where it is kept, is "[]": 5; an unknown enumeration item is its index as "[2]", an unknown alternative
 * {"[1]": "hex"}; an object identifier with a number above 64 bits is "[hex of its octets]". */
captain_status captain_json_write(const captain_type *type, const void *value, captain_sink sink, void *context);
/* Strict JSON in UTF-8. Members come in any order; one that the type does not have, or that is there twice, is an error; a
 * missing one with a default takes it. Numbers may be written as 1.0 or 1e3. Hexadecimal text in place of an open type that is
 * known and never text: its octets. What encode would refuse is refused. report may be NULL. */
captain_status captain_json_read(const captain_type *type, void *value, const char *json, size_t octets, captain_arena *arena, captain_report *report);

/* Bit by bit: called for everything that the encoding holds, ascending by bit. Enters and leaves containers as well, so that a
 * tree can be drawn. Strings are valid only during the call. An unknown addition, and the header of a further fragment of an
 * open type, have no type; a header amid a value is told behind it. Elements without bits are told once. Text is cut after 512
 * octets ("..."). false from on_step ends it with CAPTAIN_NO_SPACE; octets behind the end are CAPTAIN_TRAILING. */
typedef struct captain_step {
    enum { CAPTAIN_STEP_VALUE, CAPTAIN_STEP_ENTER, CAPTAIN_STEP_LEAVE,
           CAPTAIN_STEP_EXTENSION_BIT, CAPTAIN_STEP_PRESENCE, /* preamble of a SEQUENCE: value is the bits as text "101" */
           CAPTAIN_STEP_LENGTH, CAPTAIN_STEP_CHOICE, CAPTAIN_STEP_OPEN, /* length octets of an open type */
           CAPTAIN_STEP_UNKNOWN, CAPTAIN_STEP_PADDING } what;
    size_t bit, width;      /* offset in the message, and bits taken */
    const char *path;       /* as in captain_report */
    const captain_type *type;
    const captain_field *field; /* NULL for elements and the PDU itself */
    const char *text;       /* the value, as captain_print writes it */
    const char *clause;     /* of X.691: (02/2021): "11.9.3.6", "19.2", ... */
} captain_step;
typedef bool (*captain_on_step)(void *context, const captain_step *step);
captain_status captain_explain(const captain_type *type, const void *octets, size_t size, captain_on_step on_step, void *context, captain_report *report);

#ifdef __cplusplus
}
#endif
#endif

/* Runtime of the message library, common to all messages: memory, errors, tables of types, functions that walk them. Generated
 * headers (captain/r1_cam.h, ...) declare one struct per ASN.1 type and describe it by a captain_type.
 *
 * Decode, encode and validate are straight-line code, generated per type. All other functions (text, JSON, comparison,
 * explanation, location of an error) walk the tables below.
 *
 * No function calls malloc or has global state: the caller provides memory, and all functions are thread-safe. */
#ifndef CAPTAIN_RUNTIME_H
#define CAPTAIN_RUNTIME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---------------------------------------------------------------- memory */

/* Memory of the caller, handed out from the front and never taken back. decode puts everything here that is not inside the
 * struct itself: lists, strings of variable size, recursive and large components. If `more` is not NULL, it is called for
 * another block of at least `octets` octets: it sets next and end and returns true, or returns false. Earlier blocks remain
 * valid. */
typedef struct captain_arena {
    unsigned char *next;
    unsigned char *end;
    bool (*more)(struct captain_arena *arena, size_t octets);
    void *context;
} captain_arena;

void captain_arena_init(captain_arena *arena, void *memory, size_t octets);
/* Return memory aligned for any type of the library; NULL if none is left. */
void *captain_arena_take(captain_arena *arena, size_t octets);

/* ---------------------------------------------------------------- errors */

typedef enum captain_status {
    CAPTAIN_OK = 0,
    CAPTAIN_TRUNCATED,    /* the octets end inside a value */
    CAPTAIN_RANGE,        /* a number outside its range */
    CAPTAIN_SIZE,         /* a string or list longer or shorter than allowed */
    CAPTAIN_ALPHABET,     /* a character outside the alphabet, or invalid UTF-8 */
    CAPTAIN_ALTERNATIVE,  /* an alternative or enumeration item that does not exist and cannot be an extension */
    CAPTAIN_PRESENCE,     /* a required component is missing, or a forbidden one is present */
    CAPTAIN_LENGTH,       /* malformed length: fragment sizes, an open type longer or shorter than its value */
    CAPTAIN_DEPTH,        /* nested deeper than CAPTAIN_MAX_DEPTH, or a type too often within itself (CAPTAIN_RECURS) */
    CAPTAIN_NO_MEMORY,    /* the arena is used up */
    CAPTAIN_NO_SPACE,     /* the caller's buffer for octets or text is too small */
    CAPTAIN_TRAILING,     /* octets after the end of the message */
    CAPTAIN_SYNTAX,       /* malformed JSON, or JSON of another type */
    CAPTAIN_INNER         /* validate: violates a constraint that PER ignores (WITH COMPONENTS, a gap in a union) */
} captain_status;

/* Return a few words in lower case: "truncated", "out of range", ... */
const char *captain_status_text(captain_status status);

/* Only IVIM recurs; all other messages nest at most about 30 levels. */
enum { CAPTAIN_MAX_DEPTH = 64 };

/* Place and reason of an error. path: "cam.camParameters.basicContainer.stationType" or
 * "payload.cpmContainers[2].containerData", without the name of the PDU. text: a sentence with value and range. */
typedef struct captain_report {
    captain_status status;
    size_t bit; /* offset of the first bit of the invalid value; 0 for a value in memory */
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

typedef struct captain_bits { uint32_t count; /* bits */ const uint8_t *octets; /* bit 0 is the highest of the first octet */ } captain_bits;
typedef struct captain_octets { uint32_t count; const uint8_t *octets; } captain_octets;
typedef struct captain_text { uint32_t count; /* octets */ const char *text; /* decode appends a 0, not counted */ } captain_text;
typedef struct captain_list { uint32_t count; void *items; } captain_list; /* any SEQUENCE OF, as the tables see it */

/* If the identifier is unknown, type and value are NULL, and octets has the encoded open type. If it is known, value points to
 * a struct of this type, and octets is ignored. */
struct captain_type;
typedef struct captain_open { const struct captain_type *type; void *value; captain_octets octets; } captain_open;

/* Additions from a newer or older sender, kept so that they are encoded again unchanged. `bits`: received length of the bitmap.
 * Unknown additions are sorted by index; the first addition of the type has index 0. */
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
    CAPTAIN_EXTENSIBLE = 1,  /* PER sees an extension marker */
    CAPTAIN_UNBOUNDED_LOW = 2,  /* low is MIN */
    CAPTAIN_UNBOUNDED_HIGH = 4, /* high is MAX */
    CAPTAIN_SIGNED = 8,      /* an INTEGER stored in a signed C type */
    CAPTAIN_NAMED_BITS = 16, /* BIT STRING with named bits: trailing zeros are not significant (X.691 16.2) */
    CAPTAIN_RECURS = 32      /* contains itself; more than 32 nested containers of this kind give CAPTAIN_DEPTH */
};
enum { /* captain_field.flags */
    CAPTAIN_OPTIONAL = 1,    /* may be absent: `present` is valid */
    CAPTAIN_DEFAULT = 2,     /* default_value is valid */
    CAPTAIN_POINTER = 4,     /* the struct has a pointer at `offset` */
    CAPTAIN_GROUP = 8,       /* member of [[ ]]: has the same `addition` as its neighbours */
    CAPTAIN_MANDATORY = 16   /* addition without OPTIONAL in the text: present whenever its group is */
};
enum { CAPTAIN_NOWHERE = 0xffffffff };

typedef struct captain_name { const char *name; int64_t value; } captain_name;
typedef struct captain_range { int64_t low; int64_t high; } captain_range;
typedef struct captain_row { int64_t id; const struct captain_type *type; } captain_row;

typedef struct captain_field {
    const char *name;
    const struct captain_type *type;
    const void *default_value; /* in the memory layout of the type */
    const char *unit;          /* unit of the component if it differs from its type's, else NULL */
    uint32_t offset;           /* octets from the start of the SEQUENCE's or CHOICE's struct */
    uint32_t present;          /* offset of the bool, or CAPTAIN_NOWHERE */
    uint16_t addition;         /* 0: in the root; k: the k-th extension addition */
    uint16_t flags;
} captain_field;

typedef struct captain_reader captain_reader;
typedef struct captain_writer captain_writer;
#define CAPTAIN_FAILED ((size_t)-1)

/* name, unit, standard and rule are NULL if absent; an unnamed type inside another has no name. */
typedef struct captain_type {
    const char *name;     /* name in ASN.1: "SpeedValue" */
    const char *unit;     /* "0.01 m/s" */
    const char *standard; /* "ETSI TS 102 894-2 v1.3.1" */
    const char *rule;     /* constraints that PER ignores (CAPTAIN_INNER): "(with {..., a present, b absent})" */
    uint8_t kind;         /* captain_kind */
    uint8_t flags;
    uint8_t width;        /* octets of the number in memory (INTEGER, SMALL_BITS) */
    uint8_t character_bits; /* bits per character (X.691 30.5.2): 7 for IA5, 4 for NUMERIC, fewer by alphabet */
    uint32_t size;        /* octets of the value in memory */
    int64_t low, high;    /* effective root range of the value (INTEGER) or of the size (strings, LIST), X.691 11.5, 11.9 */
    const captain_range *alphabet;  /* code points, ascending; NULL: all of the string type */
    const captain_range *gaps;      /* forbidden values between low and high (unions): for validate only */
    const captain_name *names;      /* INTEGER: named numbers; ENUMERATED: root in encoding order, then additions; bits */
    const captain_field *fields;    /* SEQUENCE: root in encoding order, then additions; CHOICE: alternatives likewise */
    const struct captain_type *element; /* LIST */
    const captain_row *rows;        /* OPEN: ascending by id */
    uint32_t selector;              /* OPEN: index of the field with the identifier, in the enclosing SEQUENCE */
    uint32_t additions;             /* SEQUENCE: offset of its captain_additions pointer, or CAPTAIN_NOWHERE */
    uint16_t names_count, fields_count, rows_count;
    uint16_t root_count;            /* number of fields or names in the root */
    uint16_t additions_count;       /* number of known extension additions; a group counts as one */
    uint8_t alphabet_count, gaps_count;
    /* Generated code, called by captain_decode etc. decode and encode are NULL for numbers, strings and small SEQUENCEs of
     * numbers outside lists: the code of the enclosing type handles them. `at`: offset in bits. They return the offset after
     * the value, or CAPTAIN_FAILED. */
    size_t (*decode)(captain_reader *reader, size_t at, void *value);
    size_t (*encode)(captain_writer *writer, size_t at, const void *value);
    captain_status (*validate)(const void *value);
} captain_type;

/* Short name of a field for captain_set: "speed", and the path of the field. */
typedef struct captain_short_name { const char *name; const char *path; } captain_short_name;

typedef struct captain_message {
    const char *name;      /* "cam-1.4.1" */
    const char *type;      /* name of the type in the station: "cam" */
    const char *standard;  /* "ETSI EN 302 637-2 v1.4.1" */
    const char *module;    /* "CAM-PDU-Descriptions" */
    const char *form_of;   /* name of the message of which this is the -ext form, in which extension markers survive serial
                            * constraints. Both forms share one C struct; encode with the table that decoded. NULL for a strict
                            * message */
    const captain_type *pdu;
    const uint8_t *ids;      /* values of messageID that announce it */
    const uint8_t *versions; /* values of protocolVersion that announce it */
    uint8_t ids_count, versions_count;
    uint8_t release;       /* 1 or 2 */
    bool is_experimental;
    uint16_t btp_port;
    uint16_t rank;         /* preference among editions; the smallest is preferred */
    uint32_t arena;        /* most arena octets that decode takes per octet of any message; four times as many for fragments,
                            * that is for parts with 16384 or more elements or octets */
    const captain_short_name *short_names;
    uint16_t short_names_count;
} captain_message;

/* All messages of this library, sorted by type and rank; their number is captain_messages_count. */
extern const captain_message *const captain_messages[];
extern const size_t captain_messages_count;
const captain_message *captain_find_message(const char *name); /* "cam-1.4.1", or "cam" for its smallest rank; NULL if unknown */

/* ---------------------------------------------------------------- decode, encode, validate
 *
 * Generated headers declare the same functions for each PDU and named type, with its own struct:
 *   captain_status r1_cam_CAM_decode(r1_cam_CAM *value, const void *octets, size_t size, captain_arena *arena, size_t *bits); */

/* value: pdu->size octets, which need not be cleared. bits: may be NULL; number of bits used, or the offset of an error. Octets
 * after the message are ignored (see captain_decode_exact). It never reads beyond size. */
captain_status captain_decode(const captain_type *type, void *value, const void *octets, size_t size, captain_arena *arena, size_t *bits);
/* The same; returns CAPTAIN_TRAILING for octets after the message, or padding other than zeros. */
captain_status captain_decode_exact(const captain_type *type, void *value, const void *octets, size_t size, captain_arena *arena);
/* bits: number of bits written. The last octet is padded with zeros; an empty encoding is one zero octet (X.691 11.1.3). With
 * CAPTAIN_NO_SPACE, bits is the required number, and the contents of the buffer are undefined. */
captain_status captain_encode(const captain_type *type, const void *value, void *octets, size_t size, size_t *bits);
/* Check every constraint of the standard, including those that PER ignores. */
captain_status captain_validate(const captain_type *type, const void *value);

/* ---------------------------------------------------------------- functions that walk the tables */

/* Initialise a value: numbers 0, defaults assigned, optional components absent, lists empty. */
void captain_init(const captain_type *type, void *value);

/* Fill a value with a legal message, which encodes and validates: number or item "unavailable" or "unknown", else the smallest
 * number, else the first item; OPTIONAL absent, unless a constraint requires it; the first alternative; the smallest size. The
 * ITS PDU header has messageID and protocolVersion of the edition, and stationID 1. CAPTAIN_NO_MEMORY; CAPTAIN_INNER for a
 * constraint that these rules do not satisfy (no message of a standard has one). */
captain_status captain_example(const captain_message *message, void *value, captain_arena *arena);

/* Set a field of a value that captain_example or decode filled.
 * name  a short name of the message, or a path: "cam.camParameters.basicContainer.stationType", "denm.situation.eventType". An
 *       absent component on the path is created with example values, another alternative replaces the chosen one, and the index
 *       after the last element of a list adds one. "*" is the chosen alternative.
 * text  the value in the plain dialect of JSON ("13.9" m/s, "unavailable"), in which quotes around text, and brackets around the
 *       name of one bit, may be omitted. INTEGER also takes the name of an ordinary number ("passengerCar"), CHOICE the name of
 *       an alternative, or its index, which for causeCode is the cause. A character string is the text itself.
 * After an error the value must not be used. report may be NULL. The report of an unknown name lists paths with this name. */
captain_status captain_set(const captain_message *message, void *value, const char *name, const char *text, captain_arena *arena, captain_report *report);

/* Return why decode or decode_exact failed, or CAPTAIN_OK: decodes again, slowly, and reports path, bit and sentence. For
 * octets that are both truncated and invalid, either is reported. It needs no arena, so it never reports CAPTAIN_NO_MEMORY. On
 * success report->bit is the number of bits used. */
captain_status captain_explain_decode(const captain_type *type, const void *octets, size_t size, bool exact, captain_report *report);
/* Report the first value that encode (is_strict false) or validate (is_strict true) refuses. Pointers may be NULL here. */
captain_status captain_explain_value(const captain_type *type, const void *value, bool is_strict, captain_report *report);

/* Compare as values: absent defaults equal present ones, trailing zeros of named bits are ignored, kept additions count. */
bool captain_equal(const captain_type *type, const void *left, const void *right);

/* Receiver of text. If it returns false, the walk ends with CAPTAIN_NO_SPACE. */
typedef bool (*captain_sink)(void *context, const char *text, size_t octets);

/* Write the values as octets without field names, in encoding order: numbers, positions of set bits, indices of items and
 * alternatives, counts, octets. Two editions that decode to the same values give the same octets. The format may change.
 * unknown: number of additions, alternatives, items and open types that the type does not know. */
captain_status captain_leaves(const captain_type *type, const void *value, captain_sink sink, void *context, uint32_t *unknown);

/* Write an indented tree, one field per line, with names of special values and values in their unit: "speedValue: 0
 * (standstill)", "speedValue: 2028 (20.28 m/s)", "generationDeltaTime: 37862 ms". Scaled values are exact. */
captain_status captain_print(const captain_type *type, const void *value, captain_sink sink, void *context);

/* Write JSON in the form of JER (X.697), without blanks: SEQUENCE an object, SEQUENCE OF an array, CHOICE an object with one
 * member, ENUMERATED its name, INTEGER a number, BOOLEAN true or false, NULL null, BIT STRING of fixed size hexadecimal text,
 * other BIT STRINGs {"value": hex, "length": bits}, OCTET STRING hexadecimal text, open types their value, or hexadecimal text
 * if unknown. Beyond JER: an unknown addition is a member "[3]": "hex of its open type", where 3 is its index; a kept length of
 * the bitmap is "[]": 5; an unknown enumeration item is "[2]", an unknown alternative {"[1]": "hex"}; an object identifier with
 * a number above 64 bits is "[hex of its octets]". */
captain_status captain_json_write(const captain_type *type, const void *value, captain_sink sink, void *context);
/* Read strict JSON in UTF-8. Members may have any order; unknown and duplicate members are errors; a missing member takes its
 * default. Numbers may be written as 1.0 or 1e3. A known open type, unless it is text, may be given as hexadecimal text. Values
 * that encode would refuse are refused. report may be NULL. */
captain_status captain_json_read(const captain_type *type, void *value, const char *json, size_t octets, captain_arena *arena, captain_report *report);

/* The plain dialect: the same tree and names, but a number with a unit is in the SI unit (or degree, degree Celsius) as the
 * shortest exact decimal, a special value is its name ("unavailable", "outOfRange"), and a BIT STRING with named bits is the list
 * of the names of its set bits. The reader rounds a number to the nearest step. It refuses a number outside the range of the
 * type without its special values, and text that does not name a special value. asn1/guide/json.md has all rules. */
captain_status captain_json_write_plain(const captain_type *type, const void *value, captain_sink sink, void *context);
captain_status captain_json_read_plain(const captain_type *type, void *value, const char *json, size_t octets, captain_arena *arena, captain_report *report);

/* Explain an encoding bit by bit: on_step is called for each part of the encoding, ascending by bit, and for begin and end of
 * containers. Strings are valid only during the call. Unknown additions, and headers of further fragments of open types, have
 * no type; a header inside a value is reported after it. Elements without bits are reported once. Text is cut after 512 octets
 * ("..."). If on_step returns false, the walk ends with CAPTAIN_NO_SPACE; octets after the end are CAPTAIN_TRAILING. */
typedef struct captain_step {
    enum { CAPTAIN_STEP_VALUE, CAPTAIN_STEP_ENTER, CAPTAIN_STEP_LEAVE,
           CAPTAIN_STEP_EXTENSION_BIT, CAPTAIN_STEP_PRESENCE, /* preamble of a SEQUENCE: value is the bits as text "101" */
           CAPTAIN_STEP_LENGTH, CAPTAIN_STEP_CHOICE, CAPTAIN_STEP_OPEN, /* length octets of an open type */
           CAPTAIN_STEP_UNKNOWN, CAPTAIN_STEP_PADDING } what;
    size_t bit, width;      /* offset in the message, and number of bits */
    const char *path;       /* as in captain_report */
    const captain_type *type;
    const captain_field *field; /* NULL for list elements and the PDU itself */
    const char *text;       /* the value, as captain_print writes it */
    const char *clause;     /* clause of X.691 (02/2021): "11.9.3.6", "19.2", ... */
} captain_step;
typedef bool (*captain_on_step)(void *context, const captain_step *step);
captain_status captain_explain(const captain_type *type, const void *octets, size_t size, captain_on_step on_step, void *context, captain_report *report);

#ifdef __cplusplus
}
#endif
#endif

/* A second UPER decoder, slow and from the tables alone: no struct, no arena, every step told. It shares no line with the
 * generated code, so that one is the test of the other. Its parts: explain_bits.c, explain_number.c (lengths too), explain_open.c,
 * explain_least.c, explain_values.c, explain_string.c, explain.c (containers).
 */
#ifndef CAPTAIN_EXPLAIN_H
#define CAPTAIN_EXPLAIN_H

#include "walk.h"

#pragma GCC visibility push(hidden)

/* Lists and strings whose items take no bits: nothing in the octets bounds them, so this does. */
enum { EXPLAIN_MAX_EMPTY = 65536 };
#define EXPLAIN_EMPTY_TEXT "nothing bounds the number of %s without bits, so that 65536 are the most"

/* An open type that the walk is inside of: bits left of its current fragment, and whether another one follows. The headers of
 * fragments lie between the bits of the value, so that what is inside cannot be a plain stretch of the message. */
typedef struct explain_frame {
    size_t left;
    bool has_more;
} explain_frame;

/* The header of a further fragment, to be told when the value amid which it lies has been told. */
typedef struct explain_header {
    size_t bit, width;
    uint64_t octets;
    const char *clause;
} explain_header;
/* Amid one value; a value of more than half a megabyte has more, which are not told. */
enum { EXPLAIN_MAX_HEADERS = 8 };

typedef struct explain {
    const uint8_t *octets;
    size_t at, end; /* bits */
    size_t taken;   /* behind the last bit of a value, in front of headers that follow it */
    explain_header headers[EXPLAIN_MAX_HEADERS];
    unsigned headers_count;
    unsigned depth, recursion, frames_count;
    explain_frame frames[CAPTAIN_MAX_DEPTH];
    captain_path path;
    captain_on_step on_step; /* may be NULL */
    void *context;
    captain_report *report; /* may be NULL */
} explain;

/* What is decoded now. number: what an INTEGER was, for the open type that it selects; of an open type what its selector was. */
typedef struct explain_node {
    const captain_type *type;
    const captain_field *field;
    int64_t number;
    bool has_number;
} explain_node;

/* Presence bits: of a SEQUENCE's components (no type of the standards has more than 64 optional ones), or of its additions. */
enum { EXPLAIN_MAX_OPTIONAL = 1024, EXPLAIN_MAX_ADDITIONS = CAPTAIN_WALK_ADDITIONS, EXPLAIN_FLAGS_TEXT = 260 };
typedef struct explain_flags {
    unsigned count;
    uint8_t *octets;
} explain_flags;

/* ---------------------------------------------------------------- explain_bits.c */

typedef struct explain_part {
    uint64_t count; /* of items */
    size_t bit;     /* where its length stands */
    bool has_more;  /* another fragment follows */
} explain_part;

/* Bits from `from` to the last one taken, as one step. */
captain_status captain_explain_step(explain *to, const explain_node *node, unsigned what, size_t from, const char *text,
                                    const char *clause);
captain_status captain_explain_number_step(explain *to, const explain_node *node, unsigned what, size_t from, uint64_t number,
                                           const char *clause);
captain_status captain_explain_refuse(explain *to, size_t bit, captain_status status, const char *text);
/* That so many bits are there before one of them is believed. */
captain_status captain_explain_require(explain *to, uint64_t bits);
captain_status captain_explain_take(explain *to, unsigned width, uint64_t *bits);
captain_status captain_explain_skip(explain *to, uint64_t bits);
/* The length of the next fragment of the open type at this level, 1 for the outermost (11.9.3.5 to 11.9.3.8). */
captain_status captain_explain_next_fragment(explain *to, unsigned level);
captain_status captain_explain_take_flags(explain *to, unsigned count, explain_flags *flags);
bool captain_explain_flag(const explain_flags *flags, unsigned n);
const char *captain_explain_flags_text(const explain_flags *flags, char text[EXPLAIN_FLAGS_TEXT]);

/* ---------------------------------------------------------------- explain_number.c */

unsigned captain_explain_width(uint64_t range); /* bits that hold 0..range */
/* The octets of a number behind their length (11.7, 11.8), unsigned, and the bit that they begin at. */
captain_status captain_explain_whole(explain *to, const explain_node *node, uint64_t *number, unsigned *octets, size_t *from);
/* A normally small number (11.6). */
captain_status captain_explain_small(explain *to, uint64_t *number);
/* Which item of an ENUMERATED or alternative of a CHOICE, counted from the first of the root or of the additions. */
captain_status captain_explain_index(explain *to, const captain_type *type, bool is_extended, uint64_t *index);
/* One length without bounds (11.9.3.5 to 11.9.3.8), and the clause it follows: without a step, and with one. */
captain_status captain_explain_take_length(explain *to, explain_part *part, const char **clause);
captain_status captain_explain_length(explain *to, const explain_node *node, explain_part *part);
/* All parts of a string of items of `width` bits are there and well formed: how many items they have. Goes nowhere. */
captain_status captain_explain_survey(explain *to, unsigned width, uint64_t *total);
/* Whether a size has a constrained length (11.9.4.1), or none, instead of a general one; in_root: what the extension bit says. */
bool captain_explain_is_counted(const captain_type *type, bool in_root);
captain_status captain_explain_check_size(explain *to, const captain_type *type, size_t bit, uint64_t count);
/* The next part of what has a size. One that is counted is checked. */
captain_status captain_explain_size(explain *to, const explain_node *node, bool in_root, explain_part *part);
/* A normally small length (11.9.3.4). */
captain_status captain_explain_bitmap_length(explain *to, const explain_node *node, unsigned *count);
captain_status captain_explain_extension_bit(explain *to, const explain_node *node, bool *is_extended, const char *clause);

/* ---------------------------------------------------------------- explain_open.c */

/* An open type (11.2): its length, then what is in it, then its padding. */
captain_status captain_explain_enter_open(explain *to, const explain_node *node, size_t *start);
captain_status captain_explain_leave_open(explain *to, const explain_node *node, size_t start);
captain_status captain_explain_unknown(explain *to, const explain_node *node, const char *clause);

/* ---------------------------------------------------------------- explain_values.c, explain_string.c */

captain_status captain_explain_simple(explain *to, explain_node *node);
captain_status captain_explain_string(explain *to, explain_node *node);
/* A value in memory as a step; is_cut: more of it follows than is shown. */
captain_status captain_explain_value_step(explain *to, const explain_node *node, size_t from, const void *value, bool is_cut,
                                          const char *clause);

/* A value step shows this much of a string: octets. */
enum { EXPLAIN_PREVIEW = 512 };

/* Least bits that a value of the type takes (explain_least.c): what a number of elements is believed by. */
uint64_t captain_explain_least_bits(const captain_type *type);

#pragma GCC visibility pop

#endif

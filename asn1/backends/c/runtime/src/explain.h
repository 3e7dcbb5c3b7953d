/* Second UPER decoder, slow and driven by the tables only: without structs and arena, and it reports every step. It shares no
 * code with the generated decoders, so that each tests the other. Its parts: explain_bits.c, explain_number.c (and lengths),
 * explain_open.c, explain_least.c, explain_values.c, explain_string.c, explain.c (containers). */
#ifndef CAPTAIN_EXPLAIN_H
#define CAPTAIN_EXPLAIN_H

#include "walk.h"

#pragma GCC visibility push(hidden)

/* Limit for lists and strings whose items have no bits, because the octets do not limit their count. */
enum { EXPLAIN_MAX_EMPTY = 65536 };
#define EXPLAIN_EMPTY_TEXT "nothing bounds the number of %s without bits, so that 65536 are the most"

/* An open type that is being read: bits left of its current fragment, and whether another one follows. Headers of fragments lie
 * between the bits of the value, so that the contents are not contiguous in the message. */
typedef struct explain_frame {
    size_t left;
    bool has_more;
} explain_frame;

/* Header of a further fragment. It is reported after the value that surrounds it. */
typedef struct explain_header {
    size_t bit, width;
    uint64_t octets;
    const char *clause;
} explain_header;
/* Limit of headers inside one value. A value above half a megabyte has more; the rest is not reported. */
enum { EXPLAIN_MAX_HEADERS = 8 };

typedef struct explain {
    const uint8_t *octets;
    size_t at, end; /* bits */
    size_t taken;   /* after the last bit of a value, before the headers that follow it */
    explain_header headers[EXPLAIN_MAX_HEADERS];
    unsigned headers_count;
    unsigned depth, recursion, frames_count;
    explain_frame frames[CAPTAIN_MAX_DEPTH];
    captain_path path;
    captain_on_step on_step; /* may be NULL */
    void *context;
    captain_report *report; /* may be NULL */
} explain;

/* The value that is being decoded. number: value of an INTEGER, which may select an open type; for an open type, its selector. */
typedef struct explain_node {
    const captain_type *type;
    const captain_field *field;
    int64_t number;
    bool has_number;
} explain_node;

/* Presence bits of a SEQUENCE's components, or of its additions. No type of the standards has more than 64 optional components. */
enum { EXPLAIN_MAX_OPTIONAL = 1024, EXPLAIN_MAX_ADDITIONS = CAPTAIN_WALK_ADDITIONS, EXPLAIN_FLAGS_TEXT = 260 };
typedef struct explain_flags {
    unsigned count;
    uint8_t *octets;
} explain_flags;

/* ---------------------------------------------------------------- explain_bits.c */

typedef struct explain_part {
    uint64_t count; /* number of items */
    size_t bit;     /* offset of its length */
    bool has_more;  /* another fragment follows */
} explain_part;

/* Report the bits from `from` to the current offset as one step. */
captain_status captain_explain_step(explain *to, const explain_node *node, unsigned what, size_t from, const char *text,
                                    const char *clause);
captain_status captain_explain_number_step(explain *to, const explain_node *node, unsigned what, size_t from, uint64_t number,
                                           const char *clause);
captain_status captain_explain_refuse(explain *to, size_t bit, captain_status status, const char *text);
/* Fail unless so many bits are left. */
captain_status captain_explain_require(explain *to, uint64_t bits);
captain_status captain_explain_take(explain *to, unsigned width, uint64_t *bits);
captain_status captain_explain_skip(explain *to, uint64_t bits);
/* Read the length of the next fragment of the open type at this level; 1 is the outermost (11.9.3.5 to 11.9.3.8). */
captain_status captain_explain_next_fragment(explain *to, unsigned level);
captain_status captain_explain_take_flags(explain *to, unsigned count, explain_flags *flags);
bool captain_explain_flag(const explain_flags *flags, unsigned n);
const char *captain_explain_flags_text(const explain_flags *flags, char text[EXPLAIN_FLAGS_TEXT]);

/* ---------------------------------------------------------------- explain_number.c */

unsigned captain_explain_width(uint64_t range); /* number of bits for 0..range */
/* Read the octets of an unsigned number after their length (11.7, 11.8). from: offset of the number. */
captain_status captain_explain_whole(explain *to, const explain_node *node, uint64_t *number, unsigned *octets, size_t *from);
/* A normally small number (11.6). */
captain_status captain_explain_small(explain *to, uint64_t *number);
/* Read the index of an item (ENUMERATED) or alternative (CHOICE), counted in the root or in the additions. */
captain_status captain_explain_index(explain *to, const captain_type *type, bool is_extended, uint64_t *index);
/* Read one general length (11.9.3.5 to 11.9.3.8), with its clause: the first function reports no step, the second one does. */
captain_status captain_explain_take_length(explain *to, explain_part *part, const char **clause);
captain_status captain_explain_length(explain *to, const explain_node *node, explain_part *part);
/* Check all fragments of a string with items of `width` bits. total: number of items. Does not move the offset. */
captain_status captain_explain_survey(explain *to, unsigned width, uint64_t *total);
/* Return whether a size has a constrained length (11.9.4.1) or none, not a general one. in_root: extension bit is 0. */
bool captain_explain_is_counted(const captain_type *type, bool in_root);
captain_status captain_explain_check_size(explain *to, const captain_type *type, size_t bit, uint64_t count);
/* Read the next part of a string or list. A constrained size is checked. */
captain_status captain_explain_size(explain *to, const explain_node *node, bool in_root, explain_part *part);
/* A normally small length (11.9.3.4). */
captain_status captain_explain_bitmap_length(explain *to, const explain_node *node, unsigned *count);
captain_status captain_explain_extension_bit(explain *to, const explain_node *node, bool *is_extended, const char *clause);

/* ---------------------------------------------------------------- explain_open.c */

/* Open type (11.2): length, contents, padding. */
captain_status captain_explain_enter_open(explain *to, const explain_node *node, size_t *start);
captain_status captain_explain_leave_open(explain *to, const explain_node *node, size_t start);
captain_status captain_explain_unknown(explain *to, const explain_node *node, const char *clause);

/* ---------------------------------------------------------------- explain_values.c, explain_string.c */

captain_status captain_explain_simple(explain *to, explain_node *node);
captain_status captain_explain_string(explain *to, explain_node *node);
/* Report a value in memory as a step. is_cut: only its beginning is shown. */
captain_status captain_explain_value_step(explain *to, const explain_node *node, size_t from, const void *value, bool is_cut,
                                          const char *clause);

/* Limit of a string in a step, in octets. */
enum { EXPLAIN_PREVIEW = 512 };

/* Return the fewest bits of a value of the type (explain_least.c), to check numbers of elements. */
uint64_t captain_explain_least_bits(const captain_type *type);

#pragma GCC visibility pop

#endif

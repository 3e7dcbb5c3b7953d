/* Alphabets of character strings, UTF-8, object identifiers. */
#ifndef CAPTAIN_CHARACTERS_H
#define CAPTAIN_CHARACTERS_H

#include "bits.h"

/* Code points in ascending ranges. by_index: a code in the encoding is the index of its character, since the code points
 * would need more bits (30.5.4). */
typedef struct captain_characters {
    const captain_range *ranges;
    unsigned count;
    unsigned bits; /* of each character */
    bool by_index;
} captain_characters;

/* Of the whole type: outside of the root of an extensible size the alphabet is that (30.4). */
CAPTAIN_HIDDEN captain_characters captain_whole_alphabet(const captain_type *type);
CAPTAIN_HIDDEN captain_characters captain_alphabet(const captain_type *type);
/* The character of a code in the encoding, and the code of a character; -1 where there is none. */
CAPTAIN_HIDDEN int captain_character(const captain_characters *set, unsigned code);
CAPTAIN_HIDDEN int captain_code_of(const captain_characters *set, unsigned char point);
/* UTF-8 without surrogates, overlong forms and what lies above 10FFFF: its characters, or SIZE_MAX. */
CAPTAIN_HIDDEN size_t captain_utf8_count(const unsigned char *text, size_t octets);
/* X.690 8.19.2: arcs of seven bits an octet, the last one without its top bit, none beginning with 0x80. */
CAPTAIN_HIDDEN bool captain_is_oid(const uint8_t *octets, size_t count);

#endif

/* Alphabets of character strings, UTF-8, object identifiers. */
#ifndef CAPTAIN_CHARACTERS_H
#define CAPTAIN_CHARACTERS_H

#include "bits.h"

/* Alphabet: code points in ascending ranges. by_index: encoded codes are indices of characters, because code points would need
 * more bits (30.5.4). */
typedef struct captain_characters {
    const captain_range *ranges;
    unsigned count;
    unsigned bits; /* bits per character */
    bool by_index;
} captain_characters;

/* Return the alphabet of the whole type, which applies outside the root of an extensible size (30.4). */
CAPTAIN_HIDDEN captain_characters captain_whole_alphabet(const captain_type *type);
CAPTAIN_HIDDEN captain_characters captain_alphabet(const captain_type *type);
/* Return the character of an encoded code, and the code of a character; -1 for an unknown one. */
CAPTAIN_HIDDEN int captain_character(const captain_characters *set, unsigned code);
CAPTAIN_HIDDEN int captain_code_of(const captain_characters *set, unsigned char point);
/* Return the number of characters in UTF-8; SIZE_MAX if invalid: surrogates, overlong forms, above 10FFFF. */
CAPTAIN_HIDDEN size_t captain_utf8_count(const unsigned char *text, size_t octets);
/* X.690 8.19.2: each arc has seven bits per octet; its last octet has a top bit of 0, its first octet is not 0x80. */
CAPTAIN_HIDDEN bool captain_is_oid(const uint8_t *octets, size_t count);

#endif

/* Suggestion of the most similar name, for "did you mean". */
#include "walk.h"

#include <string.h>

/* Limit of compared names, in characters. */
enum { LONGEST = 64 };

static unsigned least(unsigned a, unsigned b, unsigned c)
{
    unsigned ab = a < b ? a : b;
    return ab < c ? ab : c;
}

static int folded(char character)
{
    return character >= 'A' && character <= 'Z' ? character - 'A' + 'a' : character;
}

/* Return the Levenshtein distance of two names: insertions, deletions and replacements. Case is ignored. */
static unsigned distance(const char *left, size_t left_length, const char *right, size_t right_length)
{
    unsigned row[LONGEST + 1];
    for (unsigned k = 0; k <= right_length; k++)
        row[k] = k;
    for (size_t i = 0; i < left_length; i++) {
        unsigned diagonal = row[0];
        row[0] = (unsigned)i + 1;
        for (size_t k = 0; k < right_length; k++) {
            unsigned same = folded(left[i]) == folded(right[k]) ? 0 : 1;
            unsigned next = least(row[k + 1] + 1, row[k] + 1, diagonal + same);
            diagonal = row[k + 1];
            row[k + 1] = next;
        }
    }
    return row[right_length];
}

const char *captain_walk_nearest(const char *name, const void *first, size_t stride, unsigned count)
{
    const char *nearest = NULL;
    size_t length = strlen(name);
    unsigned best = (unsigned)(length / 3 + 1); /* a name with more than a third of errors is not similar */
    for (unsigned i = 0; i < count && length <= LONGEST; i++) {
        const char *candidate;
        memcpy(&candidate, (const char *)first + i * stride, sizeof candidate);
        size_t other = strlen(candidate);
        unsigned edits = other <= LONGEST ? distance(name, length, candidate, other) : LONGEST;
        if (edits > best || (edits == best && nearest != NULL))
            continue;
        best = edits;
        nearest = candidate;
    }
    return nearest;
}

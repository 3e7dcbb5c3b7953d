/* Parts of a value in memory that are written: memory of components, and example values. This header is internal. */
#ifndef CAPTAIN_PLACE_H
#define CAPTAIN_PLACE_H

#include "walk.h"

#pragma GCC visibility push(hidden)

/* depth: number of enclosing values; CAPTAIN_DEPTH above CAPTAIN_WALK_DEPTH. */
typedef struct captain_filling {
    captain_arena *arena;
    unsigned depth;
} captain_filling;

/* Set `value` to the memory of a component or alternative; for a pointer, allocate it. CAPTAIN_NO_MEMORY. */
captain_status captain_place(const captain_field *field, void *structure, captain_filling *in, void **value);
/* Mark a component as present, and set it to its example. The example of an open type is left out. */
captain_status captain_place_example(const captain_field *field, void *structure, captain_filling *in);
/* Select a row of an open type: set its identifier, and the open type to the example of the row. */
captain_status captain_place_row(const captain_type *holder, const captain_field *open, const captain_row *row, void *structure,
                                 captain_filling *in);
/* Set a value to its example, see captain_example. */
captain_status captain_example_value(const captain_type *type, void *value, captain_filling *in);
/* Return whether a name of the standard is `name` of so many characters; case, - and _ make no difference. */
bool captain_is_name(const char *found, const char *name, size_t length);

#pragma GCC visibility pop

#endif

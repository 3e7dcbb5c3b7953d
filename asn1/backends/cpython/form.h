/* A SEQUENCE has few patterns of present components. A `form` is kept for each pattern. Where the layout of dicts is known, all
 * dicts of a form share its table of keys, like objects of a class (PEP 412), and values are written directly to their places:
 * no hashing and no copy of keys. A dict of three values takes 30 ns in place of 75 to 120 ns. Encode recognises such a dict by
 * its table, without comparing keys. */
#ifndef CAPTAIN_FORM_H
#define CAPTAIN_FORM_H

#include "dict_layout.h"
#include "shapes.h"

#ifdef MAY_KNOW_DICTS

enum { MAX_PREFIX = 32 };

/* Place and kind of a value in the form. */
typedef struct part {
    const slot *slot;
    const shape *shape;
    uint32_t offset;
    bool is_plain; /* not behind a pointer, no default */
} part;

typedef struct form {
    uint64_t mask; /* bits of the present optional components; bit 0 is the first of them */
    struct form *next;
    keys_table *keys; /* NULL: dicts cannot share these keys */
    size_t prefix_octets;
    unsigned char prefix[MAX_PREFIX]; /* prefix of the values in memory */
    uint16_t count;
    bool has_containers;
    bool has_early; /* see slot */
    part parts[];
} form;

/* Return the form of a dict that shares its keys and still has all of them; NULL for other dicts, and for those that encode
 * must sort. */
static inline const form *form_of(const shape *shape, PyObject *dict)
{
    const form *form = shape->forms;
    while (form != NULL && form->keys != table_of(dict))
        form = form->next;
    return form == NULL || form->has_early || ((PyDictObject *)dict)->ma_used != form->count ? NULL : form;
}

#endif
#endif

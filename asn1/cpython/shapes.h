/* The tables of runtime.h as Python needs them: one shape for each captain_type that a message of this library reaches, with
 * interned names and what decode and encode would otherwise work out for every value. Made once, at import, then constant
 * (but for the forms of form.h, under the GIL). */
#ifndef CAPTAIN_SHAPES_H
#define CAPTAIN_SHAPES_H

#include "compat.h"

#include <captain/runtime.h>

typedef enum shape_op {
    OP_BOOLEAN, OP_NULL,
    OP_U8, OP_U16, OP_U32, OP_U64, OP_I8, OP_I16, OP_I32, OP_I64, /* INTEGER by how it lies in memory */
    OP_ENUMERATED, OP_SMALL_BITS, OP_BITS, OP_FIXED_OCTETS, OP_OCTETS, OP_TEXT, OP_OID,
    OP_SEQUENCE, OP_CHOICE, OP_LIST, OP_OPEN /* what a view shows as a view, and a dict as a container: from here on */
} shape_op;

typedef struct shape shape;

/* A component of a SEQUENCE or an alternative of a CHOICE: 64 octets, what decode and encode look at first. */
typedef struct slot {
    PyObject *key;       /* interned: as in the ASN.1 */
    const shape *shape;
    int64_t low, high;   /* as in shape */
    uint32_t offset;
    uint32_t present;    /* offset of the bool, or CAPTAIN_NOWHERE */
    uint8_t op;          /* as in shape */
    bool is_pointer;
    bool has_default;    /* absent, it has its default; an addition has not: its sender may not know it */
    bool is_plain;       /* always there, and not behind a pointer */
    bool is_early;       /* an open type in front of the identifier that tells its type */
    PyObject *attribute; /* interned: the key, or where that is no Python name: a-b is a_b, class is class_ */
    const captain_field *field;
} slot;

struct shape {
    const captain_type *type;
    uint8_t op;
    bool is_dense;       /* ENUMERATED: the number of every item is its index */
    uint16_t slots_count, optionals_count;
    int64_t low, high;   /* INTEGER: what the encoding and the memory hold */
    slot *slots;
    uint32_t *optionals; /* SEQUENCE: offsets of the bools of all slots that may be absent, and then have no default */
    PyObject **attributes; /* of the slots, side by side: a view looks through them */
    PyObject **names;    /* ENUMERATED: as type->names */
    const shape *element;
    const shape **rows;  /* OPEN: as type->rows */
    struct form *forms;  /* SEQUENCE: see form.h */
};

/* NULL and an exception: no memory. */
const shape *shape_of(const captain_type *type);

/* Index of the name among `count` slots: `expected` is tried first. Interned names cost a comparison of pointers.
 * -1: none, without an exception (also where it is no str). */
Py_ssize_t slot_find(const shape *shape, PyObject *name, Py_ssize_t expected);
/* Index by any object that is equal; the names of the ASN.1 are found as well. -1: none. */
Py_ssize_t slot_find_attribute(const shape *shape, PyObject *name);
/* Index of an ENUMERATED's item. */
Py_ssize_t item_find(const shape *shape, PyObject *name);

/* The value of a slot in a struct, its pointer followed. */
static inline const unsigned char *slot_value(const slot *slot, const unsigned char *record)
{
    const unsigned char *value = record + slot->offset;
    return slot->is_pointer ? *(const unsigned char *const *)(const void *)value : value;
}

/* Absent, it is not in a dict. */
static inline bool is_optional(const slot *slot)
{
    return slot->present != CAPTAIN_NOWHERE && !slot->has_default;
}

static inline bool slot_is_absent(const slot *slot, const unsigned char *record)
{
    return slot->present != CAPTAIN_NOWHERE && !*(const bool *)(record + slot->present);
}

/* Octets of a BIT STRING of so many bits. */
static inline size_t octets_of_bits(size_t bits)
{
    return (bits + 7) / 8;
}

/* Where the alternatives of a CHOICE, and u.unknown, lie. */
static inline size_t union_offset(const captain_type *type)
{
    return type->fields_count > 0 ? type->fields[0].offset : offsetof(struct { uint32_t choice; captain_octets unknown; }, unknown);
}

#endif

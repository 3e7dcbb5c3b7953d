/* Tables of runtime.h prepared for Python: one shape for each captain_type that a message reaches, with interned names and
 * values that decode and encode would otherwise compute each time. They are made once, at import, and constant except for the
 * forms of form.h, which the GIL protects. */
#ifndef CAPTAIN_SHAPES_H
#define CAPTAIN_SHAPES_H

#include "compat.h"

#include <captain/runtime.h>

typedef enum shape_op {
    OP_BOOLEAN, OP_NULL,
    OP_U8, OP_U16, OP_U32, OP_U64, OP_I8, OP_I16, OP_I32, OP_I64, /* INTEGER, by its type in memory */
    OP_ENUMERATED, OP_SMALL_BITS, OP_BITS, OP_FIXED_OCTETS, OP_OCTETS, OP_TEXT, OP_OID,
    OP_SEQUENCE, OP_CHOICE, OP_LIST, OP_OPEN /* types that are shown as views, and containers in dicts: from here on */
} shape_op;

typedef struct shape shape;

/* Component of a SEQUENCE or alternative of a CHOICE: 64 octets with the data that decode and encode need first. */
typedef struct slot {
    PyObject *key;       /* interned ASN.1 name */
    const shape *shape;
    int64_t low, high;   /* as in shape */
    uint32_t offset;
    uint32_t present;    /* offset of the bool, or CAPTAIN_NOWHERE */
    uint8_t op;          /* as in shape */
    bool is_pointer;
    bool has_default;    /* its default applies if absent; false for additions, because their sender may not know them */
    bool is_plain;       /* always present, and not behind a pointer */
    bool is_early;       /* an open type before the identifier that selects its type */
    PyObject *attribute; /* interned: the key, or a valid Python name in its place: a-b is a_b, class is class_ */
    const captain_field *field;
} slot;

struct shape {
    const captain_type *type;
    uint8_t op;
    bool is_dense;       /* ENUMERATED: the number of every item equals its index */
    uint16_t slots_count, optionals_count;
    int64_t low, high;   /* INTEGER: range of the encoding and of the memory */
    slot *slots;
    uint32_t *optionals; /* SEQUENCE: offsets of the flags of optional slots without a default */
    PyObject **attributes; /* attributes of the slots, side by side, for lookups in views */
    PyObject **names;    /* ENUMERATED: as type->names */
    const shape *element;
    const shape **rows;  /* OPEN: as type->rows */
    struct form *forms;  /* SEQUENCE: see form.h */
};

/* Return NULL with an exception if memory is exhausted. */
const shape *shape_of(const captain_type *type);

/* Return the index of a name among `count` slots; `expected` is tried first. Interned names need only a comparison of pointers.
 * Returns -1 without an exception for unknown names, and for objects other than str. */
Py_ssize_t slot_find(const shape *shape, PyObject *name, Py_ssize_t expected);
/* Return the index for any equal object. ASN.1 names are found as well. -1 if unknown. */
Py_ssize_t slot_find_attribute(const shape *shape, PyObject *name);
/* Return the index of an ENUMERATED's item. */
Py_ssize_t item_find(const shape *shape, PyObject *name);

/* Return the value of a slot in a struct, also behind its pointer. */
static inline const unsigned char *slot_value(const slot *slot, const unsigned char *record)
{
    const unsigned char *value = record + slot->offset;
    return slot->is_pointer ? *(const unsigned char *const *)(const void *)value : value;
}

/* Return whether dicts omit it if absent. */
static inline bool is_optional(const slot *slot)
{
    return slot->present != CAPTAIN_NOWHERE && !slot->has_default;
}

static inline bool slot_is_absent(const slot *slot, const unsigned char *record)
{
    return slot->present != CAPTAIN_NOWHERE && !*(const bool *)(record + slot->present);
}

/* Return the octets of a BIT STRING of so many bits. */
static inline size_t octets_of_bits(size_t bits)
{
    return (bits + 7) / 8;
}

/* Return the offset of a CHOICE's alternatives, and of u.unknown. */
static inline size_t union_offset(const captain_type *type)
{
    return type->fields_count > 0 ? type->fields[0].offset : offsetof(struct { uint32_t choice; captain_octets unknown; }, unknown);
}

#endif

#include "shapes.h"

#include <string.h>

/* ---------------------------------------------------------------- from type to shape */

/* Hash table with open addressing by the type's address. Its size is a power of two; it is at most three quarters full. */
static shape **table;
static size_t table_size, table_used;

static size_t place_of(const captain_type *type)
{
    return (size_t)(((uintptr_t)type >> 4) * UINT64_C(0x9E3779B97F4A7C15) >> 32) & (table_size - 1);
}

static shape **find_place(const captain_type *type)
{
    size_t place = place_of(type);
    while (table[place] != NULL && table[place]->type != type)
        place = (place + 1) & (table_size - 1);
    return &table[place];
}

static bool table_grow(void)
{
    size_t before_size = table_size;
    shape **before = table;
    size_t size = before_size == 0 ? 1024 : 2 * before_size;
    shape **larger = PyMem_Calloc(size, sizeof *larger);
    if (larger == NULL) {
        PyErr_NoMemory();
        return false;
    }
    table = larger;
    table_size = size;
    for (size_t index = 0; index < before_size; index++)
        if (before[index] != NULL)
            *find_place(before[index]->type) = before[index];
    PyMem_Free(before);
    return true;
}

/* ---------------------------------------------------------------- one shape */

static const uint8_t OPS[] = {
    [CAPTAIN_BOOLEAN] = OP_BOOLEAN, [CAPTAIN_NULL] = OP_NULL, [CAPTAIN_ENUMERATED] = OP_ENUMERATED,
    [CAPTAIN_SMALL_BITS] = OP_SMALL_BITS, [CAPTAIN_BIT_STRING] = OP_BITS, [CAPTAIN_FIXED_OCTETS] = OP_FIXED_OCTETS,
    [CAPTAIN_OCTET_STRING] = OP_OCTETS, [CAPTAIN_IA5] = OP_TEXT, [CAPTAIN_VISIBLE] = OP_TEXT, [CAPTAIN_PRINTABLE] = OP_TEXT,
    [CAPTAIN_NUMERIC] = OP_TEXT, [CAPTAIN_UTF8] = OP_TEXT, [CAPTAIN_OID] = OP_OID, [CAPTAIN_RELATIVE_OID] = OP_OID,
    [CAPTAIN_SEQUENCE] = OP_SEQUENCE, [CAPTAIN_CHOICE] = OP_CHOICE, [CAPTAIN_LIST] = OP_LIST, [CAPTAIN_OPEN] = OP_OPEN,
};

static uint8_t op_of(const captain_type *type)
{
    if (type->kind != CAPTAIN_INTEGER)
        return OPS[type->kind];
    uint8_t exponent = type->width == 1 ? 0 : type->width == 2 ? 1 : type->width == 4 ? 2 : 3;
    return (uint8_t)((type->flags & CAPTAIN_SIGNED ? OP_I8 : OP_U8) + exponent);
}

static void set_range(shape *shape)
{
    const captain_type *type = shape->type;
    bool is_open = (type->flags & CAPTAIN_EXTENSIBLE) != 0;
    shape->low = is_open || (type->flags & CAPTAIN_UNBOUNDED_LOW) ? INT64_MIN : type->low;
    shape->high = is_open || (type->flags & CAPTAIN_UNBOUNDED_HIGH) ? INT64_MAX : type->high;
}

/* Keywords of Python that are valid identifiers in ASN.1. */
static const char *const KEYWORDS[] = {
    "and", "as", "assert", "async", "await", "break", "class", "continue", "def", "del", "elif", "else", "except",
    "finally", "for", "from", "global", "if", "import", "in", "is", "lambda", "nonlocal", "not", "or", "pass", "raise",
    "return", "try", "while", "with", "yield",
};

static PyObject *attribute_name(PyObject *key, const char *name)
{
    char attribute[128];
    size_t length = strlen(name);
    bool is_keyword = false;
    for (size_t index = 0; index < sizeof KEYWORDS / sizeof *KEYWORDS; index++)
        is_keyword = is_keyword || strcmp(name, KEYWORDS[index]) == 0;
    if ((!is_keyword && strchr(name, '-') == NULL) || length + 2 > sizeof attribute)
        return Py_NewRef(key);
    memcpy(attribute, name, length + 1);
    for (char *at = attribute; *at != 0; at++)
        if (*at == '-')
            *at = '_';
    if (is_keyword)
        memcpy(attribute + length, "_", 2);
    return PyUnicode_InternFromString(attribute);
}

static bool fill_slots(shape *shape)
{
    const captain_type *type = shape->type;
    shape->slots = PyMem_Calloc(type->fields_count + (size_t)1, sizeof *shape->slots);
    shape->attributes = PyMem_Calloc(type->fields_count + (size_t)1, sizeof *shape->attributes);
    shape->optionals = PyMem_Calloc(type->fields_count + (size_t)1, sizeof *shape->optionals);
    if (shape->slots == NULL || shape->attributes == NULL || shape->optionals == NULL) {
        PyErr_NoMemory();
        return false;
    }
    for (uint16_t index = 0; index < type->fields_count; index++) {
        const captain_field *field = &type->fields[index];
        slot *slot = &shape->slots[index];
        slot->field = field;
        slot->offset = field->offset;
        slot->present = field->flags & CAPTAIN_OPTIONAL ? field->present : CAPTAIN_NOWHERE;
        slot->is_pointer = (field->flags & CAPTAIN_POINTER) != 0;
        slot->has_default = (field->flags & CAPTAIN_DEFAULT) && field->addition == 0;
        slot->key = PyUnicode_InternFromString(field->name);
        slot->attribute = slot->key == NULL ? NULL : attribute_name(slot->key, field->name);
        shape->attributes[index] = slot->attribute;
        slot->shape = slot->attribute == NULL ? NULL : shape_of(field->type);
        if (slot->shape == NULL)
            return false;
        slot->op = slot->shape->op;
        slot->is_plain = slot->present == CAPTAIN_NOWHERE && !slot->is_pointer;
        slot->low = slot->shape->low;
        slot->high = slot->shape->high;
        slot->is_early = slot->op == OP_OPEN && slot->shape->type->selector >= index;
        shape->slots_count++;
        if (is_optional(slot))
            shape->optionals[shape->optionals_count++] = slot->present;
    }
    return true;
}

static bool fill_names(shape *shape)
{
    const captain_type *type = shape->type;
    shape->names = PyMem_Calloc(type->names_count + (size_t)1, sizeof *shape->names);
    if (shape->names == NULL) {
        PyErr_NoMemory();
        return false;
    }
    shape->is_dense = true;
    for (uint16_t index = 0; index < type->names_count; index++) {
        shape->names[index] = PyUnicode_InternFromString(type->names[index].name);
        if (shape->names[index] == NULL)
            return false;
        shape->is_dense = shape->is_dense && type->names[index].value == index;
    }
    return true;
}

static bool fill_rows(shape *shape)
{
    const captain_type *type = shape->type;
    shape->rows = PyMem_Calloc(type->rows_count + (size_t)1, sizeof *shape->rows);
    if (shape->rows == NULL) {
        PyErr_NoMemory();
        return false;
    }
    for (uint16_t index = 0; index < type->rows_count; index++)
        if ((shape->rows[index] = shape_of(type->rows[index].type)) == NULL)
            return false;
    return true;
}

static bool fill(shape *shape)
{
    switch (shape->op) {
    case OP_SEQUENCE:
    case OP_CHOICE:
        return fill_slots(shape);
    case OP_ENUMERATED:
        return fill_names(shape);
    case OP_OPEN:
        return fill_rows(shape);
    case OP_LIST:
        return (shape->element = shape_of(shape->type->element)) != NULL;
    default:
        return true;
    }
}

const shape *shape_of(const captain_type *type)
{
    if (table_used * 4 >= table_size * 3 && !table_grow())
        return NULL;
    shape **place = find_place(type);
    if (*place != NULL)
        return *place; /* it may be incomplete, because types may contain themselves */
    shape *shape = PyMem_Calloc(1, sizeof *shape);
    if (shape == NULL) {
        PyErr_NoMemory();
        return NULL;
    }
    shape->type = type;
    shape->op = op_of(type);
    set_range(shape);
    *place = shape;
    table_used++;
    return fill(shape) ? shape : NULL;
}

/* ---------------------------------------------------------------- names */

/* Get the text of a name that is another object than the interned one, such as from json or a network. */
static bool is_text(PyObject *name, const char **text, size_t *length)
{
    Py_ssize_t count;
    if (!PyUnicode_Check(name))
        return false;
    *text = PyUnicode_AsUTF8AndSize(name, &count);
    if (*text == NULL) {
        PyErr_Clear(); /* an unpaired surrogate; names have none */
        return false;
    }
    *length = (size_t)count;
    return true;
}

static bool same(const char *name, const char *text, size_t length)
{
    return strncmp(name, text, length) == 0 && name[length] == 0;
}

Py_ssize_t slot_find(const shape *shape, PyObject *name, Py_ssize_t expected)
{
    const slot *slots = shape->slots;
    const char *text;
    size_t length;
    if (expected < shape->slots_count && slots[expected].key == name)
        return expected;
    for (Py_ssize_t index = 0; index < shape->slots_count; index++)
        if (slots[index].key == name)
            return index;
    if (!is_text(name, &text, &length))
        return -1;
    if (expected < shape->slots_count && same(slots[expected].field->name, text, length))
        return expected;
    for (Py_ssize_t index = 0; index < shape->slots_count; index++)
        if (same(slots[index].field->name, text, length))
            return index;
    return -1;
}

Py_ssize_t slot_find_attribute(const shape *shape, PyObject *name)
{
    for (Py_ssize_t index = 0; index < shape->slots_count; index++)
        if (shape->slots[index].attribute == name)
            return index;
    for (Py_ssize_t index = 0; index < shape->slots_count; index++)
        if (PyUnicode_Compare(shape->slots[index].attribute, name) == 0)
            return index;
    return slot_find(shape, name, 0);
}

Py_ssize_t item_find(const shape *shape, PyObject *name)
{
    const char *text;
    size_t length;
    for (Py_ssize_t index = 0; index < shape->type->names_count; index++)
        if (shape->names[index] == name)
            return index;
    if (!is_text(name, &text, &length))
        return -1;
    for (Py_ssize_t index = 0; index < shape->type->names_count; index++)
        if (same(shape->type->names[index].name, text, length))
            return index;
    return -1;
}

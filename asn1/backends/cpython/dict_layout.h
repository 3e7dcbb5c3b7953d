/* Memory layout of dicts with str keys, where it is known: Objects/dictobject.c and Include/internal/pycore_dict.h of CPython
 * 3.11, full API. It is checked once, at import. If it differs, dicts are made and read by the C API alone. */
#ifndef CAPTAIN_DICT_LAYOUT_H
#define CAPTAIN_DICT_LAYOUT_H

#include "compat.h"

#if !defined(Py_LIMITED_API) && PY_VERSION_HEX >= 0x030B0000 && PY_VERSION_HEX < 0x030C0000
#define MAY_KNOW_DICTS 1

/* Table of a dict: this head, the indices, and the entries in the order of insertion. A deleted entry has the value NULL. */
typedef struct keys_table {
    Py_ssize_t references;
    uint8_t log2_size, log2_index_octets, kind;
    uint32_t version;
    Py_ssize_t usable, count;
    char indices[];
} keys_table;

typedef struct entry {
    PyObject *key, *value;
} entry;

/* Dicts that share their keys (PEP 412) have one table of them, without values: where usable is 0 nothing is added to it, a dict
 * with a new key gets a table of its own. Their values lie in PyMem memory by the index of the key, NULL where one was deleted, and
 * in front of them, read backwards from ma_values: octets of this prefix, count, indices in the order of insertion. */
enum { OTHER_KEYS, STR_KEYS, SHARED_KEYS, MAX_SHARED = 30 };

static inline keys_table *table_of(PyObject *dict)
{
    return (keys_table *)(void *)((PyDictObject *)dict)->ma_keys;
}

static inline PyObject **values_of(PyObject *dict)
{
    return (PyObject **)(void *)((PyDictObject *)dict)->ma_values;
}

/* Return the size of the prefix for so many keys. */
static inline size_t prefix_octets(size_t count)
{
    return (count + 2 + sizeof(PyObject *) - 1) / sizeof(PyObject *) * sizeof(PyObject *);
}

static inline size_t entries_offset(const keys_table *table)
{
    return sizeof(keys_table) + ((size_t)1 << table->log2_index_octets);
}

static inline entry *entries_of(keys_table *table)
{
    return (entry *)(void *)((char *)table + entries_offset(table));
}
#endif

extern bool dicts_are_known;

/* Return false with an exception if memory is exhausted. */
bool dicts_look(void);

#endif

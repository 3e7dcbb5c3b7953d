/* Views: a message decoded to C, whose values become Python objects when they are touched. Every view of a message holds the
 * memory of the whole of it. */
#ifndef CAPTAIN_VIEW_H
#define CAPTAIN_VIEW_H

#include "memory.h"
#include "shapes.h"

/* Counted under the GIL. */
typedef struct storage {
    size_t holders;
    size_t room;   /* octets of `first` */
    struct storage *next; /* in the list of free ones */
    memory memory;
    _Alignas(max_align_t) unsigned char first[];
} storage;

typedef struct view {
    PyObject_HEAD
    const shape *shape;
    const unsigned char *value;
    storage *storage; /* held */
} view;

/* For a message of so many octets; holders is 1. NULL and an exception: no memory. */
storage *storage_new(const captain_type *type, size_t octets);
void storage_free(storage *storage);

static inline storage *storage_hold(storage *storage)
{
    storage->holders++;
    return storage;
}

static inline void storage_release(storage *storage)
{
    if (--storage->holders == 0)
        storage_free(storage);
}

/* A view of a SEQUENCE, CHOICE or list; holds the storage. */
PyObject *view_new(const shape *shape, const unsigned char *value, storage *storage);
/* A view where the value is a container, else what decode gives. */
PyObject *view_value(const shape *shape, const unsigned char *value, storage *storage);
/* NULL, without an exception: the object is no view. */
const view *view_check(PyObject *object);

bool views_add(PyObject *module);

/* Of all three classes (view_common.c). */
extern PyTypeObject *View, *RecordView, *ChoiceView, *ListView;
PyObject *view_compare(PyObject *left, PyObject *right, int operation);
PyObject *view_repr(PyObject *self);
PyObject *record_getattro(PyObject *self, PyObject *name);
PyObject *record_dir(PyObject *self, PyObject *unused);
PyObject *choice_choice(PyObject *self, void *unused);
PyObject *choice_value(PyObject *self, void *unused);
Py_ssize_t list_length(PyObject *self);
PyObject *list_item(PyObject *self, Py_ssize_t index);
PyObject *list_subscript(PyObject *self, PyObject *key);

#endif

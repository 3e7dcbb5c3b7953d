/* Views: a message decoded to C, whose values become Python objects when they are touched. Every view of a message holds the
 * memory of the whole of it. */
#ifndef CAPTAIN_VIEW_H
#define CAPTAIN_VIEW_H

#include "decode.h"
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
storage *storage_new(const captain_message *message, size_t octets);
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

/* Spare views keep their class, so that a new one costs a few stores. */
enum { VIEWS_KEPT = 64 };
typedef struct view_class {
    PyTypeObject *class;
    int spare_count;
    view *spare[VIEWS_KEPT];
} view_class;
extern view_class view_classes[]; /* by op: OP_SEQUENCE, OP_CHOICE, OP_LIST */

view *view_allocate(view_class *class);

static inline PyObject *view_of(view_class *class, const shape *shape, const unsigned char *value, storage *storage)
{
    view *new;
    if (class->spare_count > 0) {
        new = class->spare[--class->spare_count];
        Py_SET_REFCNT(new, 1);
    } else if ((new = view_allocate(class)) == NULL) {
        return NULL;
    }
    new->shape = shape;
    new->value = value;
    new->storage = storage_hold(storage);
    return (PyObject *)new;
}

/* A view of a SEQUENCE, CHOICE or list; holds the storage. */
static inline PyObject *view_new(const shape *shape, const unsigned char *value, storage *storage)
{
    return view_of(&view_classes[shape->op - OP_SEQUENCE], shape, value, storage);
}

/* What an open type holds: a view, what decode gives, or octets. */
PyObject *view_open(const shape *shape, const unsigned char *value, storage *storage);

/* A view where the value is a container, else what decode gives. */
static inline PyObject *view_value(const shape *shape, const unsigned char *value, storage *storage)
{
    if (shape->op < OP_SEQUENCE)
        return quick_value(shape, value);
    return shape->op == OP_OPEN ? view_open(shape, value, storage) : view_new(shape, value, storage);
}

/* NULL, without an exception: the object is no view. */
const view *view_check(PyObject *object);

bool views_add(PyObject *module);

extern PyTypeObject *View;    /* the base of all three */
extern PyObject *value_name;  /* interned "value" */

/* What they answer (view_access.c). */
PyObject *view_compare(PyObject *left, PyObject *right, int operation);
PyObject *view_repr(PyObject *self);
PyObject *record_getattro(PyObject *self, PyObject *name);
PyObject *record_dir(PyObject *self, PyObject *unused);
PyObject *choice_getattro(PyObject *self, PyObject *name);
PyObject *choice_choice(PyObject *self, void *unused);
PyObject *choice_value(PyObject *self, void *unused);
Py_ssize_t list_length(PyObject *self);
PyObject *list_item(PyObject *self, Py_ssize_t index);
PyObject *list_subscript(PyObject *self, PyObject *key);

#endif

/* Views: a message decoded to C, whose values become Python objects on access. Every view holds a reference to the memory of
 * its whole message. */
#ifndef CAPTAIN_VIEW_H
#define CAPTAIN_VIEW_H

#include "decode.h"
#include "memory.h"
#include "shapes.h"

/* References are counted under the GIL. */
typedef struct storage {
    size_t holders;
    size_t room;   /* size of `first` in octets */
    struct storage *next; /* next one in the list of free storages */
    memory memory;
    _Alignas(max_align_t) unsigned char first[];
} storage;

typedef struct view {
    PyObject_HEAD
    const shape *shape;
    const unsigned char *value;
    storage *storage; /* held */
} view;

/* Return storage for a message of so many octets, with one holder. NULL with an exception if memory is exhausted. */
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

/* Unused views keep their class, so that a new view costs only a few stores. */
enum { VIEWS_KEPT = 64 };
typedef struct view_class {
    PyTypeObject *class;
    int spare_count;
    view *spare[VIEWS_KEPT];
} view_class;
extern view_class view_classes[]; /* index: OP_SEQUENCE, OP_CHOICE, OP_LIST */

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

/* Return a view of a SEQUENCE, CHOICE or list. It holds the storage. */
static inline PyObject *view_new(const shape *shape, const unsigned char *value, storage *storage)
{
    return view_of(&view_classes[shape->op - OP_SEQUENCE], shape, value, storage);
}

/* Return the contents of an open type: a view, a decoded value, or octets. */
PyObject *view_open(const shape *shape, const unsigned char *value, storage *storage);

/* Return a view of a container; of other types the decoded value. */
static inline PyObject *view_value(const shape *shape, const unsigned char *value, storage *storage)
{
    if (shape->op < OP_SEQUENCE)
        return quick_value(shape, value);
    return shape->op == OP_OPEN ? view_open(shape, value, storage) : view_new(shape, value, storage);
}

/* Return the view; NULL, without an exception, for another object. */
const view *view_check(PyObject *object);

bool views_add(PyObject *module);

extern PyTypeObject *View;    /* base class of all three */
extern PyObject *value_name;  /* interned "value" */

/* Slots and methods of views (view_access.c). */
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

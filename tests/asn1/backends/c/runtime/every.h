/* Types of every kind with their tables, written by hand: the walkers are tested without the generator. */
#ifndef EVERY_H
#define EVERY_H

#include <captain/runtime.h>

/* Each field's type of Every, and Every itself, by name; NULL: there is none. */
const captain_type *every_find(const char *name);

#endif

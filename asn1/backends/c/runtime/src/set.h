/* Fields that are set by name: state of captain_set. This header is internal. */
#ifndef CAPTAIN_SET_H
#define CAPTAIN_SET_H

#include "place.h"

#pragma GCC visibility push(hidden)

typedef struct setting {
    const char *text; /* the new value */
    captain_filling filling;
    captain_report *report;
    captain_path path; /* of the value that is reached */
} setting;

/* Set the value at the end of the path. unit: of the component, or NULL for that of its type. */
captain_status captain_set_value(setting *in, const captain_type *type, const char *unit, void *value);
/* Refuse an unknown short name, and report paths whose last components have this name. */
captain_status captain_set_unknown(setting *in, const captain_message *message, const char *name);

#pragma GCC visibility pop

#endif

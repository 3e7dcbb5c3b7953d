/* Message: one PDU of one edition, with its methods. */
#ifndef CAPTAIN_MESSAGE_H
#define CAPTAIN_MESSAGE_H

#include "encode.h"
#include "memory.h"
#include "octets.h"
#include "shapes.h"

/* Octets on the stack of a call. Nearly every message is decoded, and every dict encoded, without malloc. */
enum { SCRATCH = 8192 };
/* Larger messages (octets) are decoded and encoded without the GIL. Releasing it costs 0.1 us. */
enum { LARGE = 4096 };

enum { MEMBERS = 12 };

typedef struct message {
    PyObject_HEAD
    const captain_message *message;
    const shape *shape;        /* shape of the PDU */
#ifdef CAPTAIN_ROS2
    const struct captain_ros2 *ros2; /* entry of the first profile with this message, or NULL */
#endif
    PyObject *members[MEMBERS]; /* name, type, ... : see message.c */
} message;

static inline const message *message_of(PyObject *self)
{
    return (const message *)(const void *)self;
}

bool messages_add(PyObject *module); /* messages.c */

/* A decoded message during a call. */
typedef struct decoded {
    const captain_type *type;
    octets octets;
    memory memory;
    void *value;
    _Alignas(max_align_t) unsigned char first[SCRATCH];
} decoded;

/* Return false with DecodeError, TypeError or MemoryError; then nothing must be closed. */
bool decoded_open(decoded *decoded, const captain_message *message, PyObject *source);
void decoded_close(decoded *decoded);
/* Decode, without the GIL for large messages. */
captain_status decode_octets(const captain_type *type, void *value, const octets *octets, captain_arena *arena);

/* Encode a value in memory to bytes; NULL with EncodeError. */
PyObject *encoded(const captain_type *type, const void *value);

/* Methods, defined in message.c, reader.c, describe.c, tree.c and example.c. */
PyObject *message_decode(PyObject *self, PyObject *source);
PyObject *message_view(PyObject *self, PyObject *source);
PyObject *message_reader(PyObject *self, PyObject *paths);
PyObject *message_encode(PyObject *self, PyObject *value);
PyObject *message_validate(PyObject *self, PyObject *value);
PyObject *message_to_json(PyObject *self, PyObject *const *arguments, Py_ssize_t count, PyObject *names);
PyObject *message_from_json(PyObject *self, PyObject *const *arguments, Py_ssize_t count, PyObject *names);
PyObject *message_text(PyObject *self, PyObject *source);
PyObject *message_leaves(PyObject *self, PyObject *source);
PyObject *message_explain(PyObject *self, PyObject *source);
PyObject *message_type_tree(PyObject *self, PyObject *unused);
PyObject *message_example(PyObject *self, PyObject *arguments, PyObject *fields);
PyObject *message_short_names(PyObject *self, void *unused);
bool readers_add(void);
bool describe_add(PyObject *module);
bool tree_add(PyObject *module);

#endif

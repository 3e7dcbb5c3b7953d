/* Values in memory as serialised ROS 2 messages, and back: the octets that rclpy's raw publishers and subscriptions carry (XCDR1, little
 * endian, final types, behind the four octets of the encapsulation). One captain_ros2 stands for one PDU in the messages of one profile.
 *
 * As in runtime.h: memory is the caller's, nothing here calls malloc or holds state.
 */
#ifndef CAPTAIN_ROS2_H
#define CAPTAIN_ROS2_H

#include <captain/runtime.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct captain_cdr_writer captain_cdr_writer;
typedef struct captain_cdr_reader captain_cdr_reader;

typedef struct captain_ros2 {
    const char *message;  /* "cam-1.4.1": captain_message.name */
    const char *profile;  /* "etsi_its" */
    const char *type;     /* "etsi_its_cam_msgs/msg/CAM" */
    const captain_type *pdu;
    size_t (*write)(captain_cdr_writer *writer, size_t at, const void *value);
    size_t (*read)(captain_cdr_reader *reader, size_t at, void *value);
    uint32_t arena;       /* reading takes at most so many octets from the arena for each octet of the CDR, whatever it is */
} captain_ros2;

/* Every one of this library, by message and profile. */
extern const captain_ros2 *const captain_ros2_messages[];
extern const size_t captain_ros2_messages_count;
/* NULL: none. */
const captain_ros2 *captain_find_ros2(const char *message, const char *profile);

/* A value of any PDU that takes more octets than this, with its encapsulation, is refused both ways (CAPTAIN_LENGTH): what is absent
 * takes octets in CDR, so that a short message with a long list in it could become any size. */
enum { CAPTAIN_CDR_MAX = 1 << 24 };

/* cdr: memory that the value does not point into, as one that was read from CDR points into that.
 * octets: how many were written. With CAPTAIN_NO_SPACE it is how many the value takes, and what the buffer holds is nothing.
 * left_out: how many parts of the value have no place in the ROS message; captain_cdr_left_out tells which. */
captain_status captain_to_cdr(const captain_ros2 *ros2, const void *value, void *cdr, size_t size, size_t *octets, size_t *left_out);

/* value: pdu->size octets; need not be cleared. Strings in it point into cdr. report, which may be NULL, has the names of the ROS message in
 * its path, eight times the offset of the octet in `bit`, and the value and what is allowed in its text. What is read is what captain_encode
 * takes. With takes_unknown it may be more, which only captain_to_cdr takes, to write the same CDR again: a choice or item that has no
 * number in the ROS message, as captain_to_cdr has written it. */
captain_status captain_from_cdr(const captain_ros2 *ros2, void *value, const void *cdr, size_t size, bool takes_unknown,
                                captain_arena *arena, captain_report *report);

/* What the ROS message has no place for: an extension addition that no edition knows, an alternative or item likewise, a component without
 * a field (regional extensions), a number outside of the field's type (the field holds the nearest), a text with a zero in it, where
 * readers of ROS end it. type is NULL for an addition, and value its captain_addition; else value points to a value of the type. Strings
 * are valid only during the call; false ends it. cdr: the octets that captain_to_cdr has written of this value, which are written once more. */
typedef bool (*captain_on_left_out)(void *context, const char *path, const captain_type *type, const void *value);
void captain_cdr_left_out(const captain_ros2 *ros2, const void *value, void *cdr, size_t octets,
                          captain_on_left_out on_left_out, void *context);

#ifdef __cplusplus
}
#endif
#endif

/* Conversion of values in memory to serialised ROS 2 messages, and back. The format is that of rclpy's raw publishers and
 * subscriptions: XCDR1, little endian, final types, after four octets of encapsulation. A captain_ros2 describes one PDU in one
 * profile.
 *
 * As in runtime.h, the caller provides memory, and no function calls malloc or has global state. */
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
    uint32_t arena;       /* most arena octets that reading takes per octet of CDR */
} captain_ros2;

/* All entries of this library, by message and profile. */
extern const captain_ros2 *const captain_ros2_messages[];
extern const size_t captain_ros2_messages_count;
/* Return NULL if not found. */
const captain_ros2 *captain_find_ros2(const char *message, const char *profile);

/* Limit for a serialised message in octets, with its encapsulation; larger ones give CAPTAIN_LENGTH in both directions. Absent
 * components take octets in CDR, so a short message with a long list could otherwise become arbitrarily large. */
enum { CAPTAIN_CDR_MAX = 1 << 24 };

/* cdr: must not overlap memory that the value points into; a value from captain_from_cdr points into its CDR. octets: number of
 * octets written; with CAPTAIN_NO_SPACE it is the required number, and the contents of the buffer are undefined. left_out:
 * number of parts of the value without a place in the ROS message; captain_cdr_left_out lists them. */
captain_status captain_to_cdr(const captain_ros2 *ros2, const void *value, void *cdr, size_t size, size_t *octets, size_t *left_out);

/* value: pdu->size octets, which need not be cleared. Its strings point into cdr. report may be NULL; its path has the names of
 * the ROS message, `bit` is eight times the octet's offset, and the text has value and range. The value can be encoded by
 * captain_encode. With takes_unknown, choices and items without a number in the ROS message are accepted as well, in the form
 * that captain_to_cdr writes; only captain_to_cdr accepts such a value, to write the same CDR again. */
captain_status captain_from_cdr(const captain_ros2 *ros2, void *value, const void *cdr, size_t size, bool takes_unknown,
                                captain_arena *arena, captain_report *report);

/* Report the parts without a place in the ROS message: an unknown extension addition, alternative or item; a component without
 * a field (regional extensions); a number outside the field's type (the field has the nearest one); a text with a zero octet,
 * where ROS ends it. For an addition, type is NULL and value its captain_addition; otherwise value points to a value of the
 * type. Strings are valid only during the call. If on_left_out returns false, the walk ends. cdr: the octets that
 * captain_to_cdr wrote for this value; they are written again. */
typedef bool (*captain_on_left_out)(void *context, const char *path, const captain_type *type, const void *value);
void captain_cdr_left_out(const captain_ros2 *ros2, const void *value, void *cdr, size_t octets,
                          captain_on_left_out on_left_out, void *context);

#ifdef __cplusplus
}
#endif
#endif

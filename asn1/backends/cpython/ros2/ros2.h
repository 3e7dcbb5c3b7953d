/* Methods to_cdr and from_cdr of Message, in modules that are generated with ROS 2 (CAPTAIN_ROS2). */
#ifndef CAPTAIN_PYTHON_ROS2_H
#define CAPTAIN_PYTHON_ROS2_H

#include "message.h"

bool ros2_add(PyObject *module);

PyObject *message_to_cdr(PyObject *self, PyObject *const *arguments, Py_ssize_t count, PyObject *names);
PyObject *message_from_cdr(PyObject *self, PyObject *const *arguments, Py_ssize_t count, PyObject *names);
PyObject *message_ros2_type(PyObject *self, PyObject *const *arguments, Py_ssize_t count, PyObject *names);

#define ROS2_METHOD(function) (PyCFunction)(void (*)(void))function, METH_FASTCALL | METH_KEYWORDS
#define ROS2_METHODS                                                                                                             \
    {"to_cdr", ROS2_METHOD(message_to_cdr),                                                                                      \
     "Octets to a serialised ROS 2 message, and what that has no place for. Raises DecodeError."},                               \
    {"from_cdr", ROS2_METHOD(message_from_cdr), "A serialised ROS 2 message to octets. Raises CdrError."},                       \
    {"ros2_type", ROS2_METHOD(message_ros2_type), "Name of the ROS 2 message: 'etsi_its_cam_msgs/msg/CAM'. Raises LookupError."},

#endif

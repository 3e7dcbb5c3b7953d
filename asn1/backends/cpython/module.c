/* Module captain_messages. Each file adds its own functions and classes. */
#include "dict_layout.h"
#include "errors.h"
#include "message.h"
#include "view.h"

#ifdef CAPTAIN_ROS2
#include "ros2.h"
#else
#define ros2_add(module) true
#endif

/* Defined in src/ros2_plan.c, which is generated with the messages. */
extern const unsigned char captain_ros2_plan[];
extern const size_t captain_ros2_plan_octets;

static PyObject *ros2_plan(PyObject *module, PyObject *nothing)
{
    (void)module, (void)nothing;
    return PyBytes_FromStringAndSize((const char *)captain_ros2_plan, (Py_ssize_t)captain_ros2_plan_octets);
}

static PyMethodDef FUNCTIONS[] = {
    {"ros2_plan", ros2_plan, METH_NOARGS, "The messages as those of ROS 2, for a program that records them: asn1/backends/ros2/plan.py."},
    {0},
};

static struct PyModuleDef MODULE = {
    PyModuleDef_HEAD_INIT,
    .m_name = "captain_messages",
    .m_doc = "ETSI ITS messages: encode, decode, validate, inspect.",
    .m_size = -1,
    .m_methods = FUNCTIONS,
};

PyMODINIT_FUNC PyInit_captain_messages(void)
{
    PyObject *module = PyModule_Create(&MODULE);
    if (module != NULL
        && !(dicts_look() && integers_keep() && errors_add(module) && views_add(module) && readers_add() && describe_add(module) && tree_add(module)
             && messages_add(module) && ros2_add(module)))
        Py_CLEAR(module);
    return module;
}

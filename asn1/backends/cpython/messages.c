/* Class Message, and the list of all messages. */
#include "errors.h"
#include "message.h"
#include "walk.h"

#ifdef CAPTAIN_ROS2
#include "ros2.h"
#include <captain/ros2.h>
#include <string.h>
#else
#define ROS2_METHODS
#endif

static PyMethodDef METHODS[] = {
    {"decode", message_decode, METH_O, "Octets to a dict. Raises DecodeError."},
    {"view", message_view, METH_O, "Octets to a view, whose values are made when they are touched. Raises DecodeError."},
    {"reader", message_reader, METH_VARARGS, "Paths to a function from octets, or a view, to a tuple of the values there. Raises ValueError."},
    {"encode", message_encode, METH_O, "A dict or view to octets. Raises EncodeError."},
    {"validate", message_validate, METH_O, "Every constraint of the standard on a dict, view or octets. Raises ValidateError."},
    {"to_json", (PyCFunction)(void (*)(void))message_to_json, METH_FASTCALL | METH_KEYWORDS, "Octets to JSON (X.697), or to the plain dialect. Raises DecodeError."},
    {"from_json", (PyCFunction)(void (*)(void))message_from_json, METH_FASTCALL | METH_KEYWORDS, "JSON (X.697), or of the plain dialect, to octets. Raises EncodeError."},
    {"text", message_text, METH_O, "Octets to an indented tree with units and meanings. Raises DecodeError."},
    {"leaves", message_leaves, METH_O, "Return the values as octets without field names, and the number of unknown parts. Raises DecodeError."},
    {"explain", message_explain, METH_O, "Octets to a list of Step, bit by bit, as far as they decode."},
    {"type_tree", message_type_tree, METH_NOARGS, "The PDU's Type."},
    {"example", (PyCFunction)(void (*)(void))message_example, METH_VARARGS | METH_KEYWORDS,
     "Return a legal message with some fields, by short name or path, as a dict. Raises EncodeError, ValidateError."},
    ROS2_METHODS
    {0},
};

#define MEMBER(index, name) {name, T_OBJECT, (Py_ssize_t)(offsetof(message, members) + (index) * sizeof(PyObject *)), READONLY, NULL}
static PyMemberDef ATTRIBUTES[] = {
    MEMBER(0, "name"), MEMBER(1, "type"), MEMBER(2, "release"), MEMBER(3, "standard"), MEMBER(4, "module"), MEMBER(5, "pdu"),
    MEMBER(6, "ids"), MEMBER(7, "versions"), MEMBER(8, "btp_port"), MEMBER(9, "rank"), MEMBER(10, "is_experimental"), MEMBER(11, "form_of"),
    {0},
};

static PyGetSetDef COMPUTED[] = {
    {"short_names", message_short_names, NULL, "Paths by short name.", NULL},
    {0},
};

static PyObject *message_repr(PyObject *self)
{
    return PyUnicode_FromFormat("<message %s of %s>", message_of(self)->message->name, message_of(self)->message->standard);
}

static void message_dealloc(PyObject *self)
{
    PyTypeObject *class = Py_TYPE(self);
    for (int index = 0; index < MEMBERS; index++)
        Py_XDECREF(((message *)self)->members[index]);
    PyObject_Free(self);
    Py_DECREF(class);
}

static PyType_Slot SLOTS[] = {{Py_tp_dealloc, message_dealloc}, {Py_tp_repr, message_repr}, {Py_tp_methods, METHODS},
                              {Py_tp_members, ATTRIBUTES}, {Py_tp_getset, COMPUTED},
                              {Py_tp_doc, "One PDU of one edition of a standard."}, {0}};
static PyType_Spec SPEC = {.name = "captain_messages.Message", .basicsize = (int)sizeof(message),
                           .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_IMMUTABLETYPE | Py_TPFLAGS_DISALLOW_INSTANTIATION,
                           .slots = SLOTS};

static PyObject *numbers(const uint8_t *list, uint8_t count)
{
    PyObject *tuple = PyTuple_New(count);
    for (uint8_t index = 0; tuple != NULL && index < count; index++)
        TUPLE_SET(tuple, index, PyLong_FromLong(list[index]));
    return tuple;
}

static PyObject *message_new(PyTypeObject *class, const captain_message *description)
{
    message *new = PyObject_New(message, class);
    if (new == NULL)
        return NULL;
    PyObject *const members[MEMBERS] = {
        PyUnicode_InternFromString(description->name), PyUnicode_InternFromString(description->type),
        PyLong_FromLong(description->release), PyUnicode_FromString(description->standard),
        PyUnicode_FromString(description->module), PyUnicode_FromString(captain_type_text(description->pdu)),
        numbers(description->ids, description->ids_count), numbers(description->versions, description->versions_count),
        PyLong_FromLong(description->btp_port), PyLong_FromLong(description->rank), PyBool_FromLong(description->is_experimental),
        PyUnicode_InternFromString(description->form_of == NULL ? "" : description->form_of),
    };
    bool is_good = true;
    for (int index = 0; index < MEMBERS; index++) {
        new->members[index] = members[index];
        is_good = is_good && members[index] != NULL;
    }
    new->message = description;
#ifdef CAPTAIN_ROS2
    new->ros2 = NULL;
    for (size_t index = captain_ros2_messages_count; index-- > 0;)
        if (strcmp(captain_ros2_messages[index]->message, description->name) == 0)
            new->ros2 = captain_ros2_messages[index];
#endif
    new->shape = is_good ? shape_of(description->pdu) : NULL;
    if (new->shape == NULL)
        Py_CLEAR(new);
    return (PyObject *)new;
}

/* ---------------------------------------------------------------- all of them */

static PyObject *messages; /* tuple, in the order of captain_messages */

static PyObject *module_all(PyObject *module, PyObject *unused)
{
    (void)module, (void)unused;
    return Py_NewRef(messages);
}

static PyObject *no_message(PyObject *name)
{
    PyObject *there = PyUnicode_FromString("");
    for (size_t index = 0; there != NULL && index < captain_messages_count; index++) {
        PyObject *more = PyUnicode_FromFormat(index == 0 ? "%U%s" : "%U, %s", there, captain_messages[index]->name);
        Py_DECREF(there);
        there = more;
    }
    PyObject *text = there == NULL ? NULL : PyUnicode_FromFormat("no message %R; there is %U", name, there);
    if (text != NULL)
        PyErr_SetObject(PyExc_KeyError, text);
    Py_XDECREF(there);
    Py_XDECREF(text);
    return NULL;
}

static PyObject *module_find(PyObject *module, PyObject *name)
{
    (void)module;
    const char *text = PyUnicode_Check(name) ? PyUnicode_AsUTF8AndSize(name, NULL) : NULL;
    if (text == NULL && !PyErr_Occurred())
        PyErr_SetString(PyExc_TypeError, "the name of a message is a str");
    if (text == NULL)
        return NULL;
    const captain_message *found = captain_find_message(text);
    for (size_t index = 0; found != NULL && index < captain_messages_count; index++)
        if (captain_messages[index] == found)
            return Py_NewRef(TUPLE_ITEM(messages, (Py_ssize_t)index));
    return no_message(name);
}

static PyObject *module_example(PyObject *module, PyObject *arguments, PyObject *fields)
{
    if (TUPLE_COUNT(arguments) != 1) {
        PyErr_SetString(PyExc_TypeError, "an example has one name, and its fields as keywords: example('cam', speed=13.9)");
        return NULL;
    }
    PyObject *found = module_find(module, TUPLE_ITEM(arguments, 0)), *none = PyTuple_New(0);
    PyObject *dict = found == NULL || none == NULL ? NULL : message_example(found, none, fields);
    Py_XDECREF(found);
    Py_XDECREF(none);
    return dict;
}

static PyMethodDef FUNCTIONS[] = {
    {"all", module_all, METH_NOARGS, "Every message of the library, by type and rank."},
    {"find", module_find, METH_O, "The message of a name: 'cam-1.4.1', or 'cam' for the preferred edition. Raises KeyError."},
    {"example", (PyCFunction)(void (*)(void))module_example, METH_VARARGS | METH_KEYWORDS,
     "The example of the message of a name, see Message.example. Raises KeyError, EncodeError, ValidateError."},
    {0},
};

bool messages_add(PyObject *module)
{
    PyObject *class = PyType_FromSpec(&SPEC);
    if (class == NULL || PyModule_AddObjectRef(module, "Message", class) < 0 || PyModule_AddFunctions(module, FUNCTIONS) < 0)
        return false;
    messages = PyTuple_New((Py_ssize_t)captain_messages_count);
    for (size_t index = 0; messages != NULL && index < captain_messages_count; index++) {
        PyObject *new = message_new((PyTypeObject *)class, captain_messages[index]);
        if (new == NULL)
            Py_CLEAR(messages);
        else
            TUPLE_SET(messages, (Py_ssize_t)index, new);
    }
    return messages != NULL;
}

/* Attributes, elements and comparisons of views. */
#include "view.h"
#include "decode.h"
#include "errors.h"
#include "walk.h"

static const view *of(PyObject *self)
{
    return (const view *)(const void *)self;
}

/* ---------------------------------------------------------------- SEQUENCE */

static NEVER_INLINE PyObject *component(const view *view, const slot *slot)
{
    if (slot_is_absent(slot, view->value))
        return slot->has_default ? view_value(slot->shape, slot->field->default_value, view->storage) : Py_NewRef(Py_None);
    return view_value(slot->shape, slot_value(slot, view->value), view->storage);
}

/* Handle names that are not interned, methods, and unknown names. */
static NEVER_INLINE PyObject *other_attribute(PyObject *self, PyObject *name)
{
    const shape *shape = of(self)->shape;
    Py_ssize_t index = slot_find_attribute(shape, name);
    if (index >= 0)
        return component(of(self), &shape->slots[index]);
    PyObject *value = PyObject_GenericGetAttr(self, name);
    if (value != NULL || !PyErr_ExceptionMatches(PyExc_AttributeError))
        return value;
    PyErr_Clear();
    PyObject *nearest = suggestion(shape->type, name);
    if (nearest != NULL)
        PyErr_Format(PyExc_AttributeError, "%s has no component '%U'%U", captain_type_text(shape->type), name, nearest);
    Py_XDECREF(nearest);
    return NULL;
}

static NEVER_INLINE PyObject *record_view(const shape *shape, const unsigned char *value, storage *storage)
{
    return view_of(&view_classes[0], shape, value, storage);
}

/* Fast path, with the most frequent kinds inline. */
PyObject *record_getattro(PyObject *self, PyObject *name)
{
    const view *view = of(self);
    const slot *slot = view->shape->slots;
    for (PyObject *const *attribute = view->shape->attributes; *attribute != name; attribute++, slot++)
        if (*attribute == NULL)
            return other_attribute(self, name);
    if (!slot->is_plain)
        return component(view, slot);
    const unsigned char *value = view->value + slot->offset;
    switch (slot->op) {
    case OP_U8:
        return PyLong_FromLong(*value);
    case OP_U16:
        return PyLong_FromLong(AT(uint16_t, value));
    case OP_I32:
        return PyLong_FromLong(AT(int32_t, value));
    case OP_U32:
        return PyLong_FromUnsignedLong(AT(uint32_t, value));
    case OP_SEQUENCE:
        return record_view(slot->shape, value, view->storage);
    default:
        return view_value(slot->shape, value, view->storage);
    }
}

static PyObject *names_of(const shape *shape)
{
    PyObject *names = PyList_New(shape->slots_count);
    for (uint16_t index = 0; names != NULL && index < shape->slots_count; index++)
        LIST_SET(names, index, Py_NewRef(shape->slots[index].attribute));
    return names;
}

PyObject *record_dir(PyObject *self, PyObject *unused)
{
    (void)unused;
    PyObject *names = names_of(of(self)->shape);
    PyObject *methods = names == NULL ? NULL : PyObject_Dir((PyObject *)View);
    PyObject *both = methods == NULL ? NULL : PySequence_Concat(names, methods);
    Py_XDECREF(names);
    Py_XDECREF(methods);
    return both;
}

/* ---------------------------------------------------------------- CHOICE */

PyObject *choice_choice(PyObject *self, void *unused)
{
    (void)unused;
    return choice_name(of(self)->shape, AT(uint32_t, of(self)->value));
}

PyObject *choice_value(PyObject *self, void *unused)
{
    (void)unused;
    const view *view = of(self);
    const shape *shape = view->shape;
    uint32_t choice = AT(uint32_t, view->value);
    if (choice >= CAPTAIN_UNKNOWN)
        return octets_value(AT(captain_octets, view->value + union_offset(shape->type)));
    if (choice == 0 || choice > shape->slots_count)
        return choice_name(shape, choice);
    const slot *slot = &shape->slots[choice - 1];
    return view_value(slot->shape, slot_value(slot, view->value), view->storage);
}

/* Handle the chosen alternative, methods, and unknown names. */
static NEVER_INLINE PyObject *choice_other(PyObject *self, PyObject *name)
{
    PyObject *value = PyObject_GenericGetAttr(self, name);
    if (value != NULL || !PyErr_ExceptionMatches(PyExc_AttributeError))
        return value;
    PyErr_Clear();
    const shape *shape = of(self)->shape;
    uint32_t choice = AT(uint32_t, of(self)->value);
    Py_ssize_t index = slot_find_attribute(shape, name);
    if (index >= 0 && (uint32_t)index + 1 == choice)
        return choice_value(self, NULL);
    PyObject *chosen = choice_name(shape, choice);
    if (chosen != NULL)
        PyErr_Format(PyExc_AttributeError, "%s: the alternative is '%U', not '%U'; .value is its value",
                     captain_type_text(shape->type), chosen, name);
    Py_XDECREF(chosen);
    return NULL;
}

/* A lookup in the class's table of attributes would cost 20 ns more. */
PyObject *choice_getattro(PyObject *self, PyObject *name)
{
    return name == value_name ? choice_value(self, NULL) : choice_other(self, name);
}

/* ---------------------------------------------------------------- SEQUENCE OF */

Py_ssize_t list_length(PyObject *self)
{
    return (Py_ssize_t)AT(captain_list, of(self)->value).count;
}

PyObject *list_item(PyObject *self, Py_ssize_t index)
{
    const captain_list *list = &AT(captain_list, of(self)->value);
    const shape *element = of(self)->shape->element;
    if (index < 0 || (size_t)index >= list->count) {
        PyErr_Format(PyExc_IndexError, "element %zd of %u", index, (unsigned)list->count);
        return NULL;
    }
    return view_value(element, (const unsigned char *)list->items + (size_t)index * element->type->size, of(self)->storage);
}

static PyObject *list_slice(PyObject *self, PyObject *slice)
{
    Py_ssize_t start, stop, step;
    if (PySlice_Unpack(slice, &start, &stop, &step) < 0)
        return NULL;
    Py_ssize_t count = PySlice_AdjustIndices(list_length(self), &start, &stop, step);
    PyObject *items = PyList_New(count);
    for (Py_ssize_t index = 0; items != NULL && index < count; index++) {
        PyObject *item = list_item(self, start + index * step);
        if (item == NULL)
            Py_CLEAR(items);
        else
            LIST_SET(items, index, item);
    }
    return items;
}

PyObject *list_subscript(PyObject *self, PyObject *key)
{
    if (PySlice_Check(key))
        return list_slice(self, key);
    Py_ssize_t index = PyNumber_AsSsize_t(key, PyExc_IndexError);
    if (index == -1 && PyErr_Occurred())
        return NULL;
    return list_item(self, index < 0 ? index + list_length(self) : index);
}

/* ---------------------------------------------------------------- all */

PyObject *view_compare(PyObject *left, PyObject *right, int operation)
{
    const view *one = view_check(left), *other = view_check(right);
    if (one == NULL || other == NULL || (operation != Py_EQ && operation != Py_NE))
        return Py_NewRef(Py_NotImplemented);
    bool is_equal = one->shape == other->shape && captain_equal(one->shape->type, one->value, other->value);
    return PyBool_FromLong(is_equal == (operation == Py_EQ));
}

static PyObject *content(PyObject *self)
{
    const shape *shape = of(self)->shape;
    if (shape->op == OP_LIST)
        return PyUnicode_FromFormat("%zd elements", list_length(self));
    if (shape->op == OP_CHOICE)
        return choice_choice(self, NULL);
    PyObject *comma = PyUnicode_FromString(", "), *names = names_of(shape);
    PyObject *text = comma == NULL || names == NULL ? NULL : PyUnicode_Join(comma, names);
    Py_XDECREF(comma);
    Py_XDECREF(names);
    return text;
}

/* <view of CAM: header, cam> */
PyObject *view_repr(PyObject *self)
{
    PyObject *text = content(self);
    PyObject *whole = text == NULL ? NULL : PyUnicode_FromFormat("<view of %s: %U>", captain_type_text(of(self)->shape->type), text);
    Py_XDECREF(text);
    return whole;
}

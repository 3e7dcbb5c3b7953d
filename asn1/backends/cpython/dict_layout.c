#include "dict_layout.h"

bool dicts_are_known;

#ifdef MAY_KNOW_DICTS

enum { KEYS = 12 }; /* enough keys for the table of a dict to grow twice */

/* Check the assumed memory layout of a dict. The values of its `count` keys are the keys themselves. */
static bool is_as_believed(PyObject *dict, PyObject *const *keys, Py_ssize_t count)
{
    keys_table *table = table_of(dict);
    if (((PyDictObject *)dict)->ma_used != count || values_of(dict) != NULL || table->kind != STR_KEYS || table->references != 1
        || table->count != count || table->version != 0 || table->usable + table->count != ((Py_ssize_t)2 << table->log2_size) / 3)
        return false;
    for (Py_ssize_t index = 0; index < count; index++)
        if (entries_of(table)[index].key != keys[index] || entries_of(table)[index].value != keys[index])
            return false;
    return true;
}

/* Check the same for the __dict__ of an object, which shares its keys with its class. */
static bool is_shared_as_believed(PyObject *dict, PyObject *const *keys, Py_ssize_t count)
{
    keys_table *table = table_of(dict);
    PyObject **values = values_of(dict);
    Py_ssize_t room = table->count + table->usable;
    if (((PyDictObject *)dict)->ma_used != count || values == NULL || table->kind != SHARED_KEYS || table->count != count
        || room < count || room > MAX_SHARED)
        return false;
    const uint8_t *order = (const uint8_t *)values;
    if (order[-1] != prefix_octets((size_t)room) || order[-2] != count)
        return false;
    for (Py_ssize_t index = 0; index < count; index++)
        if (entries_of(table)[index].key != keys[index] || values[index] != keys[index] || order[-3 - index] != index)
            return false;
    return true;
}

static PyObject *object_with(PyObject *const *keys, Py_ssize_t count)
{
    PyObject *class = PyObject_CallFunction((PyObject *)&PyType_Type, "s(){}", "Sharing");
    PyObject *object = class == NULL ? NULL : PyObject_CallNoArgs(class);
    Py_XDECREF(class);
    for (Py_ssize_t index = 0; object != NULL && index < count; index++)
        if (PyObject_SetAttr(object, keys[index], keys[index]) < 0)
            Py_CLEAR(object);
    return object;
}

static bool look_at_shared(PyObject *const *keys)
{
    PyObject *object = object_with(keys, KEYS);
    PyObject *dict = object == NULL ? NULL : PyObject_GenericGetDict(object, NULL);
    dicts_are_known = dicts_are_known && dict != NULL && is_shared_as_believed(dict, keys, KEYS);
    Py_XDECREF(object);
    Py_XDECREF(dict);
    return dict != NULL;
}

bool dicts_look(void)
{
    PyObject *keys[KEYS], *dict = PyDict_New();
    bool is_good = dict != NULL;
    dicts_are_known = true;
    for (Py_ssize_t count = 0; count < KEYS; count++) {
        keys[count] = PyUnicode_FromFormat("key %zd", count);
        is_good = is_good && keys[count] != NULL && PyDict_SetItem(dict, keys[count], keys[count]) == 0;
        dicts_are_known = dicts_are_known && is_good && is_as_believed(dict, keys, count + 1);
    }
    is_good = is_good && look_at_shared(keys);
    for (Py_ssize_t count = 0; count < KEYS; count++)
        Py_XDECREF(keys[count]);
    Py_XDECREF(dict);
    return is_good;
}

#else

bool dicts_look(void)
{
    return true;
}

#endif

#include "dict_layout.h"

bool dicts_are_known;

#ifdef MAY_KNOW_DICTS

enum { KEYS = 12 }; /* the table grows twice on the way */

/* Whether a dict of `count` keys, whose values are the keys, lies in memory as believed. */
static bool is_as_believed(PyObject *dict, PyObject *const *keys, Py_ssize_t count)
{
    keys_table *table = table_of(dict);
    if (((PyDictObject *)dict)->ma_used != count || table == NULL || table->references != 1 || table->count != count
        || table->version != 0 || table->usable + table->count != ((Py_ssize_t)2 << table->log2_size) / 3)
        return false;
    for (Py_ssize_t index = 0; index < count; index++)
        if (entries_of(table)[index].key != keys[index] || entries_of(table)[index].value != keys[index])
            return false;
    return true;
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

/* Where the full C API of CPython (wheels for one version, faster) and the limited one (abi3 wheels, built with
 * -DPy_LIMITED_API=0x030A0000) differ. Everything else in this folder is written for both. */
#ifndef CAPTAIN_COMPAT_H
#define CAPTAIN_COMPAT_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <structmember.h>

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef Py_LIMITED_API
#define LIST_ITEM(list, index) PyList_GetItem(list, index)
#define LIST_COUNT(list) PyList_Size(list)
#define LIST_SET(list, index, value) ((void)PyList_SetItem(list, index, value))
#define TUPLE_ITEM(tuple, index) PyTuple_GetItem(tuple, index)
#define TUPLE_COUNT(tuple) PyTuple_Size(tuple)
#define TUPLE_SET(tuple, index, value) ((void)PyTuple_SetItem(tuple, index, value))
#define DICT_NEW(count) PyDict_New()
#define DICT_SET(dict, key, hash, value) ((void)(hash), PyDict_SetItem(dict, key, value))
#define BYTES_DATA(bytes) PyBytes_AsString(bytes)
#define BYTES_COUNT(bytes) PyBytes_Size(bytes)
#else
#define LIST_ITEM(list, index) PyList_GET_ITEM(list, index)
#define LIST_COUNT(list) PyList_GET_SIZE(list)
#define LIST_SET(list, index, value) PyList_SET_ITEM(list, index, value)
#define TUPLE_ITEM(tuple, index) PyTuple_GET_ITEM(tuple, index)
#define TUPLE_COUNT(tuple) PyTuple_GET_SIZE(tuple)
#define TUPLE_SET(tuple, index, value) PyTuple_SET_ITEM(tuple, index, value)
#define DICT_NEW(count) _PyDict_NewPresized(count)
#define DICT_SET(dict, key, hash, value) _PyDict_SetItem_KnownHash(dict, key, value, hash)
#define BYTES_DATA(bytes) PyBytes_AS_STRING(bytes)
#define BYTES_COUNT(bytes) PyBytes_GET_SIZE(bytes)
#endif

/* The value of an int that fits one digit, without a call; false: ask the C API. */
static inline bool small_integer(PyObject *value, int64_t *number)
{
#if !defined(Py_LIMITED_API) && PY_VERSION_HEX < 0x030C0000
    if (Py_TYPE(value) != &PyLong_Type)
        return false;
    Py_ssize_t digits = Py_SIZE(value);
    if (digits < -1 || digits > 1)
        return false;
    *number = digits * (int64_t)((PyLongObject *)value)->ob_digit[0];
    return true;
#elif !defined(Py_LIMITED_API)
    if (Py_TYPE(value) != &PyLong_Type || !PyUnstable_Long_IsCompact((PyLongObject *)value))
        return false;
    *number = PyUnstable_Long_CompactValue((PyLongObject *)value);
    return true;
#else
    (void)value, (void)number;
    return false;
#endif
}

#endif

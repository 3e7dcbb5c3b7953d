/* Differences between CPython's full C API (wheels for one version, faster) and the limited one (abi3 wheels, built with
 * -DPy_LIMITED_API=0x030A0000). All other code in this folder works with both. */
#ifndef CAPTAIN_COMPAT_H
#define CAPTAIN_COMPAT_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <structmember.h>

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define ALWAYS_INLINE inline __attribute__((always_inline))
#define NEVER_INLINE __attribute__((noinline))
#else
#define ALWAYS_INLINE inline
#define NEVER_INLINE
#endif

#ifdef Py_LIMITED_API
#define LIST_ITEM(list, index) PyList_GetItem(list, index)
#define LIST_COUNT(list) PyList_Size(list)
#define LIST_SET(list, index, value) ((void)PyList_SetItem(list, index, value))
#define TUPLE_ITEM(tuple, index) PyTuple_GetItem(tuple, index)
#define TUPLE_COUNT(tuple) PyTuple_Size(tuple)
#define TUPLE_SET(tuple, index, value) ((void)PyTuple_SetItem(tuple, index, value))
#define BYTES_DATA(bytes) PyBytes_AsString(bytes)
#define BYTES_COUNT(bytes) PyBytes_Size(bytes)
#else
#define LIST_ITEM(list, index) PyList_GET_ITEM(list, index)
#define LIST_COUNT(list) PyList_GET_SIZE(list)
#define LIST_SET(list, index, value) PyList_SET_ITEM(list, index, value)
#define TUPLE_ITEM(tuple, index) PyTuple_GET_ITEM(tuple, index)
#define TUPLE_COUNT(tuple) PyTuple_GET_SIZE(tuple)
#define TUPLE_SET(tuple, index, value) PyTuple_SET_ITEM(tuple, index, value)
#define BYTES_DATA(bytes) PyBytes_AS_STRING(bytes)
#define BYTES_COUNT(bytes) PyBytes_GET_SIZE(bytes)
#endif

/* Read an int of one or two digits (60 bits) without a call; false if the C API is needed. */
static inline bool small_integer(PyObject *value, int64_t *number)
{
#if !defined(Py_LIMITED_API) && PY_VERSION_HEX < 0x030C0000
    if (Py_TYPE(value) != &PyLong_Type)
        return false;
    const digit *digits = ((PyLongObject *)value)->ob_digit;
    switch (Py_SIZE(value)) {
    case 0:
        *number = 0;
        return true;
    case 1:
        *number = digits[0];
        return true;
    case -1:
        *number = -(int64_t)digits[0];
        return true;
    case 2:
        *number = (int64_t)digits[0] | (int64_t)digits[1] << PyLong_SHIFT;
        return true;
    default:
        return false;
    }
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

/* Small ints that CPython caches but returns only by a call. integers_keep (integers.c) fills the table; it returns false and
 * sets an exception if memory is exhausted. */
enum { LEAST_KEPT = -5, INTEGERS_KEPT = 262 };
extern PyObject *integers[INTEGERS_KEPT];
bool integers_keep(void);

/* Return an int of at most 33 bits. */
static inline PyObject *new_integer(int64_t number)
{
    if ((uint64_t)(number - LEAST_KEPT) < INTEGERS_KEPT)
        return Py_NewRef(integers[number - LEAST_KEPT]);
#if !defined(Py_LIMITED_API) && !defined(Py_REF_DEBUG) && PY_VERSION_HEX >= 0x030B0000 && PY_VERSION_HEX < 0x030C0000
    int64_t magnitude = number < 0 ? -number : number;
    if (magnitude < PyLong_BASE) { /* one digit */
        PyLongObject *new = PyObject_Malloc(sizeof *new);
        if (new == NULL)
            return PyErr_NoMemory();
        Py_SET_TYPE(new, &PyLong_Type);
        Py_SET_SIZE(new, number < 0 ? -1 : 1);
        Py_SET_REFCNT(new, 1);
        new->ob_digit[0] = (digit)magnitude;
        return (PyObject *)new;
    }
#endif
    return PyLong_FromLongLong(number);
}

#endif

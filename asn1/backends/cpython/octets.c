#include "octets.h"

#ifdef Py_LIMITED_API

static bool has_holes(PyObject *view)
{
    PyObject *answer = PyObject_GetAttrString(view, "c_contiguous");
    if (answer == Py_False)
        PyErr_SetString(PyExc_BufferError, "octets with holes between them");
    Py_XDECREF(answer);
    return answer != Py_True;
}

bool octets_open_any(octets *octets, PyObject *source)
{
    PyObject *view = PyMemoryView_FromObject(source);
    octets->copy = view == NULL || has_holes(view) ? NULL : PyBytes_FromObject(view);
    Py_XDECREF(view);
    if (octets->copy == NULL)
        return false;
    octets->data = (const unsigned char *)PyBytes_AsString(octets->copy);
    octets->count = (size_t)PyBytes_Size(octets->copy);
    octets->is_constant = false;
    return true;
}

void octets_close_any(octets *octets)
{
    Py_DECREF(octets->copy);
}

#else

bool octets_open_any(octets *octets, PyObject *source)
{
    if (PyObject_GetBuffer(source, &octets->buffer, PyBUF_SIMPLE) < 0)
        return false;
    octets->data = octets->buffer.buf;
    octets->count = (size_t)octets->buffer.len;
    octets->is_constant = false;
    return true;
}

void octets_close_any(octets *octets)
{
    PyBuffer_Release(&octets->buffer);
}

#endif

#include "compat.h"

PyObject *integers[INTEGERS_KEPT];

bool integers_keep(void)
{
    for (long index = 0; index < INTEGERS_KEPT; index++)
        if ((integers[index] = PyLong_FromLong(LEAST_KEPT + index)) == NULL)
            return false;
    return true;
}

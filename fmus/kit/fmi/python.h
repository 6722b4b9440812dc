/* The part of Python's stable ABI that the Python engine uses, found at run time.
 *
 * Nothing here is linked: a library with undefined Python symbols cannot be loaded by a host without Python.
 */
#ifndef PYTHON_H
#define PYTHON_H

#ifndef _WIN32
#define _GNU_SOURCE /* for dladdr of glibc; before the first header of the system */
#endif

#include <stddef.h>

#include "engine.h"

typedef struct PyObject PyObject;

#define PYTHON_FUNCTIONS(X)                                               \
    X(int, Py_IsInitialized, (void))                                      \
    X(void *, PyEval_SaveThread, (void))                                  \
    X(int, PyGILState_Ensure, (void))                                     \
    X(void, PyGILState_Release, (int))                                    \
    X(PyObject *, Py_CompileString, (const char *, const char *, int))    \
    X(PyObject *, PyEval_EvalCode, (PyObject *, PyObject *, PyObject *))  \
    X(PyObject *, PyEval_GetBuiltins, (void))                             \
    X(PyObject *, Py_BuildValue, (const char *, ...))                     \
    X(PyObject *, PyDict_New, (void))                                     \
    X(void, PyDict_Clear, (PyObject *))                                   \
    X(PyObject *, PyDict_GetItemString, (PyObject *, const char *))       \
    X(int, PyDict_SetItemString, (PyObject *, const char *, PyObject *))  \
    X(PyObject *, PyMemoryView_FromMemory, (char *, ptrdiff_t, int))      \
    X(PyObject *, PyFloat_FromDouble, (double))                           \
    X(PyObject *, PyUnicode_FromString, (const char *))                   \
    X(PyObject *, PyUnicode_DecodeFSDefault, (const char *))              \
    X(PyObject *, PyUnicode_AsUTF8String, (PyObject *))                   \
    X(char *, PyBytes_AsString, (PyObject *))                             \
    X(PyObject *, PyObject_GetAttrString, (PyObject *, const char *))     \
    X(PyObject *, PyObject_CallFunctionObjArgs, (PyObject *, ...))        \
    X(PyObject *, PyObject_Str, (PyObject *))                             \
    X(void, PyErr_Fetch, (PyObject **, PyObject **, PyObject **))         \
    X(void, PyErr_Clear, (void))                                          \
    X(void, Py_IncRef, (PyObject *))                                      \
    X(void, Py_DecRef, (PyObject *))

/* PyStatus: what became of a start. The same since Python 3.8. */
typedef struct {
    int type; /* 0: fine */
    const char *function, *message;
    int exit_code;
} Outcome;

/* What starts an interpreter; a Python that runs already need not have it. */
#define PYTHON_STARTERS(X)                                                \
    X(void, PyConfig_InitIsolatedConfig, (void *))                        \
    X(Outcome, Py_InitializeFromConfig, (const void *))                   \
    X(void, PyConfig_Clear, (void *))                                     \
    X(wchar_t *, Py_DecodeLocale, (const char *, size_t *))               \
    X(void, Py_SetPythonHome, (const wchar_t *))                          \
    X(void, PyMem_RawFree, (void *))

#define PYTHON_FIELD(result, name, arguments) result(*name) arguments;
typedef struct {
    int minor; /* 11 is Python 3.11 */
    PYTHON_FUNCTIONS(PYTHON_FIELD)
    PYTHON_STARTERS(PYTHON_FIELD)
} Python;
#undef PYTHON_FIELD

/* Finds the Python of this process or brings one in, and sees to it that it is initialized. */
static bool python_find(Python *python, Message message);

/* Initializes Python unless that has been done; one thread of a process at a time. */
static bool python_start(const Python *python, Message message);

#endif

/* Starts the interpreter in a host that has none: once, and without regard to the environment of the host.
 *
 * Variables such as PYTHONHOME and PYTHONPATH, and the packages of the user, are meant for another Python: they would
 * end the host, or run what the FMU does not know of. PyConfig shuts them out. Its size and its fields differ from one
 * version of Python to the next, so nothing of it is named here: Python fills in a block that is large enough, with its
 * own defaults for an isolated interpreter. Where its standard library is, it is told through a function.
 */
#include "python.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CONFIG_SIZE = 16384 }; /* bytes; PyConfig has fewer than 600 from Python 3.11 to 3.14 */

#ifdef _WIN32
/* Here Python looks for its standard library beside its own. */
static char *home_of(const Python *python) {
    (void)python;
    return NULL;
}
#else
#include <dlfcn.h>
#include <unistd.h>

static bool is_home(const char *folder, int minor) {
    static const char *const names[] = {"lib", "lib64"};
    char path[4096];
    for (int i = 0; i < 2; i++) {
        int length = snprintf(path, sizeof path, "%s/%s/python3.%d/os.py", folder, names[i], minor);
        if (length > 0 && (size_t)length < sizeof path && access(path, R_OK) == 0)
            return true;
    }
    return false;
}

/* The folder above Python's library that its standard library is in, to be freed; NULL if there is none. Left to
   itself, Python would go by the program python3 in the search path of the host. */
static char *home_of(const Python *python) {
    void *address;
    Dl_info found;
    char *path;
    memcpy(&address, &python->Py_IsInitialized, sizeof address);
    path = dladdr(address, &found) == 0 || found.dli_fname == NULL ? NULL : realpath(found.dli_fname, NULL);
    for (char *slash; path != NULL && (slash = strrchr(path, '/')) != NULL;) {
        *slash = '\0';
        if (is_home(path, python->minor)) {
            if (*path == '\0')
                strcpy(path, "/");
            return path;
        }
    }
    free(path);
    return NULL;
}
#endif

static bool initialize(const Python *python, Message message) {
    void *config = calloc(1, CONFIG_SIZE);
    char *home = home_of(python);
    wchar_t *wide = home == NULL ? NULL : python->Py_DecodeLocale(home, NULL);
    Outcome outcome = {1, NULL, "out of memory", 0};
    if (wide != NULL)
        python->Py_SetPythonHome(wide); /* which keeps a copy */
    if (config != NULL) {
        python->PyConfig_InitIsolatedConfig(config); /* without signal handlers, which belong to the host */
        outcome = python->Py_InitializeFromConfig(config);
        python->PyConfig_Clear(config);
    }
    if (outcome.type == 0)
        python->PyEval_SaveThread(); /* from now on everyone asks for the lock */
    else
        snprintf(message, MESSAGE_SIZE, "no Python: Python 3.%d, whose home is %.500s, does not start: %.300s",
                 python->minor, home == NULL ? "not known" : home,
                 outcome.message == NULL ? "it gives no reason" : outcome.message);
    if (wide != NULL)
        python->PyMem_RawFree(wide);
    free(home);
    free(config);
    return outcome.type == 0;
}

bool python_start(const Python *python, Message message) {
    static Message failure = ""; /* after which nothing can be tried again */
    if (python->Py_IsInitialized())
        return true;
#define ABSENT(result, name, arguments) || python->name == NULL
    if (*failure == '\0' && (false PYTHON_STARTERS(ABSENT)))
        snprintf(failure, sizeof failure, "no Python: Python 3.%d lacks what starts it", python->minor);
#undef ABSENT
    if (*failure == '\0' && initialize(python, failure))
        return true;
    memcpy(message, failure, sizeof failure);
    return false;
}

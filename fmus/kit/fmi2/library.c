/* Finds Python's functions in the process, or else in a shared library, without linking to any.
 *
 * A host without Python gets it with its first instance, which must not be created by two threads at once. A library
 * whose standard library Python cannot find by itself needs the environment variable PYTHONHOME, or it ends the host.
 */
#include "python.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>

typedef HMODULE Library;
static Library loaded(const char *name) { return GetModuleHandleA(name); }
static Library load(const char *name) { return LoadLibraryA(name); }
static void find(Library library, const char *name, void *function) {
    FARPROC address = GetProcAddress(library, name);
    memcpy(function, &address, sizeof address);
}
/* On Windows a symbol is looked up in a named library only, so the library of the process has to be guessed by name. */
static const char *const in_process[] = {"python3%d.dll", NULL};
static const char *const on_disk[] = {"python3%d.dll", NULL};
#define LIBRARY_NAME "python3x.dll"
#else
#include <dlfcn.h>

typedef void *Library;
static Library loaded(const char *name) { return *name == '\0' ? dlopen(NULL, RTLD_LAZY) : NULL; }
/* Global, for Python's extension modules expect the symbols of Python in the process. */
static Library load(const char *name) { return dlopen(name, RTLD_NOW | RTLD_GLOBAL); }
static void find(Library library, const char *name, void *function) {
    void *address = dlsym(library, name);
    memcpy(function, &address, sizeof address);
}
static const char *const in_process[] = {"", NULL};
#ifdef __APPLE__
#define LIBRARY_NAME "libpython3.x.dylib"
static const char *const on_disk[] = {"libpython3.%d.dylib",
                                      "/Library/Frameworks/Python.framework/Versions/3.%d/Python",
                                      "/opt/homebrew/opt/python@3.%d/Frameworks/Python.framework/Versions/3.%d/Python",
                                      "/usr/local/opt/python@3.%d/Frameworks/Python.framework/Versions/3.%d/Python",
                                      NULL};
#else
#define LIBRARY_NAME "libpython3.x.so.1.0"
static const char *const on_disk[] = {"libpython3.%d.so.1.0", NULL};
#endif
#endif

enum { NEWEST_MINOR = 19, OLDEST_MINOR = 11 };

/* True when the library has all functions; those before `missing` are set in any case. */
static bool resolve(Python *python, Library library, const char **missing) {
#define FIND(result, name, arguments)              \
    find(library, #name, &python->name);           \
    if (python->name == NULL) {                    \
        *missing = #name;                          \
        return false;                              \
    }
    PYTHON_FUNCTIONS(FIND)
#undef FIND
    return true;
}

/* Tries each pattern with each minor version of Python, the newest first. */
static bool try_all(Python *python, Library (*open)(const char *), const char *const patterns[]) {
    const char *missing;
    for (int minor = NEWEST_MINOR; minor >= OLDEST_MINOR; minor--)
        for (int i = 0; patterns[i] != NULL; i++) {
            char name[128];
            Library library;
            snprintf(name, sizeof name, patterns[i], minor, minor);
            library = open(name);
            if (library != NULL && resolve(python, library, &missing))
                return true;
        }
    return false;
}

static bool initialize(Python *python) {
    if (!python->Py_IsInitialized()) {
        python->Py_InitializeEx(0);   /* without signal handlers, which belong to the host */
        python->PyEval_SaveThread();  /* from now on everyone asks for the lock */
    }
    return true;
}

bool python_find(Python *python, Message message) {
    const char *chosen = getenv("PPY_LIBPYTHON"), *missing = "";
    if (try_all(python, loaded, in_process))
        return initialize(python);
    if (chosen != NULL && *chosen != '\0') {
        Library library = load(chosen);
        if (library != NULL && resolve(python, library, &missing))
            return initialize(python);
        snprintf(message, MESSAGE_SIZE, "no Python: PPY_LIBPYTHON = %.500s %s%s", chosen,
                 library == NULL ? "cannot be loaded" : "lacks ", missing);
        return false;
    }
    if (try_all(python, load, on_disk))
        return initialize(python);
    snprintf(message, MESSAGE_SIZE,
             "no Python: this process has none and " LIBRARY_NAME " was not found for any x from %d to %d; install "
             "libpython3 or set PPY_LIBPYTHON to the path of such a library",
             OLDEST_MINOR, NEWEST_MINOR);
    return false;
}

/* ---- resource location ---------------------------------------------------------------------------- */

static int hexadecimal(char c) {
    static const char digits[] = "0123456789abcdefABCDEF";
    const char *digit = c == '\0' ? NULL : strchr(digits, c);
    return digit == NULL ? -1 : (int)(digit - digits) - (digit - digits > 15 ? 6 : 0);
}

static bool is_drive(const char *path) {
    return path[0] == '/' && ((path[1] | 32) >= 'a' && (path[1] | 32) <= 'z') && path[2] == ':';
}

/* Undoes the percent encoding in place; what is not a valid code stays as it is. */
static void decode(char *text) {
    char *to = text;
    for (; *text != '\0'; text++) {
        int high = *text == '%' ? hexadecimal(text[1]) : -1, low = high < 0 ? -1 : hexadecimal(text[2]);
        bool code = low >= 0 && (high | low) != 0;
        *to++ = code ? (char)(16 * high + low) : *text;
        text += code ? 2 : 0;
    }
    *to = '\0';
}

char *resource_path(const char *location) {
    char *path;
    size_t length;
    bool uri;
    if (location == NULL || *location == '\0')
        return NULL;
    uri = strncmp(location, "file:", 5) == 0 || strncmp(location, "FILE:", 5) == 0;
    if (uri)
        location += 5;
    if (uri && strncmp(location, "//localhost/", 12) == 0)
        location += 11;
    else if (uri && strncmp(location, "///", 3) == 0)
        location += 2;
    path = *location == '\0' ? NULL : malloc(strlen(location) + 1);
    if (path == NULL)
        return NULL;
    strcpy(path, location);
    if (uri)
        decode(path);
    if (uri && is_drive(path))
        memmove(path, path + 1, strlen(path));
    length = strlen(path);
    if (length > 1 && path[length - 1] == '/')
        path[length - 1] = '\0';
    return path;
}

/* Finds Python's functions in the process, or else in a shared library, without linking to any. */
#include "python.h"
#include "shared_library.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
/* One thread of the process at a time: several FMUs may want Python at once, and have nothing in common but the system. */
typedef HANDLE Lock;
static Lock lock_process(void) {
    char name[64];
    Lock lock;
    snprintf(name, sizeof name, "Local\\ppy-rig-python-%lu", (unsigned long)GetCurrentProcessId());
    lock = CreateMutexA(NULL, FALSE, name);
    if (lock != NULL)
        WaitForSingleObject(lock, INFINITE);
    return lock;
}
static void unlock_process(Lock lock) {
    if (lock == NULL)
        return;
    ReleaseMutex(lock);
    CloseHandle(lock);
}

static Library loaded(const char *name) { return GetModuleHandleA(name); }
static Library load(const char *name) { return LoadLibraryA(name); }
/* On Windows a symbol is looked up in a named library only, so the library of the process has to be guessed by name. */
static const char *const in_process[] = {"python3%d.dll", NULL};
static const char *const on_disk[] = {"python3%d.dll", NULL};
#define LIBRARY_NAME "python3x.dll"
#else
/* The same through C's lock of a stream. Other threads can write to this one when Python has started, some hundredths of
   a second later; none of them holds it for long, as one may hold that of the input. */
typedef FILE *Lock;
static Lock lock_process(void) {
    flockfile(stderr);
    return stderr;
}
static void unlock_process(Lock lock) { funlockfile(lock); }

static Library loaded(const char *name) { return *name == '\0' ? dlopen(NULL, RTLD_LAZY) : NULL; }
/* Global, for Python's extension modules expect the symbols of Python in the process. */
static Library load(const char *name) { return dlopen(name, RTLD_NOW | RTLD_GLOBAL); }
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
#define NEEDED "Python 3.11 or newer is needed"

/* True when the library has all functions that are needed. */
static bool resolve(Python *python, Library library, const char **missing) {
#define FIND(result, name, arguments) find(library, #name, &python->name);
    PYTHON_FUNCTIONS(FIND)
    PYTHON_STARTERS(FIND)
#undef FIND
#define CHECK(result, name, arguments) \
    if (python->name == NULL) {        \
        *missing = #name;              \
        return false;                  \
    }
    PYTHON_FUNCTIONS(CHECK)
#undef CHECK
    return true;
}

/* Whether a library can be used; `whose` is what a complaint begins with. Its version comes first: what an older one
   does with calls it does not expect is not known. */
static bool usable(Python *python, Library library, const char *whose, Message message) {
    const char *(*version)(void), *missing = "Py_GetVersion";
    int major = 0;
    find(library, missing, &version);
    if (version != NULL) {
        const char *told = version(); /* such as "3.11.7 (main, ...) [GCC ...]" */
        if (sscanf(told, "%d.%d", &major, &python->minor) != 2 || major != 3 || python->minor < OLDEST_MINOR) {
            snprintf(message, MESSAGE_SIZE, "no Python: %.500s is Python %.*s; " NEEDED, whose,
                     (int)(strcspn(told, " ") % 32), told);
            return false;
        }
        if (resolve(python, library, &missing))
            return true;
    }
    snprintf(message, MESSAGE_SIZE, "no Python: %.500s lacks %s", whose, missing);
    return false;
}

/* Opens the first library there is of all patterns with each minor version of Python, the newest first. */
static Library open_any(Library (*open)(const char *), const char *const patterns[]) {
    for (int minor = NEWEST_MINOR; minor >= OLDEST_MINOR; minor--)
        for (int i = 0; patterns[i] != NULL; i++) {
            char name[128];
            Library library;
            void *function = NULL;
            snprintf(name, sizeof name, patterns[i], minor, minor);
            library = open(name);
            if (library != NULL)
                find(library, "Py_GetVersion", &function);
            if (function != NULL)
                return library;
        }
    return NULL;
}

/* Uses a library that was loaded for it, or lets it go again. */
static bool used(Python *python, Library library, const char *whose, Message message) {
    if (usable(python, library, whose, message))
        return python_start(python, message);
    unload(library);
    return false;
}

static bool found(Python *python, Message message) {
    const char *chosen = getenv("PPY_LIBPYTHON");
    Library library = open_any(loaded, in_process);
    char whose[600];
    if (library != NULL)
        return usable(python, library, "what this process has", message) && python_start(python, message);
    if (chosen != NULL && *chosen != '\0') {
        snprintf(whose, sizeof whose, "PPY_LIBPYTHON = %.500s", chosen);
        library = load(chosen);
        if (library != NULL)
            return used(python, library, whose, message);
        snprintf(message, MESSAGE_SIZE, "no Python: %s cannot be loaded", whose);
        return false;
    }
    library = open_any(load, on_disk);
    if (library != NULL)
        return used(python, library, "a library named " LIBRARY_NAME, message);
    snprintf(message, MESSAGE_SIZE,
             "no Python: this process has none and " LIBRARY_NAME " was not found for any x from %d to %d; install "
             "libpython3 or set PPY_LIBPYTHON to the path of such a library",
             OLDEST_MINOR, NEWEST_MINOR);
    return false;
}

bool python_find(Python *python, Message message) {
    Lock lock = lock_process();
    bool good = found(python, message);
    unlock_process(lock);
    return good;
}

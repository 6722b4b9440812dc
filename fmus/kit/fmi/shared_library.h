/* Shared libraries: opened, closed, and their functions by name. */
#ifndef SHARED_LIBRARY_H
#define SHARED_LIBRARY_H

#include <string.h>

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN /* without names of RPC: the front-end, in the same unit, has a `boolean` of its own */
#include <windows.h>

typedef HMODULE Library;
static void unload(Library library) { FreeLibrary(library); }
static void find(Library library, const char *name, void *function) {
    FARPROC address = GetProcAddress(library, name);
    memcpy(function, &address, sizeof address);
}
#else
#include <dlfcn.h>

typedef void *Library;
static void unload(Library library) { dlclose(library); }
static void find(Library library, const char *name, void *function) {
    void *address = dlsym(library, name);
    memcpy(function, &address, sizeof address);
}
#endif
#endif

/* The path of this library and of files beside it, and libraries that it loads. */
#ifdef _WIN32
#include <windows.h>
#else
#define _GNU_SOURCE /* for dladdr */
#include <dlfcn.h>
#endif
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_PATH = 4096 };

#ifdef _WIN32

static int own_path(char *path, size_t room) {
    HMODULE module;
    wchar_t wide[MOST_PATH];
    DWORD flags = GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS | GET_MODULE_HANDLE_EX_FLAG_UNCHANGED_REFCOUNT;
    if (!GetModuleHandleExW(flags, (LPCWSTR)(void *)own_path, &module)) return 0;
    if (!GetModuleFileNameW(module, wide, MOST_PATH)) return 0;
    return WideCharToMultiByte(CP_UTF8, 0, wide, -1, path, (int)room, NULL, NULL) > 0;
}

static FILE *open_file(const char *path, int appends) {
    wchar_t wide[MOST_PATH];
    if (MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, MOST_PATH) <= 0) return NULL;
    return _wfopen(wide, appends ? L"ab" : L"rb");
}

static void *open_library(const char *path, char *reason, size_t room) {
    wchar_t wide[MOST_PATH];
    void *library = NULL;
    if (MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, MOST_PATH) > 0)
        library = (void *)LoadLibraryExW(wide, NULL, LOAD_WITH_ALTERED_SEARCH_PATH);
    if (!library) snprintf(reason, room, "error %lu of Windows", GetLastError());
    return library;
}

static void *find(void *library, const char *name) { return (void *)GetProcAddress((HMODULE)library, name); }

static void close_library(void *library) { FreeLibrary((HMODULE)library); }

#else

static int own_path(char *path, size_t room) {
    Dl_info info;
    union {
        int (*function)(char *, size_t);
        void *address;
    } here = {own_path};
    if (!dladdr(here.address, &info) || !info.dli_fname) return 0;
    return snprintf(path, room, "%s", info.dli_fname) < (int)room;
}

static FILE *open_file(const char *path, int appends) { return fopen(path, appends ? "ab" : "rb"); }

static void *open_library(const char *path, char *reason, size_t room) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library) snprintf(reason, room, "%s", dlerror());
    return library;
}

static void *find(void *library, const char *name) { return dlsym(library, name); }

static void close_library(void *library) { dlclose(library); }

#endif

/* Read a line; returns it in memory of its own, or NULL. */
static char *read_line(FILE *table) {
    char line[MOST_PATH];
    if (!fgets(line, sizeof line, table)) return NULL;
    line[strcspn(line, "\r\n")] = 0;
    char *copy = malloc(strlen(line) + 1);
    return copy ? strcpy(copy, line) : NULL;
}

/* Open the table beside this library; returns NULL if there is none. */
static FILE *open_table(void) {
    char path[MOST_PATH];
    if (!own_path(path, sizeof path - 8) || !strrchr(path, '.')) return NULL;
    strcpy(strrchr(path, '.'), ".table");
    return open_file(path, 0);
}

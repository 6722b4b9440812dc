/* The table beside the wrapper's library, and the library of the FMU that it names. */
#ifdef _WIN32
#include <windows.h>
#else
#define _GNU_SOURCE /* for dladdr */
#include <dlfcn.h>
#endif
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "wrapper.h"

enum { MOST_PATH = 4096, MOST_VARIABLES = 10000000 };

#ifdef _WIN32

static int own_path(char *path, size_t room) {
    HMODULE module;
    wchar_t wide[MOST_PATH];
    DWORD flags = GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS | GET_MODULE_HANDLE_EX_FLAG_UNCHANGED_REFCOUNT;
    if (!GetModuleHandleExW(flags, (LPCWSTR)(void *)own_path, &module)) return 0;
    if (!GetModuleFileNameW(module, wide, MOST_PATH)) return 0;
    return WideCharToMultiByte(CP_UTF8, 0, wide, -1, path, (int)room, NULL, NULL) > 0;
}

static FILE *open_text(const char *path) {
    wchar_t wide[MOST_PATH];
    return MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, MOST_PATH) > 0 ? _wfopen(wide, L"rb") : NULL;
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

static FILE *open_text(const char *path) { return fopen(path, "rb"); }

static void *open_library(const char *path, char *reason, size_t room) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library) snprintf(reason, room, "%s", dlerror());
    return library;
}

static void *find(void *library, const char *name) { return dlsym(library, name); }

static void close_library(void *library) { dlclose(library); }

#endif

static void bind_functions(component *c) {
    void *address;
#define BIND(name)                                                                                                     \
    address = find(c->library, "fmi3" #name);                                                                          \
    memcpy(&c->call.name, &address, sizeof address);
    FUNCTIONS(BIND)
#undef BIND
}

/* Read a line; returns it in memory of its own, or NULL. */
static char *read_line(FILE *table) {
    char line[MOST_PATH];
    if (!fgets(line, sizeof line, table)) return NULL;
    line[strcspn(line, "\r\n")] = 0;
    char *copy = malloc(strlen(line) + 1);
    return copy ? strcpy(copy, line) : NULL;
}

static int read_variables(component *c, FILE *table) {
    unsigned long count;
    if (fscanf(table, "%lu", &count) != 1 || count > MOST_VARIABLES) return 0;
    c->variables = calloc(count + 1, sizeof *c->variables);
    if (!c->variables) return 0;
    for (; c->variable_count < count; c->variable_count++) {
        unsigned kind;
        unsigned long reference, elements;
        if (fscanf(table, "%u %lu %lu", &kind, &reference, &elements) != 3 || kind >= TYPES) return 0;
        if (elements > MOST_VARIABLES - c->element_count) return 0;
        variable *v = &c->variables[c->variable_count];
        v->type = (type)kind;
        v->reference = (fmi3ValueReference)reference;
        v->first = c->element_count;
        v->count = elements;
        c->element_count += elements;
    }
    return 1;
}

/* Room for the values of any selection; of no type are they wider than a pointer or a double. */
static int make_room(component *c) {
    size_t elements = c->element_count + 1;
    c->owners = calloc(elements, sizeof *c->owners);
    c->references = calloc(c->variable_count + 1, sizeof *c->references);
    c->values = calloc(elements, sizeof(double));
    c->derivatives = calloc(elements, sizeof(double));
    if (!c->owners || !c->references || !c->values || !c->derivatives) return 0;
    for (size_t k = 0; k < c->variable_count; k++)
        for (size_t i = 0; i < c->variables[k].count; i++) c->owners[c->variables[k].first + i] = k;
    return 1;
}

int load(component *c) {
    char path[MOST_PATH], reason[MOST_PATH] = "";
    if (!own_path(path, sizeof path - 8) || !strrchr(path, '.')) {
        tell(c, fmi2Error, "the place of the wrapper is not known");
        return 0;
    }
    strcpy(strrchr(path, '.'), ".table");
    FILE *table = open_text(path);
    char *library = table ? read_line(table) : NULL;
    c->resources = library ? read_line(table) : NULL;
    int complete = c->resources && read_variables(c, table) && make_room(c);
    if (table) fclose(table);
    if (!complete)
        tell(c, fmi2Error, "the table of its variables, or the memory for them, is missing");
    else if (!(c->library = open_library(library, reason, sizeof reason)))
        tell(c, fmi2Error, "its library cannot be loaded (%s)", reason);
    else
        bind_functions(c);
    free(library);
    return c->library != NULL;
}

void unload(component *c) {
    if (c->library) close_library(c->library);
    free(c->resources);
    free(c->variables);
    free(c->owners);
    free(c->references);
    free(c->places);
    free(c->values);
    free(c->derivatives);
    free(c->row);
    free(c->late_elements);
    free(c->late_row);
    free(c->reading.elements);
    free(c->reading.references);
    free(c->writing.elements);
    free(c->writing.references);
    free(c->name);
    free(c);
}

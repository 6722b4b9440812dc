/* An FMU 2.0 in co-simulation as an external object of Modelica (specification 3.6, section 12.9.7).
 *
 * All is static, so that a compiler may include it wherever it calls it. The FMU's library is beside this file, in
 * ../Library/PLATFORM; the file's own name tells where that is.
 */
#ifndef PPY_RIG_FMU_H
#define PPY_RIG_FMU_H

#include "ModelicaUtilities.h"
#include "fmi2FunctionTypes.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#include <windows.h>
#define PPY_RIG_PLATFORM "win64"
#define PPY_RIG_EXTENSION ".dll"
#elif defined(__APPLE__)
#include <dlfcn.h>
#define PPY_RIG_PLATFORM "darwin64"
#define PPY_RIG_EXTENSION ".dylib"
#else
#include <dlfcn.h>
#if defined(__aarch64__)
#define PPY_RIG_PLATFORM "aarch64-linux"
#else
#define PPY_RIG_PLATFORM "linux64"
#endif
#define PPY_RIG_EXTENSION ".so"
#endif

typedef struct {
    void *library;
    fmi2Component component;
    fmi2CallbackFunctions callbacks;
    char *types;       /* of every variable: r, i or b, by value reference */
    unsigned inputs;   /* value reference of the first input */
    int is_initialized;
    double time;       /* of the last communication point */
    char message[512]; /* the last of the FMU */
    fmi2FreeInstanceTYPE *free_instance;
    fmi2SetupExperimentTYPE *setup_experiment;
    fmi2EnterInitializationModeTYPE *enter_initialization_mode;
    fmi2ExitInitializationModeTYPE *exit_initialization_mode;
    fmi2TerminateTYPE *terminate;
    fmi2DoStepTYPE *do_step;
    fmi2SetRealTYPE *set_real;
    fmi2SetIntegerTYPE *set_integer;
    fmi2SetBooleanTYPE *set_boolean;
    fmi2GetRealTYPE *get_real;
    fmi2GetIntegerTYPE *get_integer;
    fmi2GetBooleanTYPE *get_boolean;
} PpyRigFmu;

static void ppy_rig_log(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String message, ...) {
    PpyRigFmu *fmu = environment;
    va_list arguments;
    (void)name;
    (void)category;
    if (status == fmi2OK)
        return;
    va_start(arguments, message);
    vsnprintf(fmu->message, sizeof fmu->message, message, arguments);
    va_end(arguments);
}

static void ppy_rig_close(void *object) {
    PpyRigFmu *fmu = object;
    if (!fmu)
        return;
    if (fmu->component) {
        if (fmu->is_initialized)
            fmu->terminate(fmu->component);
        fmu->free_instance(fmu->component);
    }
#if defined(_WIN32)
    if (fmu->library)
        FreeLibrary((HMODULE)fmu->library);
#else
    if (fmu->library)
        dlclose(fmu->library);
#endif
    free(fmu->types);
    free(fmu);
}

/* Ends the simulation with a message. */
static void ppy_rig_fail(const char *what, const char *detail) {
    ModelicaFormatError("%s: %s", what, detail);
}

static void *ppy_rig_load(const char *path) {
#if defined(_WIN32)
    return (void *)LoadLibraryA(path);
#else
    return dlopen(path, RTLD_NOW | RTLD_LOCAL);
#endif
}

/* A function of the library, as an object pointer is copied into a function pointer in C99. */
static int ppy_rig_find(PpyRigFmu *fmu, const char *name, void *function) {
#if defined(_WIN32)
    FARPROC found = GetProcAddress((HMODULE)fmu->library, name);
#else
    void *found = dlsym(fmu->library, name);
#endif
    memcpy(function, &found, sizeof found);
    return found != NULL;
}

static int ppy_rig_find_all(PpyRigFmu *fmu, fmi2InstantiateTYPE **instantiate) {
    return ppy_rig_find(fmu, "fmi2Instantiate", instantiate) &&
           ppy_rig_find(fmu, "fmi2FreeInstance", &fmu->free_instance) &&
           ppy_rig_find(fmu, "fmi2SetupExperiment", &fmu->setup_experiment) &&
           ppy_rig_find(fmu, "fmi2EnterInitializationMode", &fmu->enter_initialization_mode) &&
           ppy_rig_find(fmu, "fmi2ExitInitializationMode", &fmu->exit_initialization_mode) &&
           ppy_rig_find(fmu, "fmi2Terminate", &fmu->terminate) &&
           ppy_rig_find(fmu, "fmi2DoStep", &fmu->do_step) && ppy_rig_find(fmu, "fmi2SetReal", &fmu->set_real) &&
           ppy_rig_find(fmu, "fmi2SetInteger", &fmu->set_integer) &&
           ppy_rig_find(fmu, "fmi2SetBoolean", &fmu->set_boolean) &&
           ppy_rig_find(fmu, "fmi2GetReal", &fmu->get_real) &&
           ppy_rig_find(fmu, "fmi2GetInteger", &fmu->get_integer) &&
           ppy_rig_find(fmu, "fmi2GetBoolean", &fmu->get_boolean);
}

static fmi2Status ppy_rig_set(PpyRigFmu *fmu, fmi2ValueReference reference, double value) {
    fmi2Integer whole = (fmi2Integer)(value < 0.0 ? value - 0.5 : value + 0.5);
    switch (fmu->types[reference]) {
    case 'i': return fmu->set_integer(fmu->component, &reference, 1, &whole);
    case 'b': return fmu->set_boolean(fmu->component, &reference, 1, &whole);
    default: return fmu->set_real(fmu->component, &reference, 1, &value);
    }
}

static fmi2Status ppy_rig_get(PpyRigFmu *fmu, fmi2ValueReference reference, double *value) {
    fmi2Integer whole = 0;
    fmi2Status status;
    switch (fmu->types[reference]) {
    case 'i': status = fmu->get_integer(fmu->component, &reference, 1, &whole); break;
    case 'b': status = fmu->get_boolean(fmu->component, &reference, 1, &whole); break;
    default: return fmu->get_real(fmu->component, &reference, 1, value);
    }
    *value = (double)whole;
    return status;
}

static fmi2Status ppy_rig_set_all(PpyRigFmu *fmu, unsigned first, const double *values, size_t count) {
    fmi2Status worst = fmi2OK;
    size_t k;
    for (k = 0; k < count && worst <= fmi2Warning; ++k) {
        fmi2Status status = ppy_rig_set(fmu, first + (unsigned)k, values[k]);
        worst = status > worst ? status : worst;
    }
    return worst;
}

/* An FMU with values of its parameters. */
static void *ppy_rig_open(const char *name, const char *guid, const char *types, int inputs, const double *parameters,
                          size_t count) {
    static const char own[] = "Include/ppy_rig_fmu.h";
    const char *file = __FILE__;
    size_t folder = strlen(file) > strlen(own) ? strlen(file) - strlen(own) : 0;
    size_t room = folder + strlen(name) + 64;
    char *path = malloc(room);
    PpyRigFmu *fmu = calloc(1, sizeof *fmu);
    fmi2InstantiateTYPE *instantiate = NULL;
    if (fmu)
        fmu->types = malloc(strlen(types) + 1);
    if (!path || !fmu || !fmu->types) {
        free(path);
        ppy_rig_close(fmu);
        ppy_rig_fail(name, "no memory is left");
        return NULL;
    }
    strcpy(fmu->types, types);
    snprintf(path, room, "%.*sLibrary/%s/%s%s", (int)folder, file, PPY_RIG_PLATFORM, name, PPY_RIG_EXTENSION);
    fmu->library = ppy_rig_load(path);
    free(path);
    fmu->inputs = (unsigned)inputs;
    if (!fmu->library || !ppy_rig_find_all(fmu, &instantiate)) {
        ppy_rig_close(fmu);
        ppy_rig_fail(name, "no library in Resources/Library/" PPY_RIG_PLATFORM);
        return NULL;
    }
    fmu->callbacks.logger = ppy_rig_log;
    fmu->callbacks.allocateMemory = calloc;
    fmu->callbacks.freeMemory = free;
    fmu->callbacks.componentEnvironment = fmu;
    fmu->component = instantiate(name, fmi2CoSimulation, guid, "", &fmu->callbacks, fmi2False, fmi2False);
    if (!fmu->component || ppy_rig_set_all(fmu, 0, parameters, count) > fmi2Warning) {
        char message[sizeof fmu->message];
        memcpy(message, fmu->message, sizeof message);
        ppy_rig_close(fmu);
        ppy_rig_fail(name, message);
        return NULL;
    }
    return fmu;
}

/* Steps to a communication point with the inputs of the one before, and returns outputs with those of this one. */
static void ppy_rig_communicate(void *object, double time, const double *inputs, size_t count, const int *outputs,
                                size_t shown, double *values) {
    PpyRigFmu *fmu = object;
    fmi2Component c = fmu->component;
    fmi2Status status = fmi2OK;
    size_t k;
    if (!fmu->is_initialized) {
        status = fmu->setup_experiment(c, fmi2False, 0.0, time, fmi2False, 0.0);
        if (status <= fmi2Warning)
            status = fmu->enter_initialization_mode(c);
    } else if (time > fmu->time) {
        status = fmu->do_step(c, fmu->time, time - fmu->time, fmi2True);
    }
    if (status <= fmi2Warning)
        status = ppy_rig_set_all(fmu, fmu->inputs, inputs, count);
    if (status <= fmi2Warning && !fmu->is_initialized) {
        status = fmu->exit_initialization_mode(c);
        fmu->is_initialized = status <= fmi2Warning;
    }
    fmu->time = time;
    for (k = 0; k < shown && status <= fmi2Warning; ++k)
        status = ppy_rig_get(fmu, (fmi2ValueReference)outputs[k], values + k);
    if (status > fmi2Warning)
        ppy_rig_fail("an FMU failed", fmu->message);
}

#endif

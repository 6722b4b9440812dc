/* A member of a packed system that is itself an FMU for co-simulation of FMI 2.0.
 *
 * Its archive lies unpacked in the resources of the system. Its variables are in the memory of the system, laid out as
 * those of any member; what else there is to its instance is its own, so that the state of the system cannot be saved.
 */
#include "any_model.h"
#include "fmi2FunctionTypes.h"
#include "resources.h"
#include "shared_library.h"

#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined _WIN32
#define FMU_BINARY "%s/%s/binaries/win64/%s.dll"
/* Other libraries that it needs lie beside it. */
static Library open_fmu(const char *path) {
    wchar_t wide[1024];
    int fits = MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, 1024);
    for (wchar_t *c = wide; fits && *c; c++)
        *c = *c == L'/' ? L'\\' : *c;
    return fits ? LoadLibraryExW(wide, NULL, LOAD_WITH_ALTERED_SEARCH_PATH) : NULL;
}
#else
#if defined __APPLE__
#define FMU_BINARY "%s/%s/binaries/darwin64/%s.dylib"
#elif defined __aarch64__
#define FMU_BINARY "%s/%s/binaries/aarch64-linux/%s.so"
#else
#define FMU_BINARY "%s/%s/binaries/linux64/%s.so"
#endif
static Library open_fmu(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
#endif

#define FUNCTIONS_OF_FMU(X)                                                                                            \
    X(Instantiate) X(FreeInstance) X(SetupExperiment) X(EnterInitializationMode) X(ExitInitializationMode)             \
    X(Terminate) X(SetReal) X(SetInteger) X(SetBoolean) X(SetString) X(GetReal) X(GetInteger) X(GetBoolean) X(DoStep)

/* A parameter that is a text. */
typedef struct {
    fmi2ValueReference reference;
    const char *value; /* NULL after the last */
} FmuText;

typedef struct {
    const char *folder, *identifier, *guid; /* folder of its archive, in the resources */
    double tolerance;                       /* 0.0 where it declares none */
    const fmi2ValueReference *references;   /* of its variables, as they are in memory */
    const FmuText *texts;
} FmuTable;

typedef struct {
    const FmuTable *table; /* NULL for a member with laws */
    const Model *model;
    double *memory; /* its variables */
    double *sent;   /* parameters and inputs as the instance has them */
    char *location; /* of its own resources */
    const char *name;
    Library library;
#define FIELD(name) fmi2##name##TYPE *name;
    FUNCTIONS_OF_FMU(FIELD)
#undef FIELD
    fmi2CallbackFunctions callbacks;
    fmi2Component instance; /* NULL before its initialization begins, and after its end */
    double start_time;
    bool initialized, broken;
    Message said; /* its latest message */
} FmuMember;

static void note_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                         fmi2String format, ...) {
    FmuMember *fmu = environment;
    va_list arguments;
    (void)name;
    (void)category;
    if (status == fmi2OK || format == NULL)
        return;
    va_start(arguments, format);
    vsnprintf(fmu->said, sizeof fmu->said, format, arguments);
    va_end(arguments);
    fmu->said[strcspn(fmu->said, "\r\n")] = '\0';
}

/* Whether a call has succeeded, with a warning or without. */
static bool fmu_done(FmuMember *fmu, const char *function, fmi2Status status, Message message) {
    static const char *const names[] = {"OK", "warning", "discard", "error", "fatal", "pending"};
    if (status == fmi2OK || status == fmi2Warning)
        return true;
    fmu->broken = status == fmi2Fatal;
    snprintf(message, MESSAGE_SIZE, "fmi2%s ended with %s%s%.600s", function,
             status >= 0 && status <= fmi2Pending ? names[status] : "an unknown status", *fmu->said ? ": " : "", fmu->said);
    return false;
}

/* ---- values ------------------------------------------------------------------------------------- */

static bool is_changed(const FmuMember *fmu, int i) { return fmu->memory[i] != fmu->sent[i]; }

static bool set(FmuMember *fmu, int i, size_t count, Message message) {
    const Variable *variable = &fmu->model->variable[i];
    const fmi2ValueReference *references = &fmu->table->references[i];
    double value = fmu->memory[i];
    fmi2Integer whole;
    if (variable->type == TYPE_REAL)
        return fmu_done(fmu, "SetReal", fmu->SetReal(fmu->instance, references, count, &fmu->memory[i]), message);
    if (!(value >= INT_MIN && value <= INT_MAX) || value != floor(value)) {
        snprintf(message, MESSAGE_SIZE, "'%s' would be %.10g, which its type cannot hold", variable->name, value);
        return false;
    }
    whole = variable->type == TYPE_BOOLEAN ? value != 0.0 : (fmi2Integer)value;
    if (variable->type == TYPE_BOOLEAN)
        return fmu_done(fmu, "SetBoolean", fmu->SetBoolean(fmu->instance, references, count, &whole), message);
    return fmu_done(fmu, "SetInteger", fmu->SetInteger(fmu->instance, references, count, &whole), message);
}

static bool get(FmuMember *fmu, int i, size_t count, Message message) {
    const fmi2ValueReference *references = &fmu->table->references[i];
    Type type = fmu->model->variable[i].type;
    fmi2Integer whole = 0;
    bool done;
    if (type == TYPE_REAL)
        return fmu_done(fmu, "GetReal", fmu->GetReal(fmu->instance, references, count, &fmu->memory[i]), message);
    done = type == TYPE_BOOLEAN
               ? fmu_done(fmu, "GetBoolean", fmu->GetBoolean(fmu->instance, references, count, &whole), message)
               : fmu_done(fmu, "GetInteger", fmu->GetInteger(fmu->instance, references, count, &whole), message);
    fmu->memory[i] = type == TYPE_BOOLEAN ? whole != 0 : whole;
    return done;
}

/* How many variables one call takes, from i to before the end: reals that follow one another, else one. */
static int together(const FmuMember *fmu, int i, int end) {
    int next = i;
    while (next < end && fmu->model->variable[next].type == TYPE_REAL)
        next++;
    return next > i ? next - i : 1;
}

/* Sends variables, from the first to before the end, of which the instance has other values. */
static bool send_values(FmuMember *fmu, int first, int end, Message message) {
    for (int i = first, count; i < end; i += count) {
        int changed = i;
        while (changed < end && is_changed(fmu, changed))
            changed++;
        count = changed > i ? together(fmu, i, changed) : 1;
        if (changed > i && !set(fmu, i, (size_t)count, message))
            return false;
        memcpy(&fmu->sent[i], &fmu->memory[i], (size_t)count * sizeof *fmu->sent);
    }
    return true;
}

static bool send_parameters(FmuMember *fmu, Message message) {
    return send_values(fmu, fmu->model->first_parameter, fmu->model->first_input, message);
}

static bool send_inputs(FmuMember *fmu, Message message) {
    return send_values(fmu, fmu->model->first_input, fmu->model->first_output, message);
}

static bool read_outputs(FmuMember *fmu, Message message) {
    int end = fmu->model->first_derivative;
    for (int i = fmu->model->first_output, count; i < end; i += count) {
        count = together(fmu, i, end);
        if (!get(fmu, i, (size_t)count, message))
            return false;
    }
    return true;
}

/* ---- the instance ------------------------------------------------------------------------------- */

static void fmu_end(FmuMember *fmu) {
    if (fmu->instance != NULL && !fmu->broken) {
        if (fmu->initialized)
            fmu->Terminate(fmu->instance);
        fmu->FreeInstance(fmu->instance);
    }
    fmu->instance = NULL; /* one that is broken must not be called again */
    fmu->initialized = fmu->broken = false;
}

static void fmu_close(FmuMember *fmu) {
    fmu_end(fmu);
    if (fmu->library != NULL)
        unload(fmu->library);
    free(fmu->sent);
    free(fmu->location);
}

static bool out_of_memory(Message message) {
    snprintf(message, MESSAGE_SIZE, "out of memory");
    return false;
}

/* Loads the library; `resources` is the location of those of the system, as the host gave it. */
static bool fmu_open(FmuMember *fmu, const FmuTable *table, const char *resources, Message message) {
    const fmi2CallbackFunctions callbacks = {note_message, calloc, free, NULL, fmu};
    const char *missing = NULL, *last = resources == NULL || *resources == '\0' ? "" : resources + strlen(resources) - 1;
    char *folder = resource_path(resources), *path = NULL;
    size_t size;
    if (folder == NULL) {
        snprintf(message, MESSAGE_SIZE, "the host has given no location of the resources, where its FMU is");
        return false;
    }
    size = strlen(resources) + strlen(table->folder) + strlen(table->identifier) + 100;
    path = malloc(size);
    fmu->location = malloc(size);
    fmu->sent = calloc((size_t)fmu->model->memory_size, sizeof *fmu->sent);
    if (path == NULL || fmu->location == NULL || fmu->sent == NULL) {
        free(folder);
        free(path);
        return out_of_memory(message);
    }
    memcpy(&fmu->callbacks, &callbacks, sizeof callbacks); /* FMI 2.0.0 has constant fields, which cannot be assigned */
    fmu->table = table;
    snprintf(fmu->location, size, "%s%s%s/resources", resources, *last == '/' ? "" : "/", table->folder);
    snprintf(path, size, FMU_BINARY, folder, table->folder, table->identifier);
    fmu->library = open_fmu(path);
    if (fmu->library == NULL)
        snprintf(message, MESSAGE_SIZE, "%.800s cannot be loaded", path);
    free(folder);
    free(path);
    if (fmu->library == NULL)
        return false;
#define FIND(name)                                            \
    find(fmu->library, "fmi2" #name, &fmu->name);             \
    if (fmu->name == NULL)                                    \
        missing = "fmi2" #name;
    FUNCTIONS_OF_FMU(FIND)
#undef FIND
    if (missing != NULL)
        snprintf(message, MESSAGE_SIZE, "its library lacks %s", missing);
    return missing == NULL;
}

static bool enter_initialization(FmuMember *fmu, double tolerance, Message message) {
    const Model *model = fmu->model;
    fmi2Status status = fmu->SetupExperiment(fmu->instance, tolerance > 0.0, tolerance, fmu->start_time, fmi2False, 0.0);
    if (!fmu_done(fmu, "SetupExperiment", status, message))
        return false;
    for (const FmuText *text = fmu->table->texts; text->value != NULL; text++)
        if (!fmu_done(fmu, "SetString", fmu->SetString(fmu->instance, &text->reference, 1, &text->value), message))
            return false;
    for (int i = 0; i < model->first_output; i++)
        fmu->sent[i] = model->variable[i].start;
    return send_parameters(fmu, message) &&
           fmu_done(fmu, "EnterInitializationMode", fmu->EnterInitializationMode(fmu->instance), message);
}

/* Begins the initialization, and begins it anew if parameters or the start time are others than before. */
static bool fmu_begin(FmuMember *fmu, double start_time, Message message) {
    const size_t parameters = (size_t)fmu->model->parameters * sizeof(double);
    if (fmu->instance != NULL && fmu->start_time == start_time && memcmp(fmu->memory, fmu->sent, parameters) == 0)
        return true;
    fmu_end(fmu);
    fmu->start_time = start_time;
    fmu->instance = fmu->Instantiate(fmu->name, fmi2CoSimulation, fmu->table->guid, fmu->location, &fmu->callbacks,
                                     fmi2False, fmi2False);
    if (fmu->instance == NULL) {
        snprintf(message, MESSAGE_SIZE, "fmi2Instantiate has failed%s%.600s", *fmu->said ? ": " : "", fmu->said);
        return false;
    }
    return enter_initialization(fmu, fmu->table->tolerance, message);
}

static bool fmu_initialize(FmuMember *fmu, Message message) {
    if (!send_inputs(fmu, message) ||
        !fmu_done(fmu, "ExitInitializationMode", fmu->ExitInitializationMode(fmu->instance), message))
        return false;
    fmu->initialized = true;
    return true;
}

static bool fmu_evaluate(FmuMember *fmu, Message message) {
    return send_inputs(fmu, message) && read_outputs(fmu, message);
}

static bool fmu_step(FmuMember *fmu, double time, double size, Message message) {
    return send_inputs(fmu, message) &&
           fmu_done(fmu, "DoStep", fmu->DoStep(fmu->instance, time, size, fmi2True), message);
}

/* FMI 2.0 co-simulation: creation, initialization and end of an instance. */
#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const categories[] = {"logStatusOK", "logStatusWarning", "logStatusDiscard", "logStatusError",
                                         "logStatusFatal"};

static const char *mode_name(int mode) {
    switch (mode) {
    case INSTANTIATED: return "before initialization";
    case INITIALIZATION: return "during initialization";
    case STEP_COMPLETE: return "between steps";
    case FAILED: return "after an error";
    default: return "after termination";
    }
}

/* Bytes of the UTF-8 character that `text` begins with; 0 if it is broken, as at the end of a truncated message. */
static int character_length(const char *text) {
    unsigned char first = (unsigned char)*text;
    int length = first < 0x80 ? 1 : first < 0xc0 ? 0 : first < 0xe0 ? 2 : first < 0xf0 ? 3 : first < 0xf8 ? 4 : 0;
    for (int i = 1; i < length; i++)
        if (((unsigned char)text[i] & 0xc0) != 0x80)
            return 0;
    return length;
}

/* Loggers read the message as a printf format, some without arguments: doubling each % suits both kinds. */
static void deliver(const fmi2CallbackFunctions *host, const char *name, fmi2Status status, const char *text) {
    char line[2 * MESSAGE_SIZE], *end = line;
    if (host->logger == NULL)
        return;
    while (*text != '\0') {
        int length = character_length(text);
        if (*text == '%')
            *end++ = '%';
        *end = length == 0 ? '?' : (unsigned char)*text < ' ' ? ' ' : *text;
        for (int i = 1; i < length; i++)
            end[i] = text[i];
        end += length == 0 ? 1 : length;
        text += length == 0 ? 1 : length;
    }
    *end = '\0';
    host->logger(host->componentEnvironment, name, status, categories[status], line);
}

fmi2Status report(const Instance *instance, fmi2Status status, const char *format, ...) {
    Message text;
    va_list arguments;
    if (status < fmi2Discard && !instance->logging)
        return status;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    deliver(&instance->host, instance->name, status, text);
    return status;
}

bool allowed(const Instance *instance, int modes, const char *function) {
    if (instance == NULL)
        return false;
    if (((int)instance->now.mode & modes) != 0)
        return true;
    report(instance, fmi2Error, "%s is not allowed %s", function, mode_name((int)instance->now.mode));
    return false;
}

void touch(Instance *instance, bool parameters) {
    double *memory = instance->now.memory;
    instance->now.outputs_outdated = instance->now.derivatives_outdated = 1.0;
    if (!parameters)
        return;
    memory[MEMORY_PARAMETERS_CHANGED] = 1.0;
    if (((int)instance->now.mode & BEFORE_START) != 0)
        for (int i = 0; i < MODEL_STATES + MODEL_DISCRETES; i++)
            memory[FIRST_STATE + i] = memory[model_start_of[i]];
}

fmi2Status fail(Instance *instance) {
    instance->now = instance->before;
    instance->now.mode = FAILED;
    instance->now.memory[MEMORY_PARAMETERS_CHANGED] = 1.0;
    return fmi2Error;
}

static void reset(Instance *instance) {
    State *now = &instance->now;
    memset(now, 0, sizeof *now);
    now->mode = INSTANTIATED;
    now->stop_time = INFINITY;
    for (int i = 0; i < MODEL_VARIABLES; i++)
        now->memory[i] = model_variables[i].start;
    now->memory[MEMORY_HINT] = INFINITY;
    now->memory[MEMORY_TOLERANCE] = model_tolerance;
    touch(instance, true);
}

EXPORT const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

EXPORT const char *fmi2GetVersion(void) { return fmi2Version; }

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]) {
    Instance *instance = c;
    if (!allowed(instance, ANY_MODE, "fmi2SetDebugLogging"))
        return fmi2Error;
    if (n > 0 && names == NULL)
        return report(instance, fmi2Error, "fmi2SetDebugLogging: the list of categories is NULL");
    instance->logging = on != fmi2False;
    return fmi2OK;
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging) {
    Message message = "";
    Instance *instance;
    (void)visible;
    if (host == NULL)
        return NULL;
    if (name == NULL || *name == '\0')
        snprintf(message, sizeof message, "fmi2Instantiate: the instance of %s has no name", model_name);
    else if (type != fmi2CoSimulation)
        snprintf(message, sizeof message, "fmi2Instantiate: %s is made for co-simulation only", model_name);
    else if (guid == NULL || strcmp(guid, model_guid) != 0)
        snprintf(message, sizeof message,
                 "fmi2Instantiate: GUID %.100s does not belong to this build of %s, which has %s",
                 guid == NULL ? "NULL" : guid, model_name, model_guid);
    if (*message != '\0') {
        deliver(host, name == NULL ? "" : name, fmi2Error, message);
        return NULL;
    }
    instance = calloc(1, sizeof *instance);
    if (instance == NULL || (instance->name = malloc(strlen(name) + 1)) == NULL) {
        deliver(host, name, fmi2Error, "fmi2Instantiate: out of memory");
        free(instance);
        return NULL;
    }
    strcpy(instance->name, name);
    instance->host = *host;
    instance->logging = logging != fmi2False;
    reset(instance);
    instance->engine = engine_create(instance->now.memory, resources, message);
    if (instance->engine == NULL) {
        report(instance, fmi2Error, "%s", message);
        fmi2FreeInstance(instance);
        return NULL;
    }
    return instance;
}

EXPORT void fmi2FreeInstance(fmi2Component c) {
    Instance *instance = c;
    if (instance == NULL)
        return;
    if (instance->engine != NULL)
        engine_free(instance->engine);
    free(instance->name);
    free(instance);
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                                      fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop) {
    Instance *instance = c;
    double *memory;
    if (!allowed(instance, INSTANTIATED, "fmi2SetupExperiment"))
        return fmi2Error;
    if (!isfinite(start))
        return report(instance, fmi2Error, "fmi2SetupExperiment: start time %g is not a finite number", start);
    if (stop_defined && !(isfinite(stop) && stop > start))
        return report(instance, fmi2Error, "fmi2SetupExperiment: stop time %g s must be after the start time %g s",
                      stop, start);
    if (tolerance_defined && !(isfinite(tolerance) && tolerance > 0.0))
        return report(instance, fmi2Error, "fmi2SetupExperiment: tolerance %g must be a positive number", tolerance);
    memory = instance->now.memory;
    instance->now.time = memory[MEMORY_START_TIME] = start;
    instance->now.stop_time = stop_defined ? stop : INFINITY;
    /* The host may ask for more accuracy than the model's own, down to what rounding errors permit, never for less. */
    memory[MEMORY_TOLERANCE] = tolerance_defined ? fmin(fmax(tolerance, 1e-12), model_tolerance) : model_tolerance;
    touch(instance, false);
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Instance *instance = c;
    if (!allowed(instance, INSTANTIATED, "fmi2EnterInitializationMode"))
        return fmi2Error;
    instance->now.mode = INITIALIZATION;
    return fmi2OK;
}

/* Every parameter outside its range and every useless sample period gets its own line. */
static bool parameters_valid(const Instance *instance) {
    const double *memory = instance->now.memory;
    bool valid = true;
    for (int i = FIRST_PARAMETER; i < FIRST_INPUT; i++) {
        const Variable *v = &model_variables[i];
        bool plain = strcmp(v->unit, "1") == 0; /* a number without a unit */
        const char *gap = plain ? "" : " ", *unit = plain ? "" : v->unit;
        if (memory[i] >= v->minimum && memory[i] <= v->maximum)
            continue;
        report(instance, fmi2Error, "parameter '%s' = %.10g%s%s is outside its range [%.10g, %.10g]%s%s", v->name,
               memory[i], gap, unit, v->minimum, v->maximum, gap, unit);
        valid = false;
    }
    for (int i = 0; i < MODEL_GROUPS; i++) {
        int parameter = model_groups[i].period_parameter;
        if (parameter < 0 || memory[parameter] > 0.0)
            continue;
        report(instance, fmi2Error, "parameter '%s' = %.10g s is a sample period and must be greater than 0",
               model_variables[parameter].name, memory[parameter]);
        valid = false;
    }
    return valid;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *instance = c;
    Message message = "";
    if (!allowed(instance, INITIALIZATION, "fmi2ExitInitializationMode") || !parameters_valid(instance))
        return fmi2Error;
    instance->before = instance->now;
    if (!engine_initialize(instance->engine, message)) {
        report(instance, fmi2Error, "initialization failed: %s", message);
        return fail(instance);
    }
    touch(instance, false);
    if (refresh_outputs(instance) != fmi2OK || refresh_derivatives(instance) != fmi2OK)
        return fail(instance);
    instance->now.mode = STEP_COMPLETE;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c) {
    Instance *instance = c;
    if (!allowed(instance, STEP_COMPLETE | FAILED, "fmi2Terminate"))
        return fmi2Error;
    instance->now.mode = TERMINATED;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component c) {
    Instance *instance = c;
    if (!allowed(instance, ANY_MODE, "fmi2Reset"))
        return fmi2Error;
    reset(instance);
    return fmi2OK;
}

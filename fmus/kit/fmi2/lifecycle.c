/* FMI 2.0: creation, initialization and end of an instance. */
#include "evaluate.h"
#include "instance.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void reset(Instance *instance) {
    State *now = &instance->now;
    memset(now, 0, sizeof *now);
    now->mode = INSTANTIATED;
    now->stop_time = INFINITY;
    for (int i = 0; i < MODEL_VARIABLES; i++)
        now->memory[i] = model_variables[i].start;
    now->memory[MEMORY_HINT] = INFINITY;
    now->memory[MEMORY_TOLERANCE] = model_tolerance;
    for (int i = 0; i < MODEL_TEXTS; i++)
        snprintf(instance->texts[i], TEXT_SIZE, "%s", model_texts[i].start);
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
    else if (type != fmi2CoSimulation && !(engine_exchanges && type == fmi2ModelExchange))
        snprintf(message, sizeof message, "fmi2Instantiate: %s is made for co-simulation%s, not for type %d", model_name,
                 engine_exchanges ? " and model exchange" : "", (int)type);
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
    memcpy(&instance->host, host, sizeof instance->host); /* FMI 2.0.0 has constant fields, which cannot be assigned */
    instance->logging = logging != fmi2False;
    instance->type = type;
    reset(instance);
    instance->engine = engine_create(instance->now.memory, (const TextValue *)instance->texts, resources, message);
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
    instance->now.mode = instance->type == fmi2ModelExchange ? EVENT : STEP_COMPLETE;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c) {
    Instance *instance = c;
    if (!allowed(instance, RUNNING | FAILED, "fmi2Terminate"))
        return fmi2Error;
    engine_terminate(instance->engine);
    instance->now.mode = TERMINATED;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component c) {
    Instance *instance = c;
    if (!allowed(instance, ANY_MODE, "fmi2Reset"))
        return fmi2Error;
    engine_terminate(instance->engine);
    reset(instance);
    return fmi2OK;
}

/* Creation, initialization and end of an instance. */
#include "lifecycle.h"
#include "evaluate.h"

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

EXPORT const char *FMI(GetVersion)(void) { return FMI(Version); }

EXPORT Status FMI(SetDebugLogging)(void *c, FMI(Boolean) on, size_t n, const FMI(String) names[]) {
    Instance *instance = c;
    if (!allowed(instance, ANY_MODE, __func__))
        return FMI(Error);
    if (n > 0 && names == NULL)
        return report(instance, FMI(Error), "%s: the list of categories is NULL", __func__);
    instance->logging = on;
    return FMI(OK);
}

Instance *instance_create(const char *function, const Host *host, Integrator integrator, const char *name, const char *guid,
                 const char *resources, bool logging) {
    Message message = "";
    Instance *instance;
    if (name == NULL || *name == '\0')
        snprintf(message, sizeof message, "%s: the instance of %s has no name", function, model_name);
    else if (guid == NULL || strcmp(guid, model_guid) != 0)
        snprintf(message, sizeof message, "%s: " GUID_NAME " %.100s does not belong to this build of %s, which has %s",
                 function, guid == NULL ? "NULL" : guid, model_name, model_guid);
    if (*message != '\0') {
        deliver(host, name == NULL ? "" : name, FMI(Error), message);
        return NULL;
    }
    instance = calloc(1, sizeof *instance);
    if (instance == NULL || (instance->name = malloc(strlen(name) + 1)) == NULL) {
        snprintf(message, sizeof message, "%s: out of memory", function);
        deliver(host, name, FMI(Error), message);
        free(instance);
        return NULL;
    }
    strcpy(instance->name, name);
    memcpy(&instance->host, host, sizeof instance->host); /* FMI 2.0.0 has constant fields, which cannot be assigned */
    instance->logging = logging;
    instance->integrator = integrator;
    reset(instance);
    instance->engine = engine_create(instance->now.memory, (const TextValue *)instance->texts, resources, message);
    if (instance->engine == NULL) {
        report(instance, FMI(Error), "%s", message);
        FMI(FreeInstance)(instance);
        return NULL;
    }
    return instance;
}

EXPORT void FMI(FreeInstance)(void *c) {
    Instance *instance = c;
    if (instance == NULL)
        return;
    if (instance->engine != NULL)
        engine_free(instance->engine);
    free(instance->name);
    free(instance);
}

Status set_up(Instance *instance, const char *function, bool tolerance_defined, double tolerance, double start,
              bool stop_defined, double stop) {
    double *memory;
    if (!allowed(instance, INSTANTIATED, function))
        return FMI(Error);
    if (!isfinite(start))
        return report(instance, FMI(Error), "%s: start time %g is not a finite number", function, start);
    if (stop_defined && !(isfinite(stop) && stop > start))
        return report(instance, FMI(Error), "%s: stop time %g s must be after the start time %g s", function, stop,
                      start);
    if (tolerance_defined && !(isfinite(tolerance) && tolerance > 0.0))
        return report(instance, FMI(Error), "%s: tolerance %g must be a positive number", function, tolerance);
    memory = instance->now.memory;
    instance->now.time = memory[MEMORY_START_TIME] = start;
    instance->now.stop_time = stop_defined ? stop : INFINITY;
    /* The host may ask for more accuracy than the model's own, down to what rounding errors permit, never for less. */
    memory[MEMORY_TOLERANCE] = tolerance_defined ? fmin(fmax(tolerance, 1e-12), model_tolerance) : model_tolerance;
    touch(instance, false);
    return FMI(OK);
}

bool in_range(const Instance *instance, const Variable *parameter, double value) {
    bool plain = strcmp(parameter->unit, "1") == 0; /* a number without a unit */
    const char *gap = plain ? "" : " ", *unit = plain ? "" : parameter->unit;
    if (value >= parameter->minimum && value <= parameter->maximum)
        return true;
    report(instance, FMI(Error), "parameter '%s' = %.10g%s%s is outside its range [%.10g, %.10g]%s%s", parameter->name,
           value, gap, unit, parameter->minimum, parameter->maximum, gap, unit);
    return false;
}

/* Every parameter outside its range and every useless sample period gets its own line. */
static bool parameters_valid(const Instance *instance) {
    const double *memory = instance->now.memory;
    bool valid = true;
    for (int i = FIRST_PARAMETER; i < FIRST_INPUT; i++)
        valid &= in_range(instance, &model_variables[i], memory[i]);
    for (int i = 0; i < MODEL_GROUPS; i++) {
        int parameter = model_groups[i].period_parameter;
        if (parameter < 0 || memory[parameter] > 0.0)
            continue;
        report(instance, FMI(Error), "parameter '%s' = %.10g s is a sample period and must be greater than 0",
               model_variables[parameter].name, memory[parameter]);
        valid = false;
    }
    return valid;
}

EXPORT Status FMI(ExitInitializationMode)(void *c) {
    Instance *instance = c;
    Message message = "";
    if (!allowed(instance, INITIALIZATION, __func__) || !parameters_valid(instance))
        return FMI(Error);
    instance->before = instance->now;
    if (!engine_initialize(instance->engine, message)) {
        report(instance, FMI(Error), "initialization failed: %s", message);
        return fail(instance);
    }
    touch(instance, false);
    if (refresh_outputs(instance) != FMI(OK) || refresh_derivatives(instance) != FMI(OK))
        return fail(instance);
    instance->now.mode = handles_events(instance) ? EVENT : STEP_COMPLETE;
    return FMI(OK);
}

EXPORT Status FMI(Terminate)(void *c) {
    Instance *instance = c;
    if (!allowed(instance, RUNNING | FAILED, __func__))
        return FMI(Error);
    engine_terminate(instance->engine);
    instance->now.mode = TERMINATED;
    return FMI(OK);
}

EXPORT Status FMI(Reset)(void *c) {
    Instance *instance = c;
    if (!allowed(instance, ANY_MODE, __func__))
        return FMI(Error);
    engine_terminate(instance->engine);
    reset(instance);
    return FMI(OK);
}

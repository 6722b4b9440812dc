/* FMI 2.0: functions of both co-simulation and model exchange whose form is of this version. */
#include "derivatives.h"
#include "lifecycle.h"
#include "values.h"

#include <stdio.h>

EXPORT const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging) {
    Integrator integrator = type == fmi2ModelExchange ? HOST_INTEGRATES : INSTANCE_INTEGRATES;
    (void)visible;
    if (host == NULL)
        return NULL;
    if (type != fmi2CoSimulation && !(engine_exchanges && type == fmi2ModelExchange)) {
        Message message;
        snprintf(message, sizeof message, "%s: %s is made for co-simulation%s, not for type %d", __func__, model_name,
                 engine_exchanges ? " and model exchange" : "", (int)type);
        deliver(host, name == NULL ? "" : name, fmi2Error, message);
        return NULL;
    }
    return instance_create(__func__, host, integrator, name, guid, resources, logging != fmi2False);
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                                      fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop) {
    return set_up(c, __func__, tolerance_defined != fmi2False, tolerance, start, stop_defined != fmi2False, stop);
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Instance *instance = c;
    if (!allowed(instance, INSTANTIATED, __func__))
        return fmi2Error;
    instance->now.mode = INITIALIZATION;
    return fmi2OK;
}

/* ---- variables ---------------------------------------------------------------------------------- */

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    return get_reals(c, __func__, vr, n, value);
}

EXPORT fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
    return get_integers(c, __func__, vr, n, value);
}

EXPORT fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) {
    Instance *instance = c;
    fmi2Status status = readable(instance, __func__, TYPE_BOOLEAN, vr, n, value);
    for (size_t i = 0; i < n && status == fmi2OK; i++)
        value[i] = instance->now.memory[vr[i]] != 0.0 ? fmi2True : fmi2False;
    return status;
}

EXPORT fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
    return get_texts(c, __func__, vr, n, value);
}

static double real(const void *values, size_t i) { return ((const fmi2Real *)values)[i]; }

static double integer(const void *values, size_t i) { return ((const fmi2Integer *)values)[i]; }

static double boolean(const void *values, size_t i) { return ((const fmi2Boolean *)values)[i]; }

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    return set_numbers(c, __func__, TYPE_REAL, vr, n, value, real);
}

EXPORT fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
    return set_numbers(c, __func__, TYPE_INTEGER, vr, n, value, integer);
}

EXPORT fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) {
    return set_numbers(c, __func__, TYPE_BOOLEAN, vr, n, value, boolean);
}

EXPORT fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) {
    return set_texts(c, __func__, vr, n, value);
}

EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t n_unknowns,
                                               const fmi2ValueReference knowns[], size_t n_knowns,
                                               const fmi2Real seeds[], fmi2Real results[]) {
    return directional(c, &(Partials){__func__, unknowns, n_unknowns, knowns, n_knowns}, seeds, results);
}

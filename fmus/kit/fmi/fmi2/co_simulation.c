/* FMI 2.0 co-simulation: the step in time and what belongs to it. */
#include "instance.h"
#include "step.h"

#include <math.h>

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set_state) {
    Instance *instance = c;
    (void)no_set_state;
    if (!allowed(instance, STEP_COMPLETE, __func__) || !step_valid(instance, __func__, time, step))
        return fmi2Error;
    return advance(instance, time, step);
}

EXPORT fmi2Status fmi2CancelStep(fmi2Component c) {
    Instance *instance = c;
    if (instance == NULL)
        return fmi2Error;
    return report(instance, fmi2Error, "%s: steps are never pending", __func__);
}

/* The slopes hold for the next step only, see follow_slopes. */
EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                              const fmi2Integer order[], const fmi2Real value[]) {
    Instance *instance = c;
    if (!allowed(instance, BEFORE_START | STEP_COMPLETE, __func__))
        return fmi2Error;
    if (instance->integrator == HOST_INTEGRATES)
        return report(instance, fmi2Error, "%s: this instance of %s was made for model exchange", __func__, model_name);
    if (!engine_interpolates)
        return report(instance, fmi2Error, "%s is not supported by this build of %s", __func__, model_name);
    if (n > 0 && (vr == NULL || order == NULL || value == NULL))
        return report(instance, fmi2Error, "%s: an array is NULL though it should have %zu elements", __func__, n);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= MODEL_VARIABLES || model_variables[vr[i]].role != ROLE_INPUT ||
            model_variables[vr[i]].type != TYPE_REAL)
            return report(instance, fmi2Error, "%s: value reference %u is not a Real input", __func__, vr[i]);
        if (order[i] != 1)
            return report(instance, fmi2Error, "%s: order %d of '%s' is not supported, only order 1", __func__,
                          order[i], model_variables[vr[i]].name);
        if (!isfinite(value[i]))
            return report(instance, fmi2Error, "%s: derivative %g of '%s' is not a finite number", __func__, value[i],
                          model_variables[vr[i]].name);
    }
    for (size_t i = 0; i < n; i++)
        instance->now.memory[MEMORY_SLOPES + (int)vr[i] - FIRST_INPUT] = value[i];
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                               const fmi2Integer order[], fmi2Real value[]) {
    Instance *instance = c;
    (void)vr;
    (void)order;
    (void)value;
    if (!allowed(instance, READABLE, __func__))
        return fmi2Error;
    return n == 0 ? fmi2OK : report(instance, fmi2Error, "%s is not supported", __func__);
}

/* ---- status ------------------------------------------------------------------------------------- */

static fmi2Status discard(Instance *instance, const char *function, const void *value) {
    if (!allowed(instance, ANY_MODE, function))
        return fmi2Error;
    if (value == NULL)
        return report(instance, fmi2Error, "%s: the pointer to the value is NULL", function);
    return report(instance, fmi2Discard, "%s: this status is not available, for steps are never pending", function);
}

EXPORT fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)kind;
    return discard(c, __func__, value);
}

EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    Instance *instance = c;
    if (kind != fmi2LastSuccessfulTime || instance == NULL || value == NULL)
        return discard(instance, __func__, value);
    *value = instance->now.time;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)kind;
    return discard(c, __func__, value);
}

EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    Instance *instance = c;
    if (kind != fmi2Terminated || instance == NULL || value == NULL)
        return discard(instance, __func__, value);
    *value = fmi2False; /* the model never asks for the end of the simulation */
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)kind;
    return discard(c, __func__, value);
}

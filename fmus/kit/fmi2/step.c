/* FMI 2.0 co-simulation: the step in time and what belongs to it. */
#include "evaluate.h"
#include "instance.h"

#include <math.h>
#include <stdio.h>

static bool step_valid(const Instance *instance, double time, double step) {
    const State *now = &instance->now;
    double slack = 1e-9 * fmax(1.0, fabs(time)) + 1e-6 * step; /* hosts add up steps and round */
    if (!isfinite(time) || !isfinite(step) || step <= 0.0)
        report(instance, fmi2Error, "fmi2DoStep: time %g s and step %g s must be finite numbers, the step positive",
               time, step);
    else if (fabs(time - now->time) > slack)
        report(instance, fmi2Error, "fmi2DoStep: the step begins at %.15g s but the instance is at %.15g s", time,
               now->time);
    else if (!isfinite(time + step) || time + step == time)
        report(instance, fmi2Error, "fmi2DoStep: a step of %g s cannot be represented at t = %.10g s", step, time);
    else if (time + step > now->stop_time + slack)
        report(instance, fmi2Error, "fmi2DoStep: the step ends at %.15g s, after the stop time %.15g s", time + step,
               now->stop_time);
    else
        return true;
    return false;
}

/* The end point becomes the value that is held: an input with a slope has no jump when the next step begins. */
static void follow_slopes(double *memory, double step) {
    for (int i = 0; i < MODEL_INPUTS; i++) {
        memory[FIRST_INPUT + i] += memory[MEMORY_SLOPES + i] * step;
        memory[MEMORY_SLOPES + i] = 0.0;
    }
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set_state) {
    Instance *instance = c;
    Message message;
    message[0] = 0;
    (void)no_set_state;
    if (!allowed(instance, STEP_COMPLETE, "fmi2DoStep") || !step_valid(instance, time, step))
        return fmi2Error;
    instance->before = instance->now;
    if (!engine_advance(instance->engine, time, step, message)) {
        report(instance, fmi2Error, "step from %.10g s to %.10g s failed: %s", time, time + step, message);
        return fail(instance);
    }
    if (*message != '\0') { /* told whether or not logging is on: what is to be done was not done */
        Message text;
        snprintf(text, sizeof text, "step from %.10g s to %.10g s: %.900s", time, time + step, message);
        deliver(&instance->host, instance->name, fmi2Warning, text);
    }
    instance->now.time = time + step;
    follow_slopes(instance->now.memory, step);
    touch(instance, false);
    if (!all_finite(instance, FIRST_INPUT, FIRST_OUTPUT) || refresh_outputs(instance) != fmi2OK)
        return fail(instance);
    return fmi2OK;
}

EXPORT fmi2Status fmi2CancelStep(fmi2Component c) {
    Instance *instance = c;
    if (instance == NULL)
        return fmi2Error;
    return report(instance, fmi2Error, "fmi2CancelStep: steps are never pending");
}

/* The slopes hold for the next step only, see follow_slopes. */
EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                              const fmi2Integer order[], const fmi2Real value[]) {
    static const char function[] = "fmi2SetRealInputDerivatives";
    Instance *instance = c;
    if (!allowed(instance, BEFORE_START | STEP_COMPLETE, function))
        return fmi2Error;
    if (instance->type == fmi2ModelExchange)
        return report(instance, fmi2Error, "%s: this instance of %s was made for model exchange", function, model_name);
    if (!engine_interpolates)
        return report(instance, fmi2Error, "%s is not supported by this build of %s", function, model_name);
    if (n > 0 && (vr == NULL || order == NULL || value == NULL))
        return report(instance, fmi2Error, "%s: an array is NULL though it should have %zu elements", function, n);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= MODEL_VARIABLES || model_variables[vr[i]].role != ROLE_INPUT ||
            model_variables[vr[i]].type != TYPE_REAL)
            return report(instance, fmi2Error, "%s: value reference %u is not a Real input", function, vr[i]);
        if (order[i] != 1)
            return report(instance, fmi2Error, "%s: order %d of '%s' is not supported, only order 1", function,
                          order[i], model_variables[vr[i]].name);
        if (!isfinite(value[i]))
            return report(instance, fmi2Error, "%s: derivative %g of '%s' is not a finite number", function, value[i],
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
    if (!allowed(instance, READABLE, "fmi2GetRealOutputDerivatives"))
        return fmi2Error;
    return n == 0 ? fmi2OK : report(instance, fmi2Error, "fmi2GetRealOutputDerivatives is not supported");
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
    return discard(c, "fmi2GetStatus", value);
}

EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    Instance *instance = c;
    if (kind != fmi2LastSuccessfulTime || instance == NULL || value == NULL)
        return discard(instance, "fmi2GetRealStatus", value);
    *value = instance->now.time;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)kind;
    return discard(c, "fmi2GetIntegerStatus", value);
}

EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    Instance *instance = c;
    if (kind != fmi2Terminated || instance == NULL || value == NULL)
        return discard(instance, "fmi2GetBooleanStatus", value);
    *value = fmi2False; /* the model never asks for the end of the simulation */
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)kind;
    return discard(c, "fmi2GetStringStatus", value);
}

/* Model exchange: the host integrates the states; samples are time events, switches of laws have indicators. */
#include "exchange.h"
#include "evaluate.h"

#include <math.h>
#include <string.h>

bool host_integrates(const Instance *instance, int modes, const char *function) {
    if (!allowed(instance, modes, function))
        return false;
    if (instance->integrator != HOST_INTEGRATES)
        report(instance, FMI(Error), "%s: this instance of %s was made for co-simulation", function, model_name);
    return instance->integrator == HOST_INTEGRATES;
}

/* Whether the host passed an array of the size that there is. */
static bool sized(const Instance *instance, const char *function, const double *values, size_t n, size_t size) {
    if (n != size)
        report(instance, FMI(Error), "%s: an array of %zu elements, but there are %zu", function, n, size);
    else if (n > 0 && values == NULL)
        report(instance, FMI(Error), "%s: an array is NULL though it should have %zu elements", function, n);
    else
        return true;
    return false;
}

/* ---- time and states ---------------------------------------------------------------------------- */

EXPORT Status FMI(SetTime)(void *c, double time) {
    Instance *instance = c;
    if (!host_integrates(instance, EVENT | CONTINUOUS, __func__))
        return FMI(Error);
    if (!isfinite(time))
        return report(instance, FMI(Error), "%s: %g is not a finite number", __func__, time);
    instance->now.time = time;
    touch(instance, false);
    return FMI(OK);
}

EXPORT Status FMI(SetContinuousStates)(void *c, const double x[], size_t n) {
    Instance *instance = c;
    if (!host_integrates(instance, EVENT | CONTINUOUS, __func__) || !sized(instance, __func__, x, n, MODEL_STATES))
        return FMI(Error);
    for (size_t i = 0; i < n; i++)
        if (!isfinite(x[i])) /* a trial of the host's solver, which can try a shorter step */
            return report(instance, FMI(Discard), "%s: '%s' = %g is not a finite number", __func__,
                          model_variables[FIRST_STATE + i].name, x[i]);
    if (n > 0)
        memcpy(instance->now.memory + FIRST_STATE, x, n * sizeof *x);
    touch(instance, false);
    return FMI(OK);
}

EXPORT Status FMI(GetContinuousStates)(void *c, double x[], size_t n) {
    Instance *instance = c;
    if (!host_integrates(instance, READABLE, __func__) || !sized(instance, __func__, x, n, MODEL_STATES))
        return FMI(Error);
    if (n > 0)
        memcpy(x, instance->now.memory + FIRST_STATE, n * sizeof *x);
    return FMI(OK);
}

EXPORT Status FMI(GetNominalsOfContinuousStates)(void *c, double nominal[], size_t n) {
    Instance *instance = c;
    if (!host_integrates(instance, ANY_MODE, __func__) || !sized(instance, __func__, nominal, n, MODEL_STATES))
        return FMI(Error);
    for (size_t i = 0; i < n; i++)
        nominal[i] = model_variables[FIRST_STATE + i].nominal;
    return FMI(OK);
}

EXPORT Status FMI(GetContinuousStateDerivatives)(void *c, double rate[], size_t n) {
    Instance *instance = c;
    Status status;
    if (!host_integrates(instance, READABLE, __func__) || !sized(instance, __func__, rate, n, MODEL_STATES))
        return FMI(Error);
    status = refresh_derivatives(instance);
    if (status == FMI(OK) && n > 0)
        memcpy(rate, instance->now.memory + FIRST_DERIVATIVE, n * sizeof *rate);
    return status;
}

/* ---- events ------------------------------------------------------------------------------------- */

/* Indicators are of order one, so this is near to zero. Where a law rests at a switch, as a current at its limit, solvers
   would find roots without end: an indicator that near has the sign it had at the latest event. */
static const double near_zero = 1e-10;

static void keep_off_zero(Instance *instance, double z[]) {
    double *sides = instance->now.sides;
    for (int i = 0; i < MODEL_INDICATORS; i++) {
        double size = fabs(z[i]); /* a NaN is on no side */
        if (size >= near_zero && instance->now.mode != CONTINUOUS)
            sides[i] = copysign(1.0, z[i]);
        else if (size < near_zero)
            z[i] = copysign(near_zero, sides[i]);
    }
}

bool indicate(Instance *instance, double z[]) {
    if (!engine_indicate(instance->engine, instance->now.time, z))
        return false;
    keep_off_zero(instance, z);
    return true;
}

EXPORT Status FMI(GetEventIndicators)(void *c, double z[], size_t n) {
    Instance *instance = c;
    if (!host_integrates(instance, READABLE, __func__) || !sized(instance, __func__, z, n, MODEL_INDICATORS))
        return FMI(Error);
    if (n > 0 && !indicate(instance, z))
        return report(instance, FMI(Error), "%s: the law could not be evaluated", __func__);
    return FMI(OK);
}

EXPORT Status FMI(EnterContinuousTimeMode)(void *c) {
    Instance *instance = c;
    double z[MODEL_INDICATORS + 1];
    if (!host_integrates(instance, EVENT, __func__))
        return FMI(Error);
    indicate(instance, z); /* for the sides */
    instance->now.mode = CONTINUOUS;
    return FMI(OK);
}

EXPORT Status FMI(CompletedIntegratorStep)(void *c, FMI(Boolean) no_set_state, FMI(Boolean) *event,
                                              FMI(Boolean) *terminate) {
    Instance *instance = c;
    (void)no_set_state;
    if (!host_integrates(instance, CONTINUOUS, __func__))
        return FMI(Error);
    if (event == NULL || terminate == NULL)
        return report(instance, FMI(Error), "%s: a pointer is NULL", __func__);
    *event = *terminate = false;
    return FMI(OK);
}

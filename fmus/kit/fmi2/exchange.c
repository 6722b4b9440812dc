/* FMI 2.0 model exchange: the host integrates the states; samples are time events, switches of laws have indicators. */
#include "evaluate.h"
#include "instance.h"
#include "native.h"

#include <math.h>
#include <string.h>

static Law indicators;

static bool host_integrates(const Instance *instance, int modes, const char *function) {
    if (!allowed(instance, modes, function))
        return false;
    if (instance->type != fmi2ModelExchange)
        report(instance, fmi2Error, "%s: this instance of %s was made for co-simulation", function, model_name);
    return instance->type == fmi2ModelExchange;
}

/* Whether the host passed an array of the size that there is. */
static bool sized(const Instance *instance, const char *function, const double *values, size_t n, size_t size) {
    if (n != size)
        report(instance, fmi2Error, "%s: an array of %zu elements, but there are %zu", function, n, size);
    else if (n > 0 && values == NULL)
        report(instance, fmi2Error, "%s: an array is NULL though it should have %zu elements", function, n);
    else
        return true;
    return false;
}

/* ---- time and states ---------------------------------------------------------------------------- */

EXPORT fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    Instance *instance = c;
    if (!host_integrates(instance, EVENT | CONTINUOUS, "fmi2SetTime"))
        return fmi2Error;
    if (!isfinite(time))
        return report(instance, fmi2Error, "fmi2SetTime: %g is not a finite number", time);
    instance->now.time = time;
    touch(instance, false);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
    static const char function[] = "fmi2SetContinuousStates";
    Instance *instance = c;
    if (!host_integrates(instance, EVENT | CONTINUOUS, function) || !sized(instance, function, x, n, MODEL_STATES))
        return fmi2Error;
    for (size_t i = 0; i < n; i++)
        if (!isfinite(x[i])) /* a trial of the host's solver, which can try a shorter step */
            return report(instance, fmi2Discard, "%s: '%s' = %g is not a finite number", function,
                          model_variables[FIRST_STATE + i].name, x[i]);
    if (n > 0)
        memcpy(instance->now.memory + FIRST_STATE, x, n * sizeof *x);
    touch(instance, false);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    static const char function[] = "fmi2GetContinuousStates";
    Instance *instance = c;
    if (!host_integrates(instance, READABLE, function) || !sized(instance, function, x, n, MODEL_STATES))
        return fmi2Error;
    if (n > 0)
        memcpy(x, instance->now.memory + FIRST_STATE, n * sizeof *x);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominal[], size_t n) {
    static const char function[] = "fmi2GetNominalsOfContinuousStates";
    Instance *instance = c;
    if (!host_integrates(instance, ANY_MODE, function) || !sized(instance, function, nominal, n, MODEL_STATES))
        return fmi2Error;
    for (size_t i = 0; i < n; i++)
        nominal[i] = model_variables[FIRST_STATE + i].nominal;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real rate[], size_t n) {
    static const char function[] = "fmi2GetDerivatives";
    Instance *instance = c;
    fmi2Status status;
    if (!host_integrates(instance, READABLE, function) || !sized(instance, function, rate, n, MODEL_STATES))
        return fmi2Error;
    status = refresh_derivatives(instance);
    if (status == fmi2OK && n > 0)
        memcpy(rate, instance->now.memory + FIRST_DERIVATIVE, n * sizeof *rate);
    return status;
}

/* ---- events ------------------------------------------------------------------------------------- */

EXPORT fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) {
    static const char function[] = "fmi2GetEventIndicators";
    Instance *instance = c;
    Engine *engine;
    if (!host_integrates(instance, READABLE, function) || !sized(instance, function, z, n, MODEL_INDICATORS))
        return fmi2Error;
    if (n == 0)
        return fmi2OK;
    engine = instance->engine;
    engine->sloped = false;
    bind(engine, instance->now.time, engine->memory + FIRST_STATE);
    engine->res[0] = z;
    return call(engine, indicators) ? fmi2OK
                                    : report(instance, fmi2Error, "%s: the law could not be evaluated", function);
}

EXPORT fmi2Status fmi2EnterEventMode(fmi2Component c) {
    Instance *instance = c;
    if (!host_integrates(instance, EVENT | CONTINUOUS, "fmi2EnterEventMode"))
        return fmi2Error;
    instance->now.mode = EVENT;
    return fmi2OK;
}

/* +infinity where nothing is sampled. */
static double next_sample(const Engine *engine) {
    double next = INFINITY;
    for (int i = 0; i < MODEL_GROUPS; i++)
        next = fmin(next, sample_instant(engine, i));
    return next;
}

EXPORT fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *event) {
    static const char function[] = "fmi2NewDiscreteStates";
    Instance *instance = c;
    Message message = "";
    double next;
    if (!host_integrates(instance, EVENT, function))
        return fmi2Error;
    if (event == NULL)
        return report(instance, fmi2Error, "%s: the pointer to the event is NULL", function);
    instance->before = instance->now;
    instance->engine->sloped = false;
    if (!sample(instance->engine, instance->now.time, instance->now.time, &next, message)) {
        report(instance, fmi2Error, "event at %.10g s failed: %s", instance->now.time, message);
        return fail(instance);
    }
    touch(instance, false);
    if (!all_finite(instance, FIRST_DISCRETE, FIRST_OUTPUT))
        return fail(instance);
    event->nextEventTime = next_sample(instance->engine);
    event->nextEventTimeDefined = isfinite(event->nextEventTime) ? fmi2True : fmi2False;
    /* of a host that comes late, as those of fixed steps do: what it has missed is sampled now, one after the other */
    event->newDiscreteStatesNeeded = event->nextEventTime <= instance->now.time ? fmi2True : fmi2False;
    event->terminateSimulation = fmi2False;
    /* Rates jump at every event: at a sample, where a law switches, where the host's input does. Some hosts restart their
       solvers only if told that values or nominals have changed; to read the nominals again costs nothing. */
    event->nominalsOfContinuousStatesChanged = fmi2True;
    event->valuesOfContinuousStatesChanged = fmi2False; /* a sample changes what is sampled, never a state */
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    Instance *instance = c;
    if (!host_integrates(instance, EVENT, "fmi2EnterContinuousTimeMode"))
        return fmi2Error;
    instance->now.mode = CONTINUOUS;
    return fmi2OK;
}

EXPORT fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_set_state, fmi2Boolean *event,
                                              fmi2Boolean *terminate) {
    Instance *instance = c;
    (void)no_set_state;
    if (!host_integrates(instance, CONTINUOUS, "fmi2CompletedIntegratorStep"))
        return fmi2Error;
    if (event == NULL || terminate == NULL)
        return report(instance, fmi2Error, "fmi2CompletedIntegratorStep: a pointer is NULL");
    *event = *terminate = fmi2False;
    return fmi2OK;
}

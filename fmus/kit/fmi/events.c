/* Event mode: samples are time events. */
#include "evaluate.h"
#include "exchange.h"

#include <math.h>

static bool enters_events(const Instance *instance, int modes, const char *function) {
    if (!allowed(instance, modes, function))
        return false;
    if (!handles_events(instance))
        report(instance, FMI(Error), "%s: this instance of %s was made for co-simulation" WITHOUT_EVENTS, function,
               model_name);
    return handles_events(instance);
}

/* Gives discrete inputs the values that were set in continuous-time mode. */
static void take_changes(State *now) {
    for (int i = 0; i < MODEL_INPUTS; i++) {
        now->memory[FIRST_INPUT + i] += now->changes[i];
        now->changes[i] = 0.0;
    }
}

EXPORT Status FMI(EnterEventMode)(void *c) {
    Instance *instance = c;
    if (!enters_events(instance, RUNNING, __func__))
        return FMI(Error);
    if (instance->now.mode == CONTINUOUS) {
        take_changes(&instance->now);
        touch(instance, false);
    }
    instance->now.mode = EVENT;
    return FMI(OK);
}

static double next_sample(const Instance *instance) {
    double next = INFINITY;
    for (int i = 0; i < MODEL_GROUPS; i++)
        next = fmin(next, instant_of(instance, i));
    return next;
}

Status update_discretes(Instance *instance, const char *function, double *next) {
    Message message = "";
    if (!enters_events(instance, EVENT, function))
        return FMI(Error);
    instance->before = instance->now;
    if (MODEL_GROUPS > 0 && !engine_advance(instance->engine, instance->now.time, 0.0, message)) {
        report(instance, FMI(Error), "event at %.10g s failed: %s", instance->now.time, message);
        return fail(instance);
    }
    touch(instance, false);
    if (!all_finite(instance, FIRST_DISCRETE, FIRST_OUTPUT))
        return fail(instance);
    *next = next_sample(instance);
    return FMI(OK);
}

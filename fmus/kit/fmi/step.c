/* The step in time of co-simulation. */
#include "step.h"
#include "evaluate.h"

#include <math.h>
#include <stdio.h>

bool step_valid(const Instance *instance, const char *function, double time, double step) {
    const State *now = &instance->now;
    double slack = 1e-9 * fmax(1.0, fabs(time)) + 1e-6 * step; /* hosts add up steps and round */
    if (!isfinite(time) || !isfinite(step) || step <= 0.0)
        report(instance, FMI(Error), "%s: time %g s and step %g s must be finite numbers, the step positive", function,
               time, step);
    else if (fabs(time - now->time) > slack)
        report(instance, FMI(Error), "%s: the step begins at %.15g s but the instance is at %.15g s", function, time,
               now->time);
    else if (!isfinite(time + step) || time + step == time)
        report(instance, FMI(Error), "%s: a step of %g s cannot be represented at t = %.10g s", function, step, time);
    else if (time + step > now->stop_time + slack)
        report(instance, FMI(Error), "%s: the step ends at %.15g s, after the stop time %.15g s", function, time + step,
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

Status advance(Instance *instance, double time, double step) {
    Message message;
    message[0] = 0;
    instance->before = instance->now;
    if (!engine_advance(instance->engine, time, step, message)) {
        report(instance, FMI(Error), "step from %.10g s to %.10g s failed: %s", time, time + step, message);
        return fail(instance);
    }
    if (*message != '\0') { /* told whether or not logging is on: what is to be done was not done */
        Message text;
        snprintf(text, sizeof text, "step from %.10g s to %.10g s: %.900s", time, time + step, message);
        deliver(&instance->host, instance->name, FMI(Warning), text);
    }
    instance->now.time = time + step;
    follow_slopes(instance->now.memory, step);
    touch(instance, false);
    if (!all_finite(instance, FIRST_INPUT, FIRST_OUTPUT) || refresh_outputs(instance) != FMI(OK))
        return fail(instance);
    return FMI(OK);
}

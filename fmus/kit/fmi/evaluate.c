/* Evaluation of the laws where the instance is, when somebody wants to read the result. */
#include "evaluate.h"

#include <math.h>

/* A host that integrates can try a shorter step. */
static Status refused(const Instance *instance) {
    return instance->now.mode == CONTINUOUS ? FMI(Discard) : FMI(Error);
}

bool all_finite(const Instance *instance, int first, int end) {
    for (int i = first; i < end; i++)
        if (!isfinite(instance->now.memory[i])) {
            report(instance, refused(instance), "'%s' is not a finite number at t = %.10g s", model_variables[i].name,
                   instance->now.time);
            return false;
        }
    return true;
}

static Status evaluation_failed(const Instance *instance, const char *message) {
    return report(instance, refused(instance), "evaluation at t = %.10g s failed: %s", instance->now.time, message);
}

/* Whether outputs change by themselves: how old the values of a rig are goes on when a run has failed or is over. */
static bool outlives_its_run(const Instance *instance) {
    return !model_restorable && ((int)instance->now.mode & (FAILED | TERMINATED)) != 0;
}

Status refresh_outputs(Instance *instance) {
    Message message;
    message[0] = 0; /* not = "", which would clear all of it at every step */
    if (instance->now.outputs_outdated == 0.0 && !outlives_its_run(instance))
        return FMI(OK);
    if (!engine_evaluate(instance->engine, instance->now.time, message))
        return evaluation_failed(instance, message);
    if (!all_finite(instance, FIRST_OUTPUT, FIRST_DERIVATIVE))
        return refused(instance);
    instance->now.outputs_outdated = 0.0;
    return FMI(OK);
}

Status refresh_derivatives(Instance *instance) {
    Message message;
    message[0] = 0;
    if (instance->now.derivatives_outdated == 0.0)
        return FMI(OK);
    if (!engine_differentiate(instance->engine, instance->now.time, message))
        return evaluation_failed(instance, message);
    if (!all_finite(instance, FIRST_DERIVATIVE, MODEL_VARIABLES))
        return refused(instance);
    instance->now.derivatives_outdated = 0.0;
    return FMI(OK);
}

/* Partial derivatives: checks of a request, and its answer from the tangent of the laws. */
#include "derivatives.h"
#include "evaluate.h"
#include "values.h"

#include <math.h>

/* A parameter is known only during initialization, where states and discretes follow their start parameters. */
static bool known(const Instance *instance, Role role) {
    bool starting = instance->now.mode == INITIALIZATION;
    return role == ROLE_INPUT || (starting ? role == ROLE_PARAMETER : role == ROLE_STATE);
}

/* A state may be an output; it follows its own seed, and a discrete one nothing until its next sample instant. */
static bool unknown(Role role) { return role >= ROLE_STATE; }

bool answerable(const Instance *instance, const Partials *of, const void *of_knowns, const void *of_unknowns) {
    const char *function = of->function;
    if (!allowed(instance, READABLE, function))
        return false;
    if (!engine_differentiates) {
        report(instance, FMI(Error), "%s is not supported by this build of %s", function, model_name);
        return false;
    }
    if (!valid(instance, function, TYPE_REAL, of->unknowns, of->n_unknowns, of_unknowns) ||
        !valid(instance, function, TYPE_REAL, of->knowns, of->n_knowns, of_knowns))
        return false;
    for (size_t i = 0; i < of->n_unknowns; i++)
        if (!unknown(model_variables[of->unknowns[i]].role)) {
            report(instance, FMI(Error), "%s: '%s' is not an unknown here", function,
                   model_variables[of->unknowns[i]].name);
            return false;
        }
    for (size_t i = 0; i < of->n_knowns; i++)
        if (!known(instance, model_variables[of->knowns[i]].role)) {
            report(instance, FMI(Error), "%s: '%s' is not a known here", function,
                   model_variables[of->knowns[i]].name);
            return false;
        }
    return true;
}

bool add_seeds(const Instance *instance, const char *function, const Reference vr[], size_t n, const double seeds[],
               double seed[]) {
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(seeds[i])) {
            report(instance, FMI(Error), "%s: the seed %g of '%s' is not a finite number", function, seeds[i],
                   model_variables[vr[i]].name);
            return false;
        }
        seed[vr[i]] += seeds[i];
    }
    return true;
}

bool derivatives_finite(const Instance *instance, const char *function, const Reference vr[], size_t n,
                        const double results[]) {
    for (size_t i = 0; i < n; i++)
        if (!isfinite(results[i])) {
            report(instance, FMI(Error), "%s: the derivative of '%s' is not a finite number", function,
                   model_variables[vr[i]].name);
            return false;
        }
    return true;
}

Status directional(Instance *instance, const Partials *of, const double seeds[], double results[]) {
    double seed[MODEL_VARIABLES + 1] = {0.0}, result[MODEL_STATES + MODEL_OUTPUTS + 1] = {0.0};
    Message message = "";
    if (!answerable(instance, of, seeds, results) ||
        !add_seeds(instance, of->function, of->knowns, of->n_knowns, seeds, seed))
        return FMI(Error);
    if (instance->now.mode == INITIALIZATION)
        for (int i = 0; i < MODEL_STATES + MODEL_DISCRETES; i++)
            seed[FIRST_STATE + i] = seed[model_start_of[i]];
    if (!engine_tangent(instance->engine, instance->now.time, seed, result, message))
        return report(instance, FMI(Error), "%s: %s", of->function, message);
    for (size_t i = 0; i < of->n_unknowns; i++) {
        int index = (int)of->unknowns[i];
        Role role = model_variables[index].role;
        results[i] = role == ROLE_DERIVATIVE ? result[index - FIRST_DERIVATIVE]
                     : role == ROLE_OUTPUT   ? result[MODEL_STATES + index - FIRST_OUTPUT]
                                             : seed[index];
    }
    return derivatives_finite(instance, of->function, of->unknowns, of->n_unknowns, results) ? FMI(OK) : FMI(Error);
}

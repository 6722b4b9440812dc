/* Partial derivatives: checks of a request, and its answer from the tangent of the laws. */
#include "derivatives.h"
#include "evaluate.h"
#include "values.h"

#include <float.h>
#include <math.h>
#include <string.h>

int place_in_direction(Reference vr) { return is_time(vr) ? MODEL_VARIABLES : (int)vr; }

static const char *name_of(Reference vr) { return is_time(vr) ? "time" : model_variables[vr].name; }

/* A parameter is known only during initialization, where states and discretes follow their start parameters. */
static bool known(const Instance *instance, Reference vr) {
    bool starting = instance->now.mode == INITIALIZATION;
    Role role;
    if (is_time(vr))
        return true;
    role = model_variables[vr].role;
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
        !given(instance, function, of->knowns, of->n_knowns, of_knowns))
        return false;
    for (size_t i = 0; i < of->n_unknowns; i++)
        if (!unknown(model_variables[of->unknowns[i]].role)) {
            report(instance, FMI(Error), "%s: '%s' is not an unknown here", function,
                   model_variables[of->unknowns[i]].name);
            return false;
        }
    for (size_t i = 0; i < of->n_knowns; i++) {
        if (!is_time(of->knowns[i]) && !valid(instance, function, TYPE_REAL, of->knowns + i, 1, of_knowns))
            return false;
        if (!known(instance, of->knowns[i])) {
            report(instance, FMI(Error), "%s: '%s' is not a known here", function, name_of(of->knowns[i]));
            return false;
        }
    }
    return true;
}

bool add_seeds(const Instance *instance, const char *function, const Reference vr[], size_t n, const double seeds[],
               double seed[]) {
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(seeds[i])) {
            report(instance, FMI(Error), "%s: the seed %g of '%s' is not a finite number", function, seeds[i],
                   name_of(vr[i]));
            return false;
        }
        seed[place_in_direction(vr[i])] += seeds[i];
    }
    return true;
}

bool derivatives_finite(const Instance *instance, const char *function, const Reference vr[], size_t n,
                        const double results[]) {
    for (size_t i = 0; i < n; i++)
        if (!isfinite(results[i])) {
            report(instance, FMI(Error), "%s: the derivative of '%s' is not a finite number", function, name_of(vr[i]));
            return false;
        }
    return true;
}

/* ---- rates and outputs in a direction ----------------------------------------------------------- */

enum { LAWS = MODEL_STATES + MODEL_OUTPUTS };

/* Rates and outputs at `step` in a direction. False outside of the range of a variable, and where there are none. */
static bool beside(Instance *instance, const double *seed, double step, double *values) {
    double *memory = instance->now.memory, kept[MEMORY_SIZE];
    double time = instance->now.time + step * seed[MODEL_VARIABLES];
    Message ignored;
    bool good = true;
    memcpy(kept, memory, sizeof kept);
    for (int i = 0; i < FIRST_OUTPUT; i++) {
        memory[i] += step * seed[i];
        good &= seed[i] == 0.0 ||
                (memory[i] >= model_variables[i].minimum && memory[i] <= model_variables[i].maximum);
    }
    good = good && engine_differentiate(instance->engine, time, ignored) &&
           engine_evaluate(instance->engine, time, ignored);
    memcpy(values, memory + FIRST_DERIVATIVE, MODEL_STATES * sizeof *values);
    memcpy(values + MODEL_STATES, memory + FIRST_OUTPUT, MODEL_OUTPUTS * sizeof *values);
    memcpy(memory, kept, sizeof kept);
    return good;
}

/* A step in a direction that is small for each variable. */
static double small_step(const Instance *instance, const double *seed) {
    const double *memory = instance->now.memory;
    double step = fmax(fabs(instance->now.time), 1.0) / fabs(seed[MODEL_VARIABLES]);
    for (int i = 0; i < FIRST_OUTPUT; i++)
        step = fmin(step, fmax(fabs(memory[i]), model_variables[i].nominal) / fabs(seed[i]));
    return sqrt(DBL_EPSILON) * step;
}

/* Replaces what is no number: by a difference to both sides, at the border of the domain to one. */
static void difference(Instance *instance, const double *seed, double *result) {
    double here[LAWS + 1], above[LAWS + 1], below[LAWS + 1];
    double step = small_step(instance, seed);
    bool upward = beside(instance, seed, step, above), downward = beside(instance, seed, -step, below);
    if (!beside(instance, seed, 0.0, here))
        return;
    for (int i = 0; i < LAWS; i++) {
        bool up = upward && isfinite(above[i]), down = downward && isfinite(below[i]);
        if (isinf(step)) /* no direction */
            result[i] = 0.0;
        else if (!isfinite(result[i]) && (up || down))
            result[i] = ((up ? above : here)[i] - (down ? below : here)[i]) / (step * (up + down));
    }
}

bool along(Instance *instance, const double *seed, double *result, Message message) {
    bool numbers = true;
    if (!engine_tangent(instance->engine, instance->now.time, seed, result, message))
        return false;
    for (int i = 0; i < LAWS; i++)
        numbers &= isfinite(result[i]) != 0;
    if (!numbers)
        difference(instance, seed, result);
    return true;
}

Status directional(Instance *instance, const Partials *of, const double seeds[], double results[]) {
    double seed[MODEL_VARIABLES + 1] = {0.0}, result[LAWS + 1] = {0.0};
    Message message = "";
    if (!answerable(instance, of, seeds, results) ||
        !add_seeds(instance, of->function, of->knowns, of->n_knowns, seeds, seed))
        return FMI(Error);
    if (instance->now.mode == INITIALIZATION)
        for (int i = 0; i < MODEL_STATES + MODEL_DISCRETES; i++)
            seed[FIRST_STATE + i] = seed[model_start_of[i]];
    if (!along(instance, seed, result, message))
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

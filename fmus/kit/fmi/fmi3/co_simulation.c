/* FMI 3.0 co-simulation: the step in time, which may end early, at a sample. */
#include "arrays.h"
#include "evaluate.h"
#include "exchange.h"
#include "extra_laws.h"
#include "step.h"
#include "values.h"

#include <math.h>

/* The first sample after the beginning of a step that is before its end; else that end. */
static double sample_within(const Instance *instance, double time, double end) {
    const double *memory = instance->now.memory;
    double first = end;
    for (int i = 0; i < MODEL_GROUPS; i++) {
        double instant = instant_of(instance, i), slack = sample_slack(&model_groups[i], memory, end);
        if (instant <= time + slack) /* the step begins with this one */
            instant += period_of(&model_groups[i], memory);
        if (instant < end - slack)
            first = fmin(first, instant);
    }
    return first;
}

/* The size of a step, which is shorter where a sample comes before its end. */
static double step_to_sample(const Instance *instance, double time, double step, bool *early) {
    double end = time + step, stop = sample_within(instance, time, end);
    *early = stop < end;
    return *early ? stop - time : step;
}

static bool any_sample_due(const Instance *instance) {
    for (int i = 0; i < MODEL_GROUPS; i++)
        if (sample_due(instance, i))
            return true;
    return false;
}

/* The first of these pointers that is NULL; NULL where none is. */
static const char *missing_result(const fmi3Boolean *event, const fmi3Boolean *terminate, const fmi3Boolean *early,
                                  const fmi3Float64 *last) {
    return event == NULL       ? "eventHandlingNeeded"
           : terminate == NULL ? "terminateSimulation"
           : early == NULL     ? "earlyReturn"
           : last == NULL      ? "lastSuccessfulTime"
                               : NULL;
}

EXPORT fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set_state,
                             fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    Instance *instance = c;
    fmi3Status status;
    const char *missing;
    (void)no_set_state;
    if (!allowed(instance, STEP_COMPLETE, __func__))
        return fmi3Error;
    missing = missing_result(event, terminate, early, last);
    if (missing != NULL)
        return report(instance, fmi3Error, "%s: the pointer to %s is NULL", __func__, missing);
    *event = *terminate = *early = false;
    *last = instance->now.time;
    if (!step_valid(instance, __func__, time, step))
        return fmi3Error;
    if (instance->host.early_return)
        step = step_to_sample(instance, time, step, early);
    status = advance(instance, time, step);
    *last = instance->now.time;
    if (status != fmi3OK)
        *early = false;
    else if (instance->host.event_mode)
        *event = any_sample_due(instance);
    return status;
}

EXPORT fmi3Status fmi3EnterStepMode(fmi3Instance c) {
    Instance *instance = c;
    if (!allowed(instance, EVENT, __func__))
        return fmi3Error;
    if (instance->integrator == HOST_INTEGRATES)
        return report(instance, fmi3Error, "%s: this instance of %s was made for model exchange", __func__, model_name);
    instance->now.mode = STEP_COMPLETE;
    return fmi3OK;
}

static fmi3Status output_derivatives(Instance *instance, const char *function, const Reference vr[], size_t n,
                                     double value[]) {
    double rate[MODEL_OUTPUTS + 1];
    fmi3Status status;
    if (!allowed(instance, STEP_COMPLETE | FAILED | TERMINATED, function) ||
        !valid(instance, function, TYPE_REAL, vr, n, value))
        return fmi3Error;
    if (!engine_differentiates)
        return report(instance, fmi3Error, "%s is not supported by this build of %s", function, model_name);
    if (n > 0 && !differentiate_outputs(instance, rate))
        return report(instance, fmi3Error, "%s: the law could not be evaluated", function);
    status = n > 0 ? refresh_derivatives(instance) : fmi3OK;
    if (status != fmi3OK)
        return status;
    for (size_t i = 0; i < n; i++) {
        const Variable *variable = &model_variables[vr[i]];
        if (variable->role != ROLE_OUTPUT && variable->role != ROLE_STATE)
            return report(instance, fmi3Error, "%s: '%s' is not a continuous output", function, variable->name);
        if (variable->role == ROLE_OUTPUT && !isfinite(rate[vr[i] - FIRST_OUTPUT]))
            return report(instance, fmi3Error, "%s: the time derivative of '%s' is not a finite number", function,
                          variable->name);
    }
    for (size_t i = 0; i < n; i++)
        value[i] = model_variables[vr[i]].role == ROLE_OUTPUT
                       ? rate[vr[i] - FIRST_OUTPUT]
                       : instance->now.memory[FIRST_DERIVATIVE + vr[i] - FIRST_STATE];
    return fmi3OK;
}

/* Whether all orders are 1; reports it if not. */
static bool first_orders(const Instance *instance, const char *function, const Reference vr[], size_t n,
                         const fmi3Int32 orders[]) {
    if (instance == NULL)
        return false;
    if (n > 0 && (vr == NULL || orders == NULL)) {
        report(instance, fmi3Error, "%s: an order is needed for each of %zu variables", function, n);
        return false;
    }
    for (size_t i = 0; i < n; i++)
        if (orders[i] != 1) {
            report(instance, fmi3Error, "%s: order %d of value reference %u is not supported, only order 1", function,
                   (int)orders[i], vr[i]);
            return false;
        }
    return true;
}

/* Time derivatives of outputs, the inputs being held. */
EXPORT fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                           const fmi3Int32 orders[], fmi3Float64 value[], size_t n_values) {
    Elements all;
    bool found = find_elements(c, __func__, vr, n, n_values, &all) && first_orders(c, __func__, vr, n, orders);
    fmi3Status status = found ? output_derivatives(c, __func__, all.vr, all.n, value) : fmi3Error;
    release(&all);
    return status;
}

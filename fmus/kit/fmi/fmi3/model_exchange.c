/* FMI 3.0 model exchange and event mode: what is of this version alone. */
#include "exchange.h"

#include <math.h>

EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *more, fmi3Boolean *terminate,
                                           fmi3Boolean *nominals_changed, fmi3Boolean *states_changed,
                                           fmi3Boolean *next_defined, fmi3Float64 *next) {
    Instance *instance = c;
    fmi3Status status;
    if (!allowed(instance, EVENT, __func__))
        return fmi3Error;
    if (more == NULL || terminate == NULL || nominals_changed == NULL || states_changed == NULL ||
        next_defined == NULL || next == NULL)
        return report(instance, fmi3Error, "%s: a pointer is NULL", __func__);
    status = update_discretes(instance, __func__, next);
    if (status != fmi3OK)
        return status;
    *next_defined = isfinite(*next);
    /* of a host that comes late, as those of fixed steps do: what it has missed is sampled now, one after the other */
    *more = *next <= instance->now.time;
    *terminate = false;
    /* hosts then restart their solvers: rates have jumped */
    *nominals_changed = instance->integrator == HOST_INTEGRATES && MODEL_STATES > 0;
    *states_changed = false; /* a sample changes what is sampled, never a state */
    return fmi3OK;
}

/* Where modelDescription.xml says that nothing is evaluated in advance, the standard has this call ignored. */
EXPORT fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) {
    return allowed(c, INITIALIZATION | EVENT, __func__) ? fmi3OK : fmi3Error;
}

static fmi3Status count(const Instance *instance, const char *function, size_t *n, size_t number) {
    if (!host_integrates(instance, ANY_MODE, function))
        return fmi3Error;
    if (n == NULL)
        return report(instance, fmi3Error, "%s: the pointer to the number is NULL", function);
    *n = number;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) {
    return count(c, __func__, n, MODEL_INDICATORS);
}

EXPORT fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) {
    return count(c, __func__, n, MODEL_STATES);
}

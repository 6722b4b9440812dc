/* FMI 3.0: directional and adjoint derivatives. */
#include "derivatives.h"
#include "extra_laws.h"

#include <math.h>

/* Whether there is a seed and a result for each of the scalars. */
static bool counted_partials(const Instance *instance, const char *function, size_t seeds, size_t n_seeds,
                             size_t results, size_t n_results) {
    bool good = seeds == n_seeds && results == n_results;
    if (instance != NULL && !good)
        report(instance, fmi3Error, "%s: %zu seeds for %zu scalars and %zu results for %zu", function, n_seeds, seeds,
               n_results, results);
    return good;
}

EXPORT fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                               const fmi3ValueReference knowns[], size_t n_knowns,
                                               const fmi3Float64 seeds[], size_t n_seeds, fmi3Float64 results[],
                                               size_t n_results) {
    if (!counted_partials(c, __func__, n_knowns, n_seeds, n_unknowns, n_results))
        return fmi3Error;
    return directional(c, &(Partials){__func__, unknowns, n_unknowns, knowns, n_knowns}, seeds, results);
}

/* The adjoint derivative by one variable, from the derivatives in its direction. */
static double adjoint_along(Instance *instance, int variable, const double *weights) {
    double seed[MODEL_VARIABLES + 1] = {0.0}, result[MODEL_STATES + MODEL_OUTPUTS + 1] = {0.0}, sum = 0.0;
    Message ignored;
    seed[variable] = 1.0;
    if (!along(instance, seed, result, ignored))
        return NAN;
    for (int i = 0; i < MODEL_STATES + MODEL_OUTPUTS; i++)
        sum += weights[i] == 0.0 ? 0.0 : weights[i] * result[i];
    return sum;
}

EXPORT fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                           const fmi3ValueReference knowns[], size_t n_knowns,
                                           const fmi3Float64 seeds[], size_t n_seeds, fmi3Float64 results[],
                                           size_t n_results) {
    const Partials of = {__func__, unknowns, n_unknowns, knowns, n_knowns};
    Instance *instance = c;
    double seed[MODEL_VARIABLES + 1] = {0.0}, weights[MODEL_STATES + MODEL_OUTPUTS + 1] = {0.0};
    double result[MODEL_VARIABLES + 1] = {0.0};
    if (!counted_partials(c, __func__, n_unknowns, n_seeds, n_knowns, n_results) ||
        !answerable(instance, &of, results, seeds) || !add_seeds(instance, __func__, unknowns, n_unknowns, seeds, seed))
        return fmi3Error;
    for (int i = 0; i < MODEL_STATES; i++)
        weights[i] = seed[FIRST_DERIVATIVE + i];
    for (int i = 0; i < MODEL_OUTPUTS; i++)
        weights[MODEL_STATES + i] = seed[FIRST_OUTPUT + i];
    if (!adjoin(instance, weights, result))
        return report(instance, fmi3Error, "%s: the law could not be evaluated", __func__);
    for (int i = 0; i <= MODEL_VARIABLES; i++)
        if (!isfinite(result[i]))
            result[i] = adjoint_along(instance, i, weights);
    for (int i = 0; i < MODEL_STATES + MODEL_DISCRETES; i++) { /* a state is an unknown that follows itself */
        result[FIRST_STATE + i] += seed[FIRST_STATE + i];
        if (instance->now.mode == INITIALIZATION) /* and there its start parameter */
            result[model_start_of[i]] += result[FIRST_STATE + i];
    }
    for (size_t i = 0; i < n_knowns; i++)
        results[i] = result[place_in_direction(knowns[i])];
    return derivatives_finite(instance, __func__, knowns, n_knowns, results) ? fmi3OK : fmi3Error;
}

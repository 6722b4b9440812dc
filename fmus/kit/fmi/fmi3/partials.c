/* FMI 3.0: directional and adjoint derivatives. */
#include "arrays.h"
#include "derivatives.h"
#include "extra_laws.h"

#include <math.h>

/* The elements of a request, with a seed and a result for each. False, with a report, if the numbers differ. */
static bool find_partials(const Instance *instance, Partials *of, size_t of_unknowns, size_t of_knowns, Elements all[2]) {
    bool found = find_elements(instance, of->function, of->unknowns, of->n_unknowns, of_unknowns, &all[0]);
    found = find_elements(instance, of->function, of->knowns, of->n_knowns, of_knowns, &all[1]) && found;
    *of = (Partials){of->function, all[0].vr, all[0].n, all[1].vr, all[1].n};
    return found;
}

EXPORT fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                               const fmi3ValueReference knowns[], size_t n_knowns,
                                               const fmi3Float64 seeds[], size_t n_seeds, fmi3Float64 results[],
                                               size_t n_results) {
    Partials of = {__func__, unknowns, n_unknowns, knowns, n_knowns};
    Elements all[2];
    bool found = find_partials(c, &of, n_results, n_seeds, all);
    fmi3Status status = found ? directional(c, &of, seeds, results) : fmi3Error;
    release(&all[0]);
    release(&all[1]);
    return status;
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

static fmi3Status adjoint_derivatives(Instance *instance, const Partials *of, const double seeds[], double results[]) {
    double seed[MODEL_VARIABLES + 1] = {0.0}, weights[MODEL_STATES + MODEL_OUTPUTS + 1] = {0.0};
    double result[MODEL_VARIABLES + 1] = {0.0};
    if (!answerable(instance, of, results, seeds) ||
        !add_seeds(instance, of->function, of->unknowns, of->n_unknowns, seeds, seed))
        return fmi3Error;
    for (int i = 0; i < MODEL_STATES; i++)
        weights[i] = seed[FIRST_DERIVATIVE + i];
    for (int i = 0; i < MODEL_OUTPUTS; i++)
        weights[MODEL_STATES + i] = seed[FIRST_OUTPUT + i];
    if (!adjoin(instance, weights, result))
        return report(instance, fmi3Error, "%s: the law could not be evaluated", of->function);
    for (int i = 0; i <= MODEL_VARIABLES; i++)
        if (!isfinite(result[i]))
            result[i] = adjoint_along(instance, i, weights);
    for (int i = 0; i < MODEL_STATES + MODEL_DISCRETES; i++) { /* a state is an unknown that follows itself */
        result[FIRST_STATE + i] += seed[FIRST_STATE + i];
        if (instance->now.mode == INITIALIZATION) /* and there its start parameter */
            result[model_start_of[i]] += result[FIRST_STATE + i];
    }
    for (size_t i = 0; i < of->n_knowns; i++)
        results[i] = result[place_in_direction(of->knowns[i])];
    return derivatives_finite(instance, of->function, of->knowns, of->n_knowns, results) ? fmi3OK : fmi3Error;
}

EXPORT fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                           const fmi3ValueReference knowns[], size_t n_knowns,
                                           const fmi3Float64 seeds[], size_t n_seeds, fmi3Float64 results[],
                                           size_t n_results) {
    Partials of = {__func__, unknowns, n_unknowns, knowns, n_knowns};
    Elements all[2];
    bool found = find_partials(c, &of, n_seeds, n_results, all);
    fmi3Status status = found ? adjoint_derivatives(c, &of, seeds, results) : fmi3Error;
    release(&all[0]);
    release(&all[1]);
    return status;
}

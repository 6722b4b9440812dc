/* Partial derivatives, for the files of one version. */
#ifndef DERIVATIVES_H
#define DERIVATIVES_H

#include "instance.h"

/* Unknowns and knowns of a request, and where it comes from. */
typedef struct {
    const char *function;
    const Reference *unknowns;
    size_t n_unknowns;
    const Reference *knowns;
    size_t n_knowns;
} Partials;

/* Whether all of a request can be answered now, there being an array for the knowns and one for the unknowns; reports
   it if not. */
static bool answerable(const Instance *instance, const Partials *of, const void *of_knowns, const void *of_unknowns);

/* The place of a known in a direction: its reference, and behind all variables the time. */
static int place_in_direction(Reference vr);

/* Adds seeds of some variables to those that are there. False, with a report, if one is not finite. */
static bool add_seeds(const Instance *instance, const char *function, const Reference vr[], size_t n,
                      const double seeds[], double seed[]);

/* Whether the derivatives of a request are finite; reports the first that is not. */
static bool derivatives_finite(const Instance *instance, const char *function, const Reference vr[], size_t n,
                               const double results[]);

/* Rates and outputs in a direction [parameters | inputs | states | discretes], with the time at MODEL_VARIABLES: by
   automatic differentiation, and by a difference where that gives no number, as 0 times infinity. */
static bool along(Instance *instance, const double *seed, double *result, Message message);

/* `seeds` is a direction of the knowns, `results` what the unknowns do in it. */
static Status directional(Instance *instance, const Partials *of, const double seeds[], double results[]);

#endif

/* What the native engine computes for this version of FMI only. */
#ifndef EXTRA_LAWS_H
#define EXTRA_LAWS_H

#include "instance.h"

/* Time derivatives of the outputs, the inputs being held. False if the law could not be evaluated. */
static bool differentiate_outputs(Instance *instance, double rate[]);

/* Derivatives of a sum of [derivatives | outputs], weighted by `seed`, by [parameters | inputs | states | discretes] and,
   at MODEL_VARIABLES, by the time. */
static bool adjoin(Instance *instance, const double *seed, double *result);

#endif

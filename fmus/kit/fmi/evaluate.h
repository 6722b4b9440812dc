/* Evaluation of the laws, for the files of the front-end. */
#ifndef EVALUATE_H
#define EVALUATE_H

#include "instance.h"

/* Whether the variables from index `first` to before `end` are finite numbers; reports the first that is not. */
static bool all_finite(const Instance *instance, int first, int end);

/* Brings outputs or derivatives up to date and checks that they are finite. */
static Status refresh_outputs(Instance *instance);
static Status refresh_derivatives(Instance *instance);

#endif

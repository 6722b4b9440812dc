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

/* `seeds` is a direction of the knowns, `results` what the unknowns do in it. */
static Status directional(Instance *instance, const Partials *of, const double seeds[], double results[]);

#endif

/* The step in time of co-simulation, for the files of one version. */
#ifndef STEP_H
#define STEP_H

#include "instance.h"

/* Whether such a step may be made; reports it if not. */
static bool step_valid(const Instance *instance, const char *function, double time, double step);

/* Makes a step that is valid. */
static Status advance(Instance *instance, double time, double step);

#endif

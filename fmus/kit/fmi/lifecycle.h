/* Creation and preparation of an instance, for the files of one version. */
#ifndef LIFECYCLE_H
#define LIFECYCLE_H

#include "instance.h"

/* Makes an instance for a host. NULL, and a line to the host, if that is impossible. */
static Instance *instance_create(const char *function, const Host *host, Integrator integrator, const char *name,
                        const char *guid, const char *resources, bool logging);

/* Takes the span and the tolerance of the experiment. */
static Status set_up(Instance *instance, const char *function, bool tolerance_defined, double tolerance, double start,
                     bool stop_defined, double stop);

/* Whether a parameter may have a value; reports it if not. */
static bool in_range(const Instance *instance, const Variable *parameter, double value);

#endif

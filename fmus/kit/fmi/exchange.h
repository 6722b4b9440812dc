/* Model exchange and events, for the files of one version. */
#ifndef EXCHANGE_H
#define EXCHANGE_H

#include "instance.h"

/* Whether a function of model exchange may be called now; reports it if not. */
static bool host_integrates(const Instance *instance, int modes, const char *function);

/* Calculates the event indicators. False if the law could not be evaluated. */
static bool indicate(Instance *instance, double z[]);

/* Makes the updates that are due; sets the time of the next one, +infinity where nothing is sampled. */
static Status update_discretes(Instance *instance, const char *function, double *next);

#endif

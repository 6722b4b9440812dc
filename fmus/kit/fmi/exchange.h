/* Model exchange and events, for the files of one version. */
#ifndef EXCHANGE_H
#define EXCHANGE_H

#include "instance.h"
#include "samples.h"

/* Whether a function of model exchange may be called now; reports it if not. */
static bool host_integrates(const Instance *instance, int modes, const char *function);

/* Calculates the event indicators. False if the law could not be evaluated. */
static bool indicate(Instance *instance, double z[]);

/* The same by the engine, without regard to earlier events. */
static bool engine_indicate(Engine *engine, double time, double z[]);

/* The instant of the next sample of a group. */
static inline double instant_of(const Instance *instance, int group) {
    const double *memory = instance->now.memory;
    return sample_instant(&model_groups[group], memory, memory[MEMORY_START_TIME], memory[MEMORY_COUNTERS + group]);
}

static inline bool sample_due(const Instance *instance, int group) {
    double time = instance->now.time;
    return instant_of(instance, group) <= time + sample_slack(&model_groups[group], instance->now.memory, time);
}

/* Makes the updates that are due; sets the time of the next one, +infinity where nothing is sampled. */
static Status update_discretes(Instance *instance, const char *function, double *next);

#endif

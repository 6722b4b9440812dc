/* When the discrete variables of a group are sampled. */
#ifndef SAMPLES_H
#define SAMPLES_H

#include "any_model.h"

#include <math.h>

static inline double period_of(const Group *group, const double *memory) {
    return group->period_parameter < 0 ? group->period : memory[group->period_parameter];
}

/* The time of the first sample, for a simulation that starts at `start`. */
static inline double first_sample(const Group *group, const double *memory, double start) {
    for (int i = 0; i < 2; i++) {
        int parameter = group->shift_parameters[i];
        start += parameter < 0 ? 0.0 : memory[parameter];
    }
    return start;
}

/* The instant of sample `count`. */
static inline double sample_instant(const Group *group, const double *memory, double start, double count) {
    return first_sample(group, memory, start) + count * period_of(group, memory);
}

/* Times this close are the same instant: hosts round, and late in a simulation more than a share of the period. */
static inline double sample_slack(const Group *group, const double *memory, double end) {
    return 1e-9 * period_of(group, memory) + 1e-15 * fabs(end);
}

#endif

/* FMI 3.0: an output clock for each group of states that are sampled together.
 *
 * It is active in event mode from a sample instant to the call that makes the sample. The standard has intervals of input
 * clocks only; hosts that ask for that of an output clock get the period.
 */
#include "exchange.h"
#include "variables.h"

#include <math.h>

static bool clocks_valid(const Instance *instance, const char *function, int modes, const fmi3ValueReference vr[],
                         size_t n, const void *values) {
    if (!allowed(instance, modes, function) || !given(instance, function, vr, n, values))
        return false;
    for (size_t i = 0; i < n; i++)
        if (!is_clock(vr[i])) {
            report(instance, fmi3Error, "%s: value reference %u is no clock; %s has %d of them", function, vr[i],
                   model_name, MODEL_GROUPS);
            return false;
        }
    return true;
}

EXPORT fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Clock value[]) {
    const Instance *instance = c;
    if (!clocks_valid(instance, __func__, READABLE, vr, n, value))
        return fmi3Error;
    for (size_t i = 0; i < n; i++)
        value[i] = instance->now.mode == EVENT &&
                   sample_due(instance, (int)(vr[i] - FIRST_CLOCK));
    return fmi3OK;
}

/* ---- intervals and shifts ----------------------------------------------------------------------- */

static double interval_of(const Instance *instance, fmi3ValueReference vr) {
    return period_of(&model_groups[vr - FIRST_CLOCK], instance->now.memory);
}

static double shift_of(const Instance *instance, fmi3ValueReference vr) {
    return first_sample(&model_groups[vr - FIRST_CLOCK], instance->now.memory, 0.0);
}

typedef double Seconds(const Instance *instance, fmi3ValueReference vr);

static fmi3Status get_seconds(const Instance *instance, const char *function, Seconds *seconds,
                              const fmi3ValueReference vr[], size_t n, fmi3Float64 values[]) {
    if (!clocks_valid(instance, function, ANY_MODE, vr, n, values))
        return fmi3Error;
    for (size_t i = 0; i < n; i++)
        values[i] = seconds(instance, vr[i]);
    return fmi3OK;
}

/* The fraction is that of the shortest decimal number, of at most 15 places. */
static fmi3Status get_fractions(const Instance *instance, const char *function, Seconds *seconds,
                                const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[],
                                fmi3UInt64 resolutions[]) {
    if (!clocks_valid(instance, function, ANY_MODE, vr, n, counters) ||
        !given(instance, function, vr, n, resolutions))
        return fmi3Error;
    for (size_t i = 0; i < n; i++) {
        double value = seconds(instance, vr[i]), resolution = 1.0;
        while (resolution < 1e15 && round(value * resolution) / resolution != value)
            resolution *= 10.0;
        if (!(value * resolution >= 0.0 && value * resolution < 1e19))
            return report(instance, fmi3Error, "%s: %g s is no fraction of 64 bits", function, value);
        counters[i] = (fmi3UInt64)round(value * resolution);
        resolutions[i] = (fmi3UInt64)resolution;
    }
    return fmi3OK;
}

/* Parameters, on which periods depend, are fixed once initialization ends. */
static fmi3Status qualify(const Instance *instance, const char *function, const fmi3ValueReference vr[], size_t n,
                          fmi3IntervalQualifier qualifiers[]) {
    bool before = ((int)instance->now.mode & BEFORE_START) != 0;
    if (!given(instance, function, vr, n, qualifiers))
        return fmi3Error;
    for (size_t i = 0; i < n; i++)
        qualifiers[i] = before ? fmi3IntervalChanged : fmi3IntervalUnchanged;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                         fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]) {
    fmi3Status status = get_seconds(c, __func__, interval_of, vr, n, intervals);
    return status == fmi3OK ? qualify(c, __func__, vr, n, qualifiers) : status;
}

EXPORT fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                          fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                          fmi3IntervalQualifier qualifiers[]) {
    fmi3Status status = get_fractions(c, __func__, interval_of, vr, n, counters, resolutions);
    return status == fmi3OK ? qualify(c, __func__, vr, n, qualifiers) : status;
}

EXPORT fmi3Status fmi3GetShiftDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 shifts[]) {
    return get_seconds(c, __func__, shift_of, vr, n, shifts);
}

EXPORT fmi3Status fmi3GetShiftFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[],
                                       fmi3UInt64 resolutions[]) {
    return get_fractions(c, __func__, shift_of, vr, n, counters, resolutions);
}

/* ---- what hosts cannot set ---------------------------------------------------------------------- */

static fmi3Status refuse_clocks(const Instance *instance, const char *function, const fmi3ValueReference vr[], size_t n,
                                const void *values) {
    if (!clocks_valid(instance, function, ANY_MODE, vr, n, values))
        return fmi3Error;
    return n == 0 ? fmi3OK
                  : report(instance, fmi3Error,
                           "%s: 'clock[%u]' is an output; %s activates it, with the period that its parameters give",
                           function, vr[0] - FIRST_CLOCK + 1, model_name);
}

EXPORT fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Clock value[]) {
    return refuse_clocks(c, __func__, vr, n, value);
}

EXPORT fmi3Status fmi3SetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                         const fmi3Float64 intervals[]) {
    return refuse_clocks(c, __func__, vr, n, intervals);
}

EXPORT fmi3Status fmi3SetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                          const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
    (void)resolutions;
    return refuse_clocks(c, __func__, vr, n, counters);
}

EXPORT fmi3Status fmi3SetShiftDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                      const fmi3Float64 shifts[]) {
    return refuse_clocks(c, __func__, vr, n, shifts);
}

EXPORT fmi3Status fmi3SetShiftFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                       const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
    (void)resolutions;
    return refuse_clocks(c, __func__, vr, n, counters);
}

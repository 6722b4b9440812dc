/* FMI 3.0: functions for what no component has: clocks, structural parameters, partitions, dependencies at run time. */
#include "instance.h"

static fmi3Status unused(const Instance *instance, const char *function, const char *what) {
    if (!allowed(instance, ANY_MODE, function))
        return fmi3Error;
    return report(instance, fmi3Error, "%s: %s has no %s", function, model_name, what);
}

EXPORT fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) { return unused(c, __func__, "structural parameters"); }

EXPORT fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) { return unused(c, __func__, "structural parameters"); }

EXPORT fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t *n) {
    (void)vr;
    (void)n;
    return unused(c, __func__, "dependencies of single elements; those of variables are in modelDescription.xml");
}

EXPORT fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent, size_t of_dependent[],
                                              fmi3ValueReference independents[], size_t of_independents[],
                                              fmi3DependencyKind kinds[], size_t n) {
    (void)dependent;
    (void)of_dependent;
    (void)independents;
    (void)of_independents;
    (void)kinds;
    (void)n;
    return unused(c, __func__, "dependencies of single elements; those of variables are in modelDescription.xml");
}

EXPORT fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time) {
    (void)clock;
    (void)time;
    return unused(c, __func__, "model partitions");
}

/* ---- clocks ------------------------------------------------------------------------------------- */

static fmi3Status of_clocks(const Instance *instance, const char *function, size_t n) {
    if (n > 0)
        return unused(instance, function, "clocks");
    return allowed(instance, ANY_MODE, function) ? fmi3OK : fmi3Error;
}

EXPORT fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                         fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]) {
    (void)vr;
    (void)intervals;
    (void)qualifiers;
    return of_clocks(c, __func__, n);
}

EXPORT fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                          fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                          fmi3IntervalQualifier qualifiers[]) {
    (void)vr;
    (void)counters;
    (void)resolutions;
    (void)qualifiers;
    return of_clocks(c, __func__, n);
}

EXPORT fmi3Status fmi3GetShiftDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 shifts[]) {
    (void)vr;
    (void)shifts;
    return of_clocks(c, __func__, n);
}

EXPORT fmi3Status fmi3GetShiftFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[],
                                       fmi3UInt64 resolutions[]) {
    (void)vr;
    (void)counters;
    (void)resolutions;
    return of_clocks(c, __func__, n);
}

EXPORT fmi3Status fmi3SetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                         const fmi3Float64 intervals[]) {
    (void)vr;
    (void)intervals;
    return of_clocks(c, __func__, n);
}

EXPORT fmi3Status fmi3SetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                          const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
    (void)vr;
    (void)counters;
    (void)resolutions;
    return of_clocks(c, __func__, n);
}

EXPORT fmi3Status fmi3SetShiftDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                      const fmi3Float64 shifts[]) {
    (void)vr;
    (void)shifts;
    return of_clocks(c, __func__, n);
}

EXPORT fmi3Status fmi3SetShiftFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                       const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
    (void)vr;
    (void)counters;
    (void)resolutions;
    return of_clocks(c, __func__, n);
}

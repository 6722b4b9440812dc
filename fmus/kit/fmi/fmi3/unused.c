/* FMI 3.0: functions for what no component has: structural parameters, partitions, dependencies at run time. */
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

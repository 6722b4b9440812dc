/* Reading and writing of variables. */
#include "values.h"
#include "evaluate.h"
#include "lifecycle.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Says why a reference is not taken where variables of one type are. */
static void explain(const Instance *instance, const char *function, Reference vr) {
    if (vr < MODEL_VARIABLES)
        report(instance, FMI(Error), "%s: value reference %u is '%s', which is of type %s", function, vr,
               model_variables[vr].name, type_names[model_variables[vr].type]);
    else if (vr < MODEL_VARIABLES + MODEL_TEXTS)
        report(instance, FMI(Error), "%s: value reference %u is '%s', which is of type String", function, vr,
               model_texts[vr - MODEL_VARIABLES].name);
    else if (vr < MODEL_VARIABLES + MODEL_TEXTS + OWN_REFERENCES)
        report(instance, FMI(Error), "%s: value reference %u, of the time, an event indicator or a clock, is not taken",
               function, vr);
    else
        report(instance, FMI(Error), "%s: value reference %u does not exist; the last one is %d", function, vr,
               MODEL_VARIABLES + MODEL_TEXTS + OWN_REFERENCES - 1);
}

bool given(const Instance *instance, const char *function, const Reference vr[], size_t n, const void *values) {
    bool good = n == 0 || (vr != NULL && values != NULL);
    if (!good)
        report(instance, FMI(Error), "%s: an array is NULL though it should have %zu elements", function, n);
    return good;
}

bool valid(const Instance *instance, const char *function, Type type, const Reference vr[], size_t n,
           const void *values) {
    if (!given(instance, function, vr, n, values))
        return false;
    for (size_t i = 0; i < n; i++)
        if (vr[i] >= MODEL_VARIABLES || model_variables[vr[i]].type != type) {
            explain(instance, function, vr[i]);
            return false;
        }
    return true;
}

static bool texts_valid(const Instance *instance, const char *function, const Reference vr[], size_t n,
                        const void *values) {
    if (n > 0 && MODEL_TEXTS == 0)
        report(instance, FMI(Error), "%s: %s has no String variables", function, model_name);
    else if (n > 0 && (vr == NULL || values == NULL))
        report(instance, FMI(Error), "%s: an array is NULL though it should have %zu elements", function, n);
    else {
        for (size_t i = 0; i < n; i++)
            if (vr[i] < MODEL_VARIABLES || vr[i] >= MODEL_VARIABLES + MODEL_TEXTS) {
                report(instance, FMI(Error), "%s: value reference %u is no String variable", function, vr[i]);
                return false;
            }
        return true;
    }
    return false;
}

/* ---- reading ------------------------------------------------------------------------------------ */

/* When parameters and inputs, which have start values, can be read. */
static int modes_of_starts(void) { return host_reads_starts ? ANY_MODE : READABLE; }

Status readable(Instance *instance, const char *function, Type type, const Reference vr[], size_t n,
                const void *values) {
    Status status = FMI(OK);
    if (!allowed(instance, modes_of_starts(), function) || !valid(instance, function, type, vr, n, values))
        return FMI(Error);
    for (size_t i = 0; i < n && status == FMI(OK); i++) {
        Role role = model_variables[vr[i]].role;
        if (role > ROLE_INPUT && !allowed(instance, READABLE, function))
            return FMI(Error);
        if (role == ROLE_OUTPUT)
            status = refresh_outputs(instance);
        else if (role == ROLE_DERIVATIVE)
            status = refresh_derivatives(instance);
    }
    return status;
}

Status get_reals(Instance *instance, const char *function, const Reference vr[], size_t n, double value[]) {
    Status status = readable(instance, function, TYPE_REAL, vr, n, value);
    if (status != FMI(OK))
        return status;
    for (size_t i = 0; i < n; i++)
        value[i] = instance->now.memory[vr[i]];
    return FMI(OK);
}

Status get_integers(Instance *instance, const char *function, const Reference vr[], size_t n, int32_t value[]) {
    Status status = readable(instance, function, TYPE_INTEGER, vr, n, value);
    if (status != FMI(OK))
        return status;
    for (size_t i = 0; i < n; i++)
        if (fabs(instance->now.memory[vr[i]]) > INT32_MAX)
            return report(instance, FMI(Error), "%s: '%s' = %g does not fit into 32 bits", function,
                          model_variables[vr[i]].name, instance->now.memory[vr[i]]);
    for (size_t i = 0; i < n; i++)
        value[i] = (int32_t)lround(instance->now.memory[vr[i]]);
    return FMI(OK);
}

Status get_texts(Instance *instance, const char *function, const Reference vr[], size_t n, const char *value[]) {
    if (!allowed(instance, modes_of_starts(), function) || !texts_valid(instance, function, vr, n, value))
        return FMI(Error);
    for (size_t i = 0; i < n; i++)
        value[i] = instance->texts[vr[i] - MODEL_VARIABLES];
    return FMI(OK);
}

/* ---- writing ------------------------------------------------------------------------------------ */

static bool settable(const Instance *instance, const char *function, const Variable *variable, double value) {
    bool tuned = variable->role == ROLE_PARAMETER && ((int)instance->now.mode & BEFORE_START) == 0;
    bool changes = value != instance->now.memory[variable - model_variables];
    bool integrated = variable->role == ROLE_STATE && ((int)instance->now.mode & (EVENT | CONTINUOUS)) != 0;
    if (variable->role > ROLE_INPUT && !integrated) /* hosts that integrate may set states one by one */
        report(instance, FMI(Error), "%s: '%s' is calculated and cannot be set", function, variable->name);
    else if (tuned && !variable->tunable)
        report(instance, FMI(Error), "%s: parameter '%s' cannot be set after initialization", function, variable->name);
    else if (tuned && changes && instance->now.mode == CONTINUOUS)
        report(instance, FMI(Error), "%s: parameter '%s' can change in event mode only", function, variable->name);
    else if (!isfinite(value))
        report(instance, FMI(Error), "%s: '%s' = %g is not a finite number", function, variable->name, value);
    else if (variable->type == TYPE_BOOLEAN && value != 0.0 && value != 1.0)
        report(instance, FMI(Error), "%s: '%s' = %g is neither 0 (false) nor 1 (true)", function, variable->name, value);
    else
        return !tuned || in_range(instance, variable, value);
    return false;
}

/* FMI forbids to set discrete inputs in continuous-time mode, but hosts do it: such a value waits for the next event. */
static bool must_wait(const Instance *instance, const Variable *variable) {
    return instance->now.mode == CONTINUOUS && variable->role == ROLE_INPUT && variable->type != TYPE_REAL;
}

/* True where a value changes at the next event. */
static bool take_value(Instance *instance, Reference vr, double value) {
    double *present = &instance->now.memory[vr];
    double *change;
    if (!must_wait(instance, &model_variables[vr])) {
        *present = value;
        return false;
    }
    change = &instance->now.changes[vr - FIRST_INPUT];
    *change = value - *present;
    return *change != 0.0;
}

/* Tells a host of the first such value, whether or not logging is on: what it asked for was not done. */
static Status warn_of_waiting(Instance *instance, const char *function, const Variable *variable) {
    Message text;
    if (instance->warned)
        return FMI(OK);
    instance->warned = true;
    snprintf(text, sizeof text, "%s: '%s' is discrete and changes at the next event only", function, variable->name);
    deliver(&instance->host, instance->name, FMI(Warning), text);
    return FMI(Warning);
}

Status set_numbers(Instance *instance, const char *function, Type type, const Reference vr[], size_t n,
                   const void *values, Number *number) {
    bool parameters = false;
    const Variable *waiting = NULL;
    if (!allowed(instance, BEFORE_START | RUNNING, function) || !valid(instance, function, type, vr, n, values))
        return FMI(Error);
    for (size_t i = 0; i < n; i++) {
        if (!settable(instance, function, &model_variables[vr[i]], number(values, i)))
            return FMI(Error);
        parameters |= model_variables[vr[i]].role == ROLE_PARAMETER;
    }
    for (size_t i = 0; i < n; i++)
        if (take_value(instance, vr[i], number(values, i)))
            waiting = &model_variables[vr[i]];
    if (n > 0)
        touch(instance, parameters);
    return waiting == NULL ? FMI(OK) : warn_of_waiting(instance, function, waiting);
}

Status set_texts(Instance *instance, const char *function, const Reference vr[], size_t n,
                 const char *const value[]) {
    if (!allowed(instance, BEFORE_START | RUNNING, function) || !texts_valid(instance, function, vr, n, value))
        return FMI(Error);
    for (size_t i = 0; i < n; i++) {
        const char *name = model_texts[vr[i] - MODEL_VARIABLES].name;
        if (((int)instance->now.mode & BEFORE_START) == 0)
            return report(instance, FMI(Error), "%s: parameter '%s' cannot be set after initialization", function, name);
        if (value[i] == NULL)
            return report(instance, FMI(Error), "%s: the text for '%s' is NULL", function, name);
        if (strlen(value[i]) >= TEXT_SIZE)
            return report(instance, FMI(Error), "%s: the text for '%s' has %zu bytes; %d are allowed", function, name,
                          strlen(value[i]), TEXT_SIZE - 1);
    }
    for (size_t i = 0; i < n; i++)
        memmove(instance->texts[vr[i] - MODEL_VARIABLES], value[i], strlen(value[i]) + 1);
    return FMI(OK);
}

/* FMI 2.0: reading and writing variables, directional derivatives. */
#include "evaluate.h"
#include "instance.h"

#include <limits.h>
#include <math.h>
#include <string.h>

static const char *const type_names[] = {"Real", "Integer", "Boolean"};

/* Whether the host passed usable arrays and references of the right type. */
static bool valid(const Instance *instance, const char *function, Type type, const fmi2ValueReference vr[], size_t n,
                  const void *values) {
    if (n > 0 && (vr == NULL || values == NULL)) {
        report(instance, fmi2Error, "%s: an array is NULL though it should have %zu elements", function, n);
        return false;
    }
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= MODEL_VARIABLES && vr[i] < MODEL_VARIABLES + MODEL_TEXTS) {
            report(instance, fmi2Error, "%s: value reference %u is '%s', which is of type String", function, vr[i],
                   model_texts[vr[i] - MODEL_VARIABLES].name);
            return false;
        }
        if (vr[i] >= MODEL_VARIABLES) {
            report(instance, fmi2Error, "%s: value reference %u does not exist; the last one is %d", function, vr[i],
                   MODEL_VARIABLES + MODEL_TEXTS - 1);
            return false;
        }
        if (model_variables[vr[i]].type != type) {
            report(instance, fmi2Error, "%s: value reference %u is '%s', which is of type %s", function, vr[i],
                   model_variables[vr[i]].name, type_names[model_variables[vr[i]].type]);
            return false;
        }
    }
    return true;
}

static bool texts_valid(const Instance *instance, const char *function, const fmi2ValueReference vr[], size_t n,
                        const void *values) {
    if (n > 0 && MODEL_TEXTS == 0)
        report(instance, fmi2Error, "%s: %s has no String variables", function, model_name);
    else if (n > 0 && (vr == NULL || values == NULL))
        report(instance, fmi2Error, "%s: an array is NULL though it should have %zu elements", function, n);
    else {
        for (size_t i = 0; i < n; i++)
            if (vr[i] < MODEL_VARIABLES || vr[i] >= MODEL_VARIABLES + MODEL_TEXTS) {
                report(instance, fmi2Error, "%s: value reference %u is no String variable", function, vr[i]);
                return false;
            }
        return true;
    }
    return false;
}

/* ---- reading ------------------------------------------------------------------------------------ */

static fmi2Status readable(Instance *instance, const char *function, Type type, const fmi2ValueReference vr[], size_t n,
                           const void *values) {
    fmi2Status status = fmi2OK;
    if (!allowed(instance, READABLE, function) || !valid(instance, function, type, vr, n, values))
        return fmi2Error;
    for (size_t i = 0; i < n && status == fmi2OK; i++) {
        Role role = model_variables[vr[i]].role;
        if (role == ROLE_OUTPUT)
            status = refresh_outputs(instance);
        else if (role == ROLE_DERIVATIVE)
            status = refresh_derivatives(instance);
    }
    return status;
}

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    Instance *instance = c;
    fmi2Status status = readable(instance, "fmi2GetReal", TYPE_REAL, vr, n, value);
    if (status != fmi2OK)
        return status;
    for (size_t i = 0; i < n; i++)
        value[i] = instance->now.memory[vr[i]];
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
    Instance *instance = c;
    fmi2Status status = readable(instance, "fmi2GetInteger", TYPE_INTEGER, vr, n, value);
    if (status != fmi2OK)
        return status;
    for (size_t i = 0; i < n; i++)
        if (fabs(instance->now.memory[vr[i]]) > INT_MAX)
            return report(instance, fmi2Error, "fmi2GetInteger: '%s' = %g does not fit into an Integer",
                          model_variables[vr[i]].name, instance->now.memory[vr[i]]);
    for (size_t i = 0; i < n; i++)
        value[i] = (fmi2Integer)lround(instance->now.memory[vr[i]]);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) {
    Instance *instance = c;
    fmi2Status status = readable(instance, "fmi2GetBoolean", TYPE_BOOLEAN, vr, n, value);
    if (status != fmi2OK)
        return status;
    for (size_t i = 0; i < n; i++)
        value[i] = instance->now.memory[vr[i]] != 0.0 ? fmi2True : fmi2False;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
    Instance *instance = c;
    if (!allowed(instance, READABLE, "fmi2GetString") || !texts_valid(instance, "fmi2GetString", vr, n, value))
        return fmi2Error;
    for (size_t i = 0; i < n; i++)
        value[i] = instance->texts[vr[i] - MODEL_VARIABLES];
    return fmi2OK;
}

/* ---- writing ------------------------------------------------------------------------------------ */

static double number(Type type, const void *values, size_t i) {
    return type == TYPE_REAL ? ((const fmi2Real *)values)[i] : (double)((const fmi2Integer *)values)[i];
}

static bool settable(const Instance *instance, const char *function, const Variable *variable, double value) {
    bool started = ((int)instance->now.mode & BEFORE_START) == 0;
    bool changes = value != instance->now.memory[variable - model_variables];
    bool integrated = variable->role == ROLE_STATE && ((int)instance->now.mode & (EVENT | CONTINUOUS)) != 0;
    if (variable->role > ROLE_INPUT && !integrated) /* hosts that integrate may set states one by one */
        report(instance, fmi2Error, "%s: '%s' is calculated and cannot be set", function, variable->name);
    else if (variable->role == ROLE_PARAMETER && started)
        report(instance, fmi2Error, "%s: parameter '%s' cannot be set after initialization", function, variable->name);
    else if (variable->type != TYPE_REAL && changes && instance->now.mode == CONTINUOUS)
        report(instance, fmi2Error, "%s: '%s' is discrete and can change in event mode only", function, variable->name);
    else if (!isfinite(value))
        report(instance, fmi2Error, "%s: '%s' = %g is not a finite number", function, variable->name, value);
    else if (variable->type == TYPE_BOOLEAN && value != 0.0 && value != 1.0)
        report(instance, fmi2Error, "%s: '%s' = %g is neither 0 (false) nor 1 (true)", function, variable->name, value);
    else
        return true;
    return false;
}

/* All values are checked before the first is written. fmi2Integer and fmi2Boolean are the same C type. */
static fmi2Status set(Instance *instance, const char *function, Type type, const fmi2ValueReference vr[], size_t n,
                      const void *values) {
    bool parameters = false;
    if (!allowed(instance, BEFORE_START | RUNNING, function) || !valid(instance, function, type, vr, n, values))
        return fmi2Error;
    for (size_t i = 0; i < n; i++) {
        if (!settable(instance, function, &model_variables[vr[i]], number(type, values, i)))
            return fmi2Error;
        parameters |= model_variables[vr[i]].role == ROLE_PARAMETER;
    }
    for (size_t i = 0; i < n; i++)
        instance->now.memory[vr[i]] = number(type, values, i);
    if (n > 0)
        touch(instance, parameters);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    return set(c, "fmi2SetReal", TYPE_REAL, vr, n, value);
}

EXPORT fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
    return set(c, "fmi2SetInteger", TYPE_INTEGER, vr, n, value);
}

EXPORT fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) {
    return set(c, "fmi2SetBoolean", TYPE_BOOLEAN, vr, n, value);
}

EXPORT fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) {
    static const char function[] = "fmi2SetString";
    Instance *instance = c;
    if (!allowed(instance, BEFORE_START | RUNNING, function) || !texts_valid(instance, function, vr, n, value))
        return fmi2Error;
    for (size_t i = 0; i < n; i++) {
        const char *name = model_texts[vr[i] - MODEL_VARIABLES].name;
        if (((int)instance->now.mode & BEFORE_START) == 0)
            return report(instance, fmi2Error, "%s: parameter '%s' cannot be set after initialization", function, name);
        if (value[i] == NULL)
            return report(instance, fmi2Error, "%s: the text for '%s' is NULL", function, name);
        if (strlen(value[i]) >= TEXT_SIZE)
            return report(instance, fmi2Error, "%s: the text for '%s' has %zu bytes; %d are allowed", function, name,
                          strlen(value[i]), TEXT_SIZE - 1);
    }
    for (size_t i = 0; i < n; i++)
        memmove(instance->texts[vr[i] - MODEL_VARIABLES], value[i], strlen(value[i]) + 1);
    return fmi2OK;
}

/* ---- directional derivatives -------------------------------------------------------------------- */

/* A parameter is known only during initialization, where states and discretes follow their start parameters. */
static bool known(const Instance *instance, Role role) {
    bool starting = instance->now.mode == INITIALIZATION;
    return role == ROLE_INPUT || (starting ? role == ROLE_PARAMETER : role == ROLE_STATE);
}

/* A state may be an output; it follows its own seed, and a discrete one nothing until its next sample instant. */
static bool unknown(Role role) {
    return role >= ROLE_STATE;
}

EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t n_unknowns,
                                               const fmi2ValueReference knowns[], size_t n_knowns,
                                               const fmi2Real seeds[], fmi2Real results[]) {
    static const char function[] = "fmi2GetDirectionalDerivative";
    Instance *instance = c;
    double seed[FIRST_OUTPUT + 1] = {0.0}, result[MODEL_STATES + MODEL_OUTPUTS + 1] = {0.0};
    Message message = "";
    if (!allowed(instance, READABLE, function))
        return fmi2Error;
    if (!engine_differentiates)
        return report(instance, fmi2Error, "%s is not supported by this build of %s", function, model_name);
    if (!valid(instance, function, TYPE_REAL, unknowns, n_unknowns, results) ||
        !valid(instance, function, TYPE_REAL, knowns, n_knowns, seeds))
        return fmi2Error;
    for (size_t i = 0; i < n_unknowns; i++)
        if (!unknown(model_variables[unknowns[i]].role))
            return report(instance, fmi2Error, "%s: '%s' is not an unknown here", function,
                          model_variables[unknowns[i]].name);
    for (size_t i = 0; i < n_knowns; i++) {
        if (!known(instance, model_variables[knowns[i]].role))
            return report(instance, fmi2Error, "%s: '%s' is not a known here", function,
                          model_variables[knowns[i]].name);
        if (!isfinite(seeds[i]))
            return report(instance, fmi2Error, "%s: the seed %g of '%s' is not a finite number", function, seeds[i],
                          model_variables[knowns[i]].name);
        seed[knowns[i]] += seeds[i];
    }
    if (instance->now.mode == INITIALIZATION)
        for (int i = 0; i < MODEL_STATES + MODEL_DISCRETES; i++)
            seed[FIRST_STATE + i] = seed[model_start_of[i]];
    if (!engine_tangent(instance->engine, instance->now.time, seed, result, message))
        return report(instance, fmi2Error, "%s: %s", function, message);
    for (size_t i = 0; i < n_unknowns; i++) {
        int index = (int)unknowns[i];
        Role role = model_variables[index].role;
        results[i] = role == ROLE_DERIVATIVE ? result[index - FIRST_DERIVATIVE]
                     : role == ROLE_OUTPUT   ? result[MODEL_STATES + index - FIRST_OUTPUT]
                                             : seed[index];
        if (!isfinite(results[i]))
            return report(instance, fmi2Error, "%s: the derivative of '%s' is not a finite number", function,
                          model_variables[index].name);
    }
    return fmi2OK;
}

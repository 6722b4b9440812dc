/* FMI 3.0: reading and writing of variables. */
#include <math.h>

#include "arrays.h"
#include "exchange.h"
#include "values.h"
#include "variables.h"

/* ---- numbers ------------------------------------------------------------------------------------ */

/* A variable of this version only: the time, or an event indicator. */
static fmi3Status get_own(Instance *instance, const char *function, Reference vr, double *value) {
    double indicators[MODEL_INDICATORS + 1];
    if (!allowed(instance, READABLE, function))
        return fmi3Error;
    if (vr == TIME) {
        *value = instance->now.time;
        return fmi3OK;
    }
    if (!indicate(instance, indicators))
        return report(instance, fmi3Error, "%s: the law of event indicators could not be evaluated", function);
    *value = indicators[vr - FIRST_INDICATOR];
    if (isfinite(*value))
        return fmi3OK;
    return report(instance, instance->now.mode == CONTINUOUS ? fmi3Discard : fmi3Error, /* a shorter step may help */
                  "%s: the event indicator of value reference %u is not a finite number at t = %.10g s", function, vr,
                  instance->now.time);
}

/* Variables some of which are of this version only. */
static fmi3Status get_mixed(Instance *instance, const char *function, const Reference vr[], size_t n, double value[]) {
    fmi3Status status = fmi3OK;
    if (value == NULL)
        return get_reals(instance, function, vr, n, value);
    for (size_t i = 0; i < n && status == fmi3OK; i++)
        status = is_own(vr[i]) ? get_own(instance, function, vr[i], value + i)
                               : get_reals(instance, function, vr + i, 1, value + i);
    return status;
}

static bool any_own(const Reference vr[], size_t n) {
    for (size_t i = 0; i < n; i++)
        if (is_own(vr[i]))
            return true;
    return false;
}

static Status get_floats(Instance *instance, const char *function, const Reference vr[], size_t n, double value[]) {
    return vr != NULL && any_own(vr, n) ? get_mixed(instance, function, vr, n, value)
                                        : get_reals(instance, function, vr, n, value);
}

static Status get_booleans(Instance *instance, const char *function, const Reference vr[], size_t n, bool value[]) {
    Status status = readable(instance, function, TYPE_BOOLEAN, vr, n, value);
    for (size_t i = 0; i < n && status == fmi3OK; i++)
        value[i] = instance->now.memory[vr[i]] != 0.0;
    return status;
}

#define GET(type, get)                                                                                                  \
    EXPORT fmi3Status fmi3Get##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3##type value[],        \
                                    size_t n_values) {                                                                  \
        Elements all;                                                                                                   \
        bool found;                                                                                                     \
        fmi3Status status;                                                                                              \
        if (are_scalars(vr, n, n_values))                                                                               \
            return get(c, __func__, vr, n, value);                                                                      \
        found = find_elements(c, __func__, vr, n, n_values, &all);                                                      \
        status = found ? get(c, __func__, all.vr, all.n, value) : fmi3Error;                                            \
        release(&all);                                                                                                  \
        return status;                                                                                                  \
    }
GET(Float64, get_floats)
GET(Int32, get_integers)
GET(Boolean, get_booleans)
GET(String, get_texts)
#undef GET

#define SET(type, kind)                                                                                                 \
    static double number_of_##type(const void *values, size_t i) { return ((const fmi3##type *)values)[i]; }            \
    EXPORT fmi3Status fmi3Set##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3##type value[],  \
                                    size_t n_values) {                                                                  \
        Elements all;                                                                                                   \
        bool found;                                                                                                     \
        fmi3Status status;                                                                                              \
        if (are_scalars(vr, n, n_values))                                                                               \
            return set_numbers(c, __func__, kind, vr, n, value, number_of_##type);                                      \
        found = find_elements(c, __func__, vr, n, n_values, &all);                                                      \
        status = found ? set_numbers(c, __func__, kind, all.vr, all.n, value, number_of_##type) : fmi3Error;            \
        release(&all);                                                                                                  \
        return status;                                                                                                  \
    }
SET(Float64, TYPE_REAL)
SET(Int32, TYPE_INTEGER)
SET(Boolean, TYPE_BOOLEAN)
#undef SET

EXPORT fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3String value[],
                                size_t n_values) {
    Elements all;
    bool found = find_elements(c, __func__, vr, n, n_values, &all);
    fmi3Status status = found ? set_texts(c, __func__, all.vr, all.n, value) : fmi3Error;
    release(&all);
    return status;
}

/* ---- types that no variable has ----------------------------------------------------------------- */

static fmi3Status absent(const Instance *instance, const char *function, const fmi3ValueReference vr[], size_t n) {
    if (!allowed(instance, ANY_MODE, function))
        return fmi3Error;
    if (n == 0)
        return fmi3OK;
    if (vr == NULL)
        return report(instance, fmi3Error, "%s: an array is NULL though it should have %zu elements", function, n);
    return report(instance, fmi3Error, "%s: value reference %u is of another type; %s has no variable of this one",
                  function, vr[0], model_name);
}

#define ABSENT(type)                                                                                                    \
    EXPORT fmi3Status fmi3Get##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3##type value[],        \
                                    size_t n_values) {                                                                  \
        (void)value;                                                                                                    \
        (void)n_values;                                                                                                 \
        return absent(c, __func__, vr, n);                                                                              \
    }                                                                                                                   \
    EXPORT fmi3Status fmi3Set##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3##type value[],  \
                                    size_t n_values) {                                                                  \
        (void)value;                                                                                                    \
        (void)n_values;                                                                                                 \
        return absent(c, __func__, vr, n);                                                                              \
    }
ABSENT(Float32)
ABSENT(Int8)
ABSENT(UInt8)
ABSENT(Int16)
ABSENT(UInt16)
ABSENT(UInt32)
ABSENT(Int64)
ABSENT(UInt64)
#undef ABSENT

EXPORT fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, size_t sizes[],
                                fmi3Binary value[], size_t n_values) {
    (void)sizes;
    (void)value;
    (void)n_values;
    return absent(c, __func__, vr, n);
}

EXPORT fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const size_t sizes[],
                                const fmi3Binary value[], size_t n_values) {
    (void)sizes;
    (void)value;
    (void)n_values;
    return absent(c, __func__, vr, n);
}

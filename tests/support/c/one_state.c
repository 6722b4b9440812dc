/* The smallest honest co-simulation FMU: one state, one input, one parameter,
 *
 *     tau dx/dt = u - x,    u held over the communication step,
 *
 * advanced with its exact solution. It is written by hand, without the kit, so that it can serve as a yardstick for
 * speed (nothing can be cheaper and still be an FMU) and for the hosts of the tests (its result is known in closed form).
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { U, X, TAU, NUMBER_OF_VALUES };

static const char guid[] = "one-state";
static const double start_values[NUMBER_OF_VALUES] = {0.0, 0.0, 1.0};

typedef struct {
    double value[NUMBER_OF_VALUES];
    double time;
    const fmi2CallbackFunctions *functions;
} Instance;

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    (void)c, (void)on, (void)n, (void)categories;
    return fmi2OK;
}

static void start(Instance *instance) {
    memcpy(instance->value, start_values, sizeof start_values);
    instance->time = 0.0;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String expected_guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)name, (void)resources, (void)visible, (void)logging;
    if (type != fmi2CoSimulation || expected_guid == NULL || strcmp(expected_guid, guid) != 0) return NULL;
    Instance *instance = malloc(sizeof *instance);
    if (instance == NULL) return NULL;
    instance->functions = functions;
    start(instance);
    return instance;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start_time,
                               fmi2Boolean stop_time_defined, fmi2Real stop_time) {
    (void)tolerance_defined, (void)tolerance, (void)stop_time_defined, (void)stop_time;
    ((Instance *)c)->time = start_time;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    const Instance *instance = c;
    const fmi2CallbackFunctions *f = instance->functions;
    if (instance->value[TAU] > 0.0) return fmi2OK;
    if (f != NULL && f->logger != NULL) {
        f->logger(f->componentEnvironment, "one_state", fmi2Error, "logStatusError", "tau = %g s: must be positive",
                  instance->value[TAU]);
    }
    return fmi2Error;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    start(c);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    const Instance *instance = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= NUMBER_OF_VALUES) return fmi2Error;
        value[i] = instance->value[vr[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    Instance *instance = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= NUMBER_OF_VALUES) return fmi2Error;
        instance->value[vr[i]] = value[i];
    }
    return fmi2OK;
}

/* There is no variable of another type: reading or writing none of them succeeds, any of them fails. */
#define NO_VARIABLE_OF_TYPE(Name, Type)                                                                       \
    fmi2Status fmi2Get##Name(fmi2Component c, const fmi2ValueReference vr[], size_t n, Type value[]) {         \
        (void)c, (void)vr, (void)value;                                                                        \
        return n == 0 ? fmi2OK : fmi2Error;                                                                    \
    }                                                                                                          \
    fmi2Status fmi2Set##Name(fmi2Component c, const fmi2ValueReference vr[], size_t n, const Type value[]) {   \
        (void)c, (void)vr, (void)value;                                                                        \
        return n == 0 ? fmi2OK : fmi2Error;                                                                    \
    }

NO_VARIABLE_OF_TYPE(Integer, fmi2Integer)
NO_VARIABLE_OF_TYPE(Boolean, fmi2Boolean)
NO_VARIABLE_OF_TYPE(String, fmi2String)

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (*state == NULL) *state = malloc(sizeof(Instance));
    if (*state == NULL) return fmi2Error;
    memcpy(*state, c, sizeof(Instance));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    if (state == NULL) return fmi2Error;
    const fmi2CallbackFunctions *own = ((Instance *)c)->functions; /* a state may come from another instance */
    memcpy(c, state, sizeof(Instance));
    ((Instance *)c)->functions = own;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)c, (void)state;
    *size = sizeof(Instance);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    (void)c;
    if (state == NULL || size < sizeof(Instance)) return fmi2Error;
    memcpy(bytes, state, sizeof(Instance));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    (void)c;
    if (size != sizeof(Instance)) return fmi2Error;
    if (*state == NULL) *state = malloc(sizeof(Instance));
    if (*state == NULL) return fmi2Error;
    memcpy(*state, bytes, sizeof(Instance));
    return fmi2OK;
}

/* The only output is a state: it does not depend on the input at the same time. */
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n_unknown,
                                        const fmi2ValueReference known[], size_t n_known, const fmi2Real dknown[],
                                        fmi2Real dunknown[]) {
    (void)c, (void)unknown, (void)known, (void)n_known, (void)dknown;
    for (size_t i = 0; i < n_unknown; i++) dunknown[i] = 0.0;
    return fmi2OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    (void)c, (void)vr, (void)n, (void)order, (void)value;
    return fmi2Error;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[]) {
    (void)c, (void)vr, (void)n, (void)order, (void)value;
    return fmi2Error;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_state_set_before) {
    Instance *instance = c;
    (void)no_state_set_before;
    if (!(step > 0.0)) return fmi2Error;
    instance->value[X] -= expm1(-step / instance->value[TAU]) * (instance->value[U] - instance->value[X]);
    instance->time = time + step;
    return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    (void)c;
    return fmi2Error;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = ((Instance *)c)->time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    (void)c;
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

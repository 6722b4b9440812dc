/* A member for tests of the master, whose answer is known in closed form and whose manners can be chosen:
 *
 *     tau dx/dt = u - x        exact for an input that is held or, where that is declared, has a slope
 *     y = c x + d u + e cos(u)
 *
 * With `euler` a step is one of Euler's, so that its size shows. From `when` on, a step answers with `status`; then
 * `nan` makes the output y no number. `init` is the status at the end of initialization, `lag` is by how much the time it
 * says it has reached is wrong. Every setting of the input alone adds `trace` to the state, which begins with
 * `follow` times the input. Compiled with ONCE, it can be instantiated once in a process.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

enum { U, X, Y, TAU, C, D, E, START, EULER, STATUS, WHEN, NOT_A_NUMBER, INIT, LAG, TRACE, FOLLOW, NUMBER_OF_VALUES };

typedef struct {
    double value[NUMBER_OF_VALUES];
    double time, slope;
    int waiting;
    const fmi2CallbackFunctions *functions;
} Instance;

static void say(const Instance *instance, fmi2Status status, const char *text) {
    const fmi2CallbackFunctions *f = instance->functions;
    f->logger(f->componentEnvironment, "member", status, "category", text);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)name, (void)type, (void)guid, (void)resources, (void)visible, (void)logging;
#ifdef ONCE
    static int there;
    if (there++) return NULL; /* a process has room for one */
#endif
    Instance *instance = calloc(1, sizeof *instance);
    instance->functions = functions;
    instance->value[TAU] = instance->value[C] = 1.0;
    return instance;
}

void fmi2FreeInstance(fmi2Component c) {
    if (((Instance *)c)->value[STATUS] == fmi2Fatal) abort(); /* nobody may call it any more */
    free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start_time,
                               fmi2Boolean stop_time_defined, fmi2Real stop_time) {
    (void)tolerance_defined, (void)tolerance, (void)stop_time_defined, (void)stop_time;
    ((Instance *)c)->time = start_time;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *instance = c;
    instance->value[X] = instance->value[START] + instance->value[FOLLOW] * instance->value[U];
    if (instance->value[INIT] > fmi2OK) say(instance, (fmi2Status)instance->value[INIT], "I do not want to begin");
    return (fmi2Status)instance->value[INIT];
}

fmi2Status fmi2Terminate(fmi2Component c) { return c ? fmi2OK : fmi2Error; }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    Instance *instance = c;
    double *own = instance->value, u = own[U];
    own[Y] = own[C] * own[X] + own[D] * u + own[E] * cos(u);
    if (own[NOT_A_NUMBER] != 0.0 && instance->time >= own[WHEN]) own[Y] = NAN;
    for (size_t i = 0; i < n; i++) value[i] = own[vr[i]];
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    Instance *instance = c;
    for (size_t i = 0; i < n; i++) instance->value[vr[i]] = value[i];
    if (n == 1 && vr[0] == U) instance->value[X] += instance->value[TRACE];
    if (instance->time == 0.0) instance->value[X] = instance->value[START];
    return fmi2OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    if (n != 1 || vr[0] != U || order[0] != 1) return fmi2Error;
    ((Instance *)c)->slope = value[0];
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (*state == NULL) *state = malloc(sizeof(Instance));
    memcpy(*state, c, sizeof(Instance));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    memcpy(c, state, sizeof(Instance));
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (((Instance *)c)->value[STATUS] == fmi2Fatal) abort(); /* nobody may call it any more */
    free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_state_set_before) {
    Instance *instance = c;
    double *own = instance->value, tau = own[TAU], slope = instance->slope;
    (void)no_state_set_before;
    if (fabs(time - instance->time) > 1e-12) {
        say(instance, fmi2Error, "the step begins where I am not");
        return fmi2Error;
    }
    fmi2Status status = time >= own[WHEN] - 1e-9 ? (fmi2Status)own[STATUS] : fmi2OK;
    if (status > fmi2OK && status < fmi2Pending) say(instance, status, "I have had enough");
    if (status > fmi2Warning && status < fmi2Pending) return status;
    if (own[EULER] != 0.0)
        own[X] += step / tau * (own[U] - own[X]);
    else
        own[X] = own[U] + slope * (step - tau) + (own[X] - own[U] + slope * tau) * exp(-step / tau);
    own[U] += slope * step;
    instance->slope = 0.0;
    instance->time = time + step;
    instance->waiting = 3;
    return status;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    if (kind != fmi2DoStepStatus) return fmi2Discard;
    *value = ((Instance *)c)->waiting-- > 0 ? fmi2Pending : fmi2OK;
    return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = ((Instance *)c)->time - ((Instance *)c)->value[LAG];
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = ((Instance *)c)->value[STATUS] == fmi2Discard;
    return fmi2OK;
}

/* Hosts look for these when they load the library; nobody calls them. */
#define ABSENT(Name) \
    fmi2Status fmi2##Name(void) { return fmi2Error; }

ABSENT(GetTypesPlatform)
ABSENT(GetVersion)
ABSENT(SetDebugLogging)
ABSENT(Reset)
ABSENT(GetInteger)
ABSENT(GetBoolean)
ABSENT(GetString)
ABSENT(SetInteger)
ABSENT(SetBoolean)
ABSENT(SetString)
ABSENT(SerializedFMUstateSize)
ABSENT(SerializeFMUstate)
ABSENT(DeSerializeFMUstate)
ABSENT(GetDirectionalDerivative)
ABSENT(GetRealOutputDerivatives)
ABSENT(CancelStep)
ABSENT(GetIntegerStatus)
ABSENT(GetStringStatus)

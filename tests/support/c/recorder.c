/* An FMU that writes down every call with its arguments, for FMI 2.0 and 3.0 and for both interfaces.
 *
 *     tau dx/dt = u - x,    x(0) = u(0),    y = k x
 *
 * It begins in the steady state of its first input, as Modelica's "initial equation der(x) = 0" does. Each call is a
 * line of the file that the environment variable RECORDED_CALLS names: process, instance, function, arguments.
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if VERSION == 2
#include "fmi2TypesPlatform.h"
#include "fmi2FunctionTypes.h"
typedef fmi2Status Status;
#else
#include "fmi3Functions.h"
typedef fmi3Status Status;
#endif

enum { K, TAU, KEEPS, ENDS, FAILS, U, Y, X, RATE, TIME, VALUES };
enum { OK = 0, DISCARD = 2, ERROR = 3 };

typedef struct {
    int number;
    double value[VALUES];
    double reached;
    int ended;
} Instance;

static int count;

static void note(const Instance *m, const char *function, const char *format, ...) {
    const char *path = getenv("RECORDED_CALLS");
    FILE *file = path ? fopen(path, "a") : NULL;
    va_list arguments;
    char line[4096];
    if (!file) return;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    fprintf(file, "%ld %d %s %s\n", (long)getpid(), m ? m->number : 0, function, line);
    fclose(file);
}

static void begin(Instance *m) {
    memset(m->value, 0, sizeof m->value);
    m->value[K] = m->value[TAU] = 1.0;
    m->value[ENDS] = m->value[FAILS] = 1e300;
    m->ended = 0;
}

static Instance *create(void) {
    Instance *m = calloc(1, sizeof *m);
    m->number = ++count;
    begin(m);
    return m;
}

static Status reset(Instance *m) {
    double x = m->value[X], keeps = m->value[KEEPS];
    note(m, "Reset", "");
    begin(m);
    if (keeps > 0.0) m->value[X] = x, m->value[KEEPS] = keeps;
    return OK;
}

static void exit_initialization(Instance *m) {
    note(m, "ExitInitializationMode", "");
    if (!(m->value[KEEPS] > 0.0 && m->value[X] != 0.0)) m->value[X] = m->value[U];
}

static Status step(Instance *m, double from, double size) {
    double *v = m->value, until = from + size;
    note(m, "DoStep", "%.17g %.17g", from, size);
    if (until > v[FAILS]) return ERROR;
    m->ended = until > v[ENDS] + 1e-12;
    if (m->ended) until = v[ENDS] > from ? v[ENDS] : from;
    v[X] += -expm1(-(until - from) / v[TAU]) * (v[U] - v[X]);
    v[TIME] = m->reached = until;
    return OK;
}

static void get(Instance *m, const unsigned *references, size_t n, double *values) {
    char text[1024] = "", *end = text;
    m->value[Y] = m->value[K] * m->value[X];
    m->value[RATE] = (m->value[U] - m->value[X]) / m->value[TAU];
    for (size_t i = 0; i < n; i++) {
        values[i] = m->value[references[i]];
        end += sprintf(end, "%u ", references[i]);
    }
    note(m, "GetReal", "%s", text);
}

static void set(Instance *m, const unsigned *references, size_t n, const double *values) {
    char text[1024] = "", *end = text;
    for (size_t i = 0; i < n; i++) {
        m->value[references[i]] = values[i];
        end += sprintf(end, "%u=%.17g ", references[i], values[i]);
    }
    note(m, "SetReal", "%s", text);
}

#if VERSION == 2

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type kind, fmi2String guid, fmi2String place,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    Instance *m = create();
    note(m, "Instantiate", "%s", kind == fmi2CoSimulation ? "CoSimulation" : "ModelExchange");
    return m;
}
void fmi2FreeInstance(fmi2Component c) { note(c, "FreeInstance", ""), free(c); }
#define PLAIN(name, act)                                                                                               \
    fmi2Status fmi2##name(fmi2Component c) {                                                                           \
        Instance *m = c;                                                                                               \
        act;                                                                                                           \
        return fmi2OK;                                                                                                 \
    }
PLAIN(EnterInitializationMode, note(m, "EnterInitializationMode", ""))
PLAIN(ExitInitializationMode, exit_initialization(m))
PLAIN(Terminate, note(m, "Terminate", ""))
PLAIN(Reset, reset(m))
PLAIN(EnterEventMode, note(m, "EnterEventMode", ""))
PLAIN(EnterContinuousTimeMode, note(m, "EnterContinuousTimeMode", ""))

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean t, fmi2Real tolerance, fmi2Real start, fmi2Boolean s,
                               fmi2Real stop) {
    note(c, "SetupExperiment", "%d %.17g %.17g %d %.17g", t, tolerance, start, s, stop);
    return fmi2OK;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[]) {
    get(c, r, n, v);
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[]) {
    set(c, r, n, v);
    return fmi2OK;
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real from, fmi2Real size, fmi2Boolean none) {
    Instance *m = c;
    fmi2Status status = (fmi2Status)step(m, from, size);
    return status == fmi2OK && m->ended ? fmi2Discard : status;
}
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *v) {
    note(c, "GetBooleanStatus", "%d", kind);
    *v = ((Instance *)c)->ended;
    return fmi2OK;
}
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *v) {
    note(c, "GetRealStatus", "%d", kind);
    *v = ((Instance *)c)->reached;
    return fmi2OK;
}
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    note(c, "NewDiscreteStates", "");
    memset(info, 0, sizeof *info);
    return fmi2OK;
}
fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean none, fmi2Boolean *event, fmi2Boolean *end) {
    note(c, "CompletedIntegratorStep", "");
    *event = 0;
    *end = ((Instance *)c)->value[TIME] > ((Instance *)c)->value[ENDS];
    return fmi2OK;
}
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    note(c, "SetTime", "%.17g", time);
    ((Instance *)c)->value[TIME] = time;
    return fmi2OK;
}
fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
    note(c, "SetContinuousStates", "%.17g", x[0]);
    ((Instance *)c)->value[X] = x[0];
    return fmi2OK;
}
fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    note(c, "GetContinuousStates", "");
    x[0] = ((Instance *)c)->value[X];
    return fmi2OK;
}
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    note(c, "GetNominalsOfContinuousStates", "");
    x[0] = 1.0;
    return fmi2OK;
}
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real x[], size_t n) {
    const double *v = ((Instance *)c)->value;
    note(c, "GetDerivatives", "");
    x[0] = (v[U] - v[X]) / v[TAU];
    return fmi2OK;
}
fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) { return fmi2OK; }

/* What is not used, and must be there: whoever calls it is written down, and refused. */
#define UNUSED(name)                                                                                                   \
    fmi2Status fmi2##name() {                                                                                          \
        note(NULL, #name, "");                                                                                         \
        return fmi2Error;                                                                                              \
    }
UNUSED(SetDebugLogging)
UNUSED(GetInteger)
UNUSED(GetBoolean)
UNUSED(GetString)
UNUSED(SetInteger)
UNUSED(SetBoolean)
UNUSED(SetString)
UNUSED(GetFMUstate)
UNUSED(SetFMUstate)
UNUSED(FreeFMUstate)
UNUSED(SerializedFMUstateSize)
UNUSED(SerializeFMUstate)
UNUSED(DeSerializeFMUstate)
UNUSED(GetDirectionalDerivative)
UNUSED(SetRealInputDerivatives)
UNUSED(GetRealOutputDerivatives)
UNUSED(CancelStep)
UNUSED(GetStatus)
UNUSED(GetIntegerStatus)
UNUSED(GetStringStatus)

#else

const char *fmi3GetVersion(void) { return fmi3Version; }

static Instance *made(const char *kind) {
    Instance *m = create();
    note(m, "Instantiate", "%s", kind);
    return m;
}
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    return made("CoSimulation");
}
fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
    return made("ModelExchange");
}
void fmi3FreeInstance(fmi3Instance c) { note(c, "FreeInstance", ""), free(c); }
#define PLAIN(name, act)                                                                                               \
    fmi3Status fmi3##name(fmi3Instance c) {                                                                            \
        Instance *m = c;                                                                                               \
        act;                                                                                                           \
        return fmi3OK;                                                                                                 \
    }
PLAIN(ExitInitializationMode, exit_initialization(m))
PLAIN(Terminate, note(m, "Terminate", ""))
PLAIN(Reset, reset(m))
PLAIN(EnterEventMode, note(m, "EnterEventMode", ""))
PLAIN(EnterContinuousTimeMode, note(m, "EnterContinuousTimeMode", ""))

/* What FMI 2.0 tells before, FMI 3.0 tells here: written down as the two calls. */
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean t, fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean s, fmi3Float64 stop) {
    note(c, "EnterInitializationMode", "%d %.17g %.17g %d %.17g", t, tolerance, start, s, stop);
    return fmi3OK;
}
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 v[], size_t values) {
    get(c, r, n, v);
    return fmi3OK;
}
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[],
                          size_t values) {
    set(c, r, n, v);
    return fmi3OK;
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 from, fmi3Float64 size, fmi3Boolean none, fmi3Boolean *event,
                      fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *last) {
    Instance *m = c;
    fmi3Status status = (fmi3Status)step(m, from, size);
    *event = *early = fmi3False;
    *end = m->ended;
    *last = m->reached;
    return status;
}
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *next, fmi3Float64 *time) {
    note(c, "NewDiscreteStates", "");
    *again = *end = *nominals = *values = *next = fmi3False;
    *time = 0.0;
    return fmi3OK;
}
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean none, fmi3Boolean *event, fmi3Boolean *end) {
    note(c, "CompletedIntegratorStep", "");
    *event = fmi3False;
    *end = ((Instance *)c)->value[TIME] > ((Instance *)c)->value[ENDS];
    return fmi3OK;
}
fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) {
    note(c, "SetTime", "%.17g", time);
    ((Instance *)c)->value[TIME] = time;
    return fmi3OK;
}
fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n) {
    note(c, "SetContinuousStates", "%.17g", x[0]);
    ((Instance *)c)->value[X] = x[0];
    return fmi3OK;
}
fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) {
    note(c, "GetContinuousStates", "");
    x[0] = ((Instance *)c)->value[X];
    return fmi3OK;
}
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) {
    note(c, "GetNominalsOfContinuousStates", "");
    x[0] = 1.0;
    return fmi3OK;
}
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 x[], size_t n) {
    const double *v = ((Instance *)c)->value;
    note(c, "GetDerivatives", "");
    x[0] = (v[U] - v[X]) / v[TAU];
    return fmi3OK;
}
fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 z[], size_t n) { return fmi3OK; }

#endif

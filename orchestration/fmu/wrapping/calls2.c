/* The functions of FMI 2.0 and their arguments; see `calls.c`. */
#include "calls.c"

#include "fmi2Functions.h"

#define NONE
#define C fmi2Component c
#define R const fmi2ValueReference r[], size_t n
#define PLAIN(X, name) X(2, name, (C), (c), NONE, NONE)
#define VALUES(X, type, show)                                                                                          \
    X(2, Get##type, (C, R, fmi2##type v[]), (c, r, n, v), references("vr", r, n), show("value", v, n))                 \
    X(2, Set##type, (C, R, const fmi2##type v[]), (c, r, n, v), references("vr", r, n); show("value", v, n), NONE)
#define STATUS_OF(X, name, type, show)                                                                                 \
    X(2, name, (C, const fmi2StatusKind s, type *v), (c, s, v), whole("s", s), show("value", *v))

#define FUNCTIONS(X)                                                                                                   \
    X(2, SetDebugLogging, (C, fmi2Boolean on, size_t n, const fmi2String categories[]), (c, on, n, categories),        \
      truth("loggingOn", on); texts("categories", categories, n), NONE)                                                \
    X(2, SetupExperiment,                                                                                              \
      (C, fmi2Boolean tells, fmi2Real tolerance, fmi2Real start, fmi2Boolean stops, fmi2Real stop),                    \
      (c, tells, tolerance, start, stops, stop),                                                                       \
      truth("toleranceDefined", tells); real("tolerance", tolerance); real("startTime", start);                        \
      truth("stopTimeDefined", stops); real("stopTime", stop), NONE)                                                   \
    PLAIN(X, EnterInitializationMode)                                                                                  \
    PLAIN(X, ExitInitializationMode)                                                                                   \
    PLAIN(X, Terminate)                                                                                                \
    PLAIN(X, Reset)                                                                                                    \
    VALUES(X, Real, reals)                                                                                             \
    VALUES(X, Integer, integers)                                                                                       \
    VALUES(X, Boolean, integers)                                                                                       \
    VALUES(X, String, texts)                                                                                           \
    X(2, GetFMUstate, (C, fmi2FMUstate *s), (c, s), NONE, address("FMUstate", *s))                                     \
    X(2, SetFMUstate, (C, fmi2FMUstate s), (c, s), address("FMUstate", s), NONE)                                       \
    X(2, FreeFMUstate, (C, fmi2FMUstate *s), (c, s), address("FMUstate", s ? *s : NULL), NONE)                         \
    X(2, SerializedFMUstateSize, (C, fmi2FMUstate s, size_t *n), (c, s, n), address("FMUstate", s),                    \
      whole("size", (long long)*n))                                                                                    \
    X(2, SerializeFMUstate, (C, fmi2FMUstate s, fmi2Byte b[], size_t n), (c, s, b, n),                                 \
      address("FMUstate", s); whole("size", (long long)n), NONE)                                                       \
    X(2, DeSerializeFMUstate, (C, const fmi2Byte b[], size_t n, fmi2FMUstate *s), (c, b, n, s),                        \
      whole("size", (long long)n), address("FMUstate", *s))                                                            \
    X(2, GetDirectionalDerivative,                                                                                     \
      (C, R, const fmi2ValueReference k[], size_t nk, const fmi2Real dk[], fmi2Real v[]), (c, r, n, k, nk, dk, v),     \
      references("vUnknown", r, n); references("vKnown", k, nk); reals("dvKnown", dk, nk), reals("dvUnknown", v, n))   \
    PLAIN(X, EnterEventMode)                                                                                           \
    X(2, NewDiscreteStates, (C, fmi2EventInfo *e), (c, e), NONE,                                                       \
      truth("newDiscreteStatesNeeded", e->newDiscreteStatesNeeded);                                                    \
      truth("terminateSimulation", e->terminateSimulation);                                                            \
      truth("nominalsOfContinuousStatesChanged", e->nominalsOfContinuousStatesChanged);                                \
      truth("valuesOfContinuousStatesChanged", e->valuesOfContinuousStatesChanged);                                    \
      truth("nextEventTimeDefined", e->nextEventTimeDefined); real("nextEventTime", e->nextEventTime))                 \
    PLAIN(X, EnterContinuousTimeMode)                                                                                  \
    X(2, CompletedIntegratorStep, (C, fmi2Boolean none, fmi2Boolean *event, fmi2Boolean *ends), (c, none, event, ends), \
      truth("noSetFMUStatePriorToCurrentPoint", none),                                                                 \
      truth("enterEventMode", *event); truth("terminateSimulation", *ends))                                            \
    X(2, SetTime, (C, fmi2Real time), (c, time), real("time", time), NONE)                                             \
    X(2, SetContinuousStates, (C, const fmi2Real x[], size_t n), (c, x, n), reals("x", x, n), NONE)                    \
    X(2, GetDerivatives, (C, fmi2Real x[], size_t n), (c, x, n), NONE, reals("derivatives", x, n))                     \
    X(2, GetEventIndicators, (C, fmi2Real x[], size_t n), (c, x, n), NONE, reals("eventIndicators", x, n))             \
    X(2, GetContinuousStates, (C, fmi2Real x[], size_t n), (c, x, n), NONE, reals("x", x, n))                          \
    X(2, GetNominalsOfContinuousStates, (C, fmi2Real x[], size_t n), (c, x, n), NONE, reals("x_nominal", x, n))        \
    X(2, SetRealInputDerivatives, (C, R, const fmi2Integer o[], const fmi2Real v[]), (c, r, n, o, v),                  \
      references("vr", r, n); integers("order", o, n); reals("value", v, n), NONE)                                     \
    X(2, GetRealOutputDerivatives, (C, R, const fmi2Integer o[], fmi2Real v[]), (c, r, n, o, v),                       \
      references("vr", r, n); integers("order", o, n), reals("value", v, n))                                           \
    X(2, DoStep, (C, fmi2Real time, fmi2Real size, fmi2Boolean none), (c, time, size, none),                           \
      real("currentCommunicationPoint", time); real("communicationStepSize", size);                                    \
      truth("noSetFMUStatePriorToCurrentPoint", none), NONE)                                                           \
    PLAIN(X, CancelStep)                                                                                               \
    STATUS_OF(X, GetStatus, fmi2Status, whole)                                                                         \
    STATUS_OF(X, GetRealStatus, fmi2Real, real)                                                                        \
    STATUS_OF(X, GetIntegerStatus, fmi2Integer, whole)                                                                 \
    STATUS_OF(X, GetBooleanStatus, fmi2Boolean, truth)                                                                 \
    STATUS_OF(X, GetStringStatus, fmi2String, text)

#define POINTER(version, name, parameters, arguments, before, after) fmi2##name##TYPE *name;
#define BIND(version, name, parameters, arguments, before, after)                                                      \
    address_found = find(library, "fmi2" #name);                                                                       \
    memcpy(&own.name, &address_found, sizeof address_found);

static struct {
    fmi2InstantiateTYPE *Instantiate;
    fmi2FreeInstanceTYPE *FreeInstance;
    FUNCTIONS(POINTER)
} own;

FMI2_Export const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

FMI2_Export const char *fmi2GetVersion(void) { return fmi2Version; }

FMI2_Export fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                          const fmi2CallbackFunctions *callbacks, fmi2Boolean visible,
                                          fmi2Boolean logging) {
    void *address_found;
    if (!load_own()) return unload_own();
    BIND(2, Instantiate, , , , )
    BIND(2, FreeInstance, , , , )
    FUNCTIONS(BIND)
    begin("fmi2Instantiate");
    text("instanceName", name);
    whole("fmuType", type);
    text("fmuGUID", guid);
    text("fmuResourceLocation", resources);
    truth("visible", visible);
    truth("loggingOn", logging);
    let_go();
    fmi2Component c = own.Instantiate ? own.Instantiate(name, type, guid, resources, callbacks, visible, logging) : NULL;
    end(c ? 0 : 3);
    return c ? c : unload_own();
}

FMI2_Export void fmi2FreeInstance(fmi2Component c) {
    begin("fmi2FreeInstance");
    let_go();
    if (own.FreeInstance) own.FreeInstance(c);
    end(0);
    unload_own();
}

FUNCTIONS(LOGGED)

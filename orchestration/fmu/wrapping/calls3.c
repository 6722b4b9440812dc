/* The functions of FMI 3.0 that the wrapper calls, and their arguments; see `calls.c`. */
#include "calls.c"

#include "fmi3Functions.h"

ARRAY(floats, float, add_real((double)values[i]))
ARRAY(truths, fmi3Boolean, add(values[i] ? "true" : "false"))
#define WHOLE(type) ARRAY(type##s, fmi3##type, add("%lld", (long long)values[i]))
WHOLE(Int8)
WHOLE(UInt8)
WHOLE(Int16)
WHOLE(UInt16)
WHOLE(Int64)
ARRAY(UInt64s, fmi3UInt64, add("%llu", (unsigned long long)values[i]))

/* The sizes of binary values, of which the bytes are not written. */
static void sizes_of(const char *name, const size_t *sizes, size_t n) {
    name_argument(name);
    for (size_t i = 0; i < n && i < MOST_ELEMENTS; i++) add("%s%lu", i ? ", " : "[", (unsigned long)sizes[i]);
    add("]");
}

#define NONE
#define C fmi3Instance c
#define R const fmi3ValueReference r[], size_t n
#define N size_t nv
#define PLAIN(X, name) X(3, name, (C), (c), NONE, NONE)
#define VALUES(X, type, show)                                                                                          \
    X(3, Get##type, (C, R, fmi3##type v[], N), (c, r, n, v, nv), references("valueReferences", r, n),                  \
      show("values", v, nv))                                                                                           \
    X(3, Set##type, (C, R, const fmi3##type v[], N), (c, r, n, v, nv),                                                 \
      references("valueReferences", r, n); show("values", v, nv), NONE)
#define VECTOR(X, name, label) X(3, name, (C, fmi3Float64 x[], size_t n), (c, x, n), NONE, reals(label, x, n))

#define FUNCTIONS(X)                                                                                                   \
    X(3, SetDebugLogging, (C, fmi3Boolean on, size_t n, const fmi3String categories[]), (c, on, n, categories),        \
      truth("loggingOn", on); texts("categories", categories, n), NONE)                                                \
    X(3, EnterInitializationMode,                                                                                      \
      (C, fmi3Boolean tells, fmi3Float64 tolerance, fmi3Float64 start, fmi3Boolean stops, fmi3Float64 stop),           \
      (c, tells, tolerance, start, stops, stop),                                                                       \
      truth("toleranceDefined", tells); real("tolerance", tolerance); real("startTime", start);                        \
      truth("stopTimeDefined", stops); real("stopTime", stop), NONE)                                                   \
    PLAIN(X, ExitInitializationMode)                                                                                   \
    PLAIN(X, Terminate)                                                                                                \
    PLAIN(X, Reset)                                                                                                    \
    VALUES(X, Float32, floats)                                                                                         \
    VALUES(X, Float64, reals)                                                                                          \
    VALUES(X, Int8, Int8s)                                                                                             \
    VALUES(X, UInt8, UInt8s)                                                                                           \
    VALUES(X, Int16, Int16s)                                                                                           \
    VALUES(X, UInt16, UInt16s)                                                                                         \
    VALUES(X, Int32, integers)                                                                                         \
    VALUES(X, UInt32, references)                                                                                      \
    VALUES(X, Int64, Int64s)                                                                                           \
    VALUES(X, UInt64, UInt64s)                                                                                         \
    VALUES(X, Boolean, truths)                                                                                         \
    VALUES(X, String, texts)                                                                                           \
    X(3, GetBinary, (C, R, size_t s[], fmi3Binary v[], N), (c, r, n, s, v, nv), references("valueReferences", r, n),   \
      sizes_of("valueSizes", s, nv))                                                                                   \
    X(3, SetBinary, (C, R, const size_t s[], const fmi3Binary v[], N), (c, r, n, s, v, nv),                            \
      references("valueReferences", r, n); sizes_of("valueSizes", s, nv), NONE)                                        \
    X(3, GetFMUState, (C, fmi3FMUState *s), (c, s), NONE, address("FMUState", *s))                                     \
    X(3, SetFMUState, (C, fmi3FMUState s), (c, s), address("FMUState", s), NONE)                                       \
    X(3, FreeFMUState, (C, fmi3FMUState *s), (c, s), address("FMUState", s ? *s : NULL), NONE)                         \
    X(3, SerializedFMUStateSize, (C, fmi3FMUState s, size_t *n), (c, s, n), address("FMUState", s),                    \
      whole("size", (long long)*n))                                                                                    \
    X(3, SerializeFMUState, (C, fmi3FMUState s, fmi3Byte b[], size_t n), (c, s, b, n),                                 \
      address("FMUState", s); whole("size", (long long)n), NONE)                                                       \
    X(3, DeserializeFMUState, (C, const fmi3Byte b[], size_t n, fmi3FMUState *s), (c, b, n, s),                        \
      whole("size", (long long)n), address("FMUState", *s))                                                            \
    X(3, GetDirectionalDerivative,                                                                                     \
      (C, R, const fmi3ValueReference k[], size_t nk, const fmi3Float64 dk[], size_t ns, fmi3Float64 v[], N),          \
      (c, r, n, k, nk, dk, ns, v, nv),                                                                                 \
      references("unknowns", r, n); references("knowns", k, nk); reals("seed", dk, ns), reals("sensitivity", v, nv))   \
    X(3, GetOutputDerivatives, (C, R, const fmi3Int32 o[], fmi3Float64 v[], N), (c, r, n, o, v, nv),                   \
      references("valueReferences", r, n); integers("orders", o, n), reals("values", v, nv))                           \
    X(3, DoStep,                                                                                                       \
      (C, fmi3Float64 time, fmi3Float64 size, fmi3Boolean none, fmi3Boolean *event, fmi3Boolean *ends,                 \
       fmi3Boolean *early, fmi3Float64 *last),                                                                         \
      (c, time, size, none, event, ends, early, last),                                                                 \
      real("currentCommunicationPoint", time); real("communicationStepSize", size);                                    \
      truth("noSetFMUStatePriorToCurrentPoint", none),                                                                 \
      truth("eventHandlingNeeded", *event); truth("terminateSimulation", *ends); truth("earlyReturn", *early);         \
      real("lastSuccessfulTime", *last))                                                                               \
    PLAIN(X, EnterEventMode)                                                                                           \
    X(3, UpdateDiscreteStates,                                                                                         \
      (C, fmi3Boolean *again, fmi3Boolean *ends, fmi3Boolean *nominals, fmi3Boolean *states, fmi3Boolean *timed,       \
       fmi3Float64 *time),                                                                                             \
      (c, again, ends, nominals, states, timed, time), NONE,                                                           \
      truth("discreteStatesNeedUpdate", *again); truth("terminateSimulation", *ends);                                  \
      truth("nominalsOfContinuousStatesChanged", *nominals); truth("valuesOfContinuousStatesChanged", *states);        \
      truth("nextEventTimeDefined", *timed); real("nextEventTime", *time))                                             \
    PLAIN(X, EnterContinuousTimeMode)                                                                                  \
    PLAIN(X, EnterStepMode)                                                                                            \
    X(3, CompletedIntegratorStep, (C, fmi3Boolean none, fmi3Boolean *event, fmi3Boolean *ends), (c, none, event, ends), \
      truth("noSetFMUStatePriorToCurrentPoint", none),                                                                 \
      truth("enterEventMode", *event); truth("terminateSimulation", *ends))                                            \
    X(3, SetTime, (C, fmi3Float64 time), (c, time), real("time", time), NONE)                                          \
    X(3, SetContinuousStates, (C, const fmi3Float64 x[], size_t n), (c, x, n), reals("continuousStates", x, n), NONE)  \
    VECTOR(X, GetContinuousStateDerivatives, "derivatives")                                                            \
    VECTOR(X, GetEventIndicators, "eventIndicators")                                                                   \
    VECTOR(X, GetContinuousStates, "continuousStates")                                                                 \
    VECTOR(X, GetNominalsOfContinuousStates, "nominals")                                                               \
    X(3, ActivateModelPartition, (C, fmi3ValueReference r, fmi3Float64 time), (c, r, time),                            \
      whole("clockReference", r); real("activationTime", time), NONE)                                                  \
    X(3, SetClock, (C, R, const fmi3Clock v[]), (c, r, n, v),                                                          \
      references("valueReferences", r, n); truths("values", v, n), NONE)                                               \
    X(3, GetIntervalDecimal, (C, R, fmi3Float64 v[], fmi3IntervalQualifier q[]), (c, r, n, v, q),                      \
      references("valueReferences", r, n), reals("intervals", v, n); integers("qualifiers", (const int *)q, n))        \
    X(3, GetShiftDecimal, (C, R, fmi3Float64 v[]), (c, r, n, v), references("valueReferences", r, n),                  \
      reals("shifts", v, n))

#define POINTER(version, name, parameters, arguments, before, after) fmi3##name##TYPE *name;
#define BIND(version, name, parameters, arguments, before, after)                                                      \
    address_found = find(library, "fmi3" #name);                                                                       \
    memcpy(&own.name, &address_found, sizeof address_found);

static struct {
    fmi3InstantiateCoSimulationTYPE *InstantiateCoSimulation;
    fmi3InstantiateModelExchangeTYPE *InstantiateModelExchange;
    fmi3InstantiateScheduledExecutionTYPE *InstantiateScheduledExecution;
    fmi3FreeInstanceTYPE *FreeInstance;
    FUNCTIONS(POINTER)
} own;

FMI3_Export const char *fmi3GetVersion(void) { return fmi3Version; }

/* An instantiation, which has more arguments in some interfaces. */
#define INSTANTIATED(kind, parameters, arguments, before)                                                              \
    FMI3_Export fmi3Instance fmi3Instantiate##kind parameters {                                                        \
        void *address_found;                                                                                           \
        if (!load_own()) return unload_own();                                                                          \
        BIND(3, Instantiate##kind, , , , )                                                                             \
        BIND(3, FreeInstance, , , , )                                                                                  \
        FUNCTIONS(BIND)                                                                                                \
        begin("fmi3Instantiate" #kind);                                                                                \
        text("instanceName", name);                                                                                    \
        text("instantiationToken", token);                                                                             \
        text("resourcePath", resources);                                                                               \
        truth("visible", visible);                                                                                     \
        truth("loggingOn", logging);                                                                                   \
        before;                                                                                                        \
        let_go();                                                                                                      \
        fmi3Instance c = own.Instantiate##kind ? own.Instantiate##kind arguments : NULL;                               \
        end(c ? 0 : 3);                                                                                                \
        return c ? c : unload_own();                                                                                   \
    }
#define FIRST fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging
#define LAST fmi3InstanceEnvironment e, fmi3LogMessageCallback log
INSTANTIATED(CoSimulation,
             (FIRST, fmi3Boolean events, fmi3Boolean early, R, LAST, fmi3IntermediateUpdateCallback u),
             (name, token, resources, visible, logging, events, early, r, n, e, log, u),
             truth("eventModeUsed", events); truth("earlyReturnAllowed", early))
INSTANTIATED(ModelExchange, (FIRST, LAST), (name, token, resources, visible, logging, e, log), NONE)
INSTANTIATED(ScheduledExecution,
             (FIRST, LAST, fmi3ClockUpdateCallback u, fmi3LockPreemptionCallback l, fmi3UnlockPreemptionCallback f),
             (name, token, resources, visible, logging, e, log, u, l, f), NONE)

FMI3_Export void fmi3FreeInstance(fmi3Instance c) {
    begin("fmi3FreeInstance");
    let_go();
    if (own.FreeInstance) own.FreeInstance(c);
    end(0);
    unload_own();
}

FUNCTIONS(LOGGED)

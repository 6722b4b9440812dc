/* An FMU for model exchange behind the functions of co-simulation, all of FMI 2.0: the solver CVode integrates it.
 *
 * Beside this library lies its table, a text file that `solver.py` writes: the library of the FMU, the five libraries
 * of SUNDIALS, and the numbers of states and event indicators, and whether integrator steps are to be told.
 *
 * Between two calls of fmi2DoStep the FMU is in Continuous-Time Mode. An input that is set to another value is an event
 * (FMI 2.0.4, 3.2.1): its mode is entered then, and left before anything is read or the next step is made.
 */
#include "platform.c"

#include <math.h>
#include <stdarg.h>

#include "fmi2Functions.h"

/* Of SUNDIALS 7, as far as it is used. */
typedef void *vector;
typedef int right_side(double time, vector x, vector rates, void *data);
typedef int root_function(double time, vector x, double *indicators, void *data);
enum { BDF = 2, ONE_STEP = 2, TSTOP_RETURN = 1, ROOT_RETURN = 2, SUNDIALS = 7 };

#define SOLVER(X)                                                                                                      \
    X(int, SUNDIALSGetVersionNumber, (int *, int *, int *, char *, int))                                               \
    X(int, SUNContext_Create, (int, void **))                                                                          \
    X(int, SUNContext_Free, (void **))                                                                                 \
    X(int, SUNContext_ClearErrHandlers, (void *))                                                                      \
    X(vector, N_VNew_Serial, (long long, void *))                                                                      \
    X(double *, N_VGetArrayPointer, (vector))                                                                          \
    X(void, N_VDestroy, (vector))                                                                                      \
    X(void *, SUNDenseMatrix, (long long, long long, void *))                                                          \
    X(void, SUNMatDestroy, (void *))                                                                                   \
    X(void *, SUNLinSol_Dense, (vector, void *, void *))                                                               \
    X(int, SUNLinSolFree, (void *))                                                                                    \
    X(void *, CVodeCreate, (int, void *))                                                                              \
    X(int, CVodeInit, (void *, right_side *, double, vector))                                                          \
    X(int, CVodeReInit, (void *, double, vector))                                                                      \
    X(int, CVodeSVtolerances, (void *, double, vector))                                                                \
    X(int, CVodeSetLinearSolver, (void *, void *, void *))                                                             \
    X(int, CVodeRootInit, (void *, int, root_function *))                                                              \
    X(int, CVodeSetUserData, (void *, void *))                                                                         \
    X(int, CVodeSetStopTime, (void *, double))                                                                         \
    X(int, CVodeSetNoInactiveRootWarn, (void *))                                                                       \
    X(int, CVode, (void *, double, vector, double *, int))                                                             \
    X(void, CVodeFree, (void **))

/* Functions of the FMU that are handed on as they are, and others that are called. */
#define HANDED_ON(X)                                                                                                   \
    X(SetDebugLogging, (fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]), (on, n, categories)) \
    X(GetString, (fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String v[]), (r, n, v))                 \
    X(SetString, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2String v[]), (r, n, v))           \
    X(GetDirectionalDerivative,                                                                                        \
      (fmi2Component c, const fmi2ValueReference u[], size_t nu, const fmi2ValueReference k[], size_t nk,              \
       const fmi2Real dk[], fmi2Real du[]),                                                                            \
      (u, nu, k, nk, dk, du))

#define CALLED(X)                                                                                                      \
    X(Instantiate) X(FreeInstance) X(SetupExperiment) X(EnterInitializationMode) X(ExitInitializationMode)             \
    X(Terminate) X(Reset) X(GetReal) X(GetInteger) X(GetBoolean) X(SetReal) X(SetInteger) X(SetBoolean)                \
    X(EnterEventMode) X(NewDiscreteStates) X(EnterContinuousTimeMode) X(CompletedIntegratorStep) X(SetTime)            \
    X(GetFMUstate) X(SetFMUstate) X(FreeFMUstate) X(SerializedFMUstateSize) X(SerializeFMUstate)                       \
    X(DeSerializeFMUstate) X(SetContinuousStates) X(GetDerivatives) X(GetEventIndicators) X(GetContinuousStates)                              \
    X(GetNominalsOfContinuousStates) X(SetDebugLogging) X(GetString) X(SetString) X(GetDirectionalDerivative)

#define FMI_POINTER(name) fmi2##name##TYPE *name;
#define SOLVER_POINTER(type, name, arguments) type(*name) arguments;

enum { LIBRARIES = 5, MOST_EVENTS = 1000 };
typedef enum { BEFORE, CONTINUOUS, EVENT, ENDED } mode;

/* What is part of a state beside that of the FMU. */
typedef struct {
    mode mode;
    double time, tolerance;
    int terminated, has_time_event;
    double time_event;
} progress;

typedef struct {
    progress now;
    fmi2FMUstate own;
} saved_state;

/* The last values that were set by one call, which is often made again with the same ones. */
typedef struct {
    size_t count, room;
    fmi2ValueReference *references;
    char *values;
} last_call;

typedef struct {
    struct {
        CALLED(FMI_POINTER)
    } call;
    struct {
        SOLVER(SOLVER_POINTER)
    } sun;
    void *library, *libraries[LIBRARIES];
    fmi2Component instance;
    const fmi2CallbackFunctions *callbacks;
    char *name;
    size_t states, indicators;
    int tells_steps;
    progress now;
    void *context, *solver, *matrix, *linear;
    vector x, absolute;
    last_call set[3]; /* reals, integers, booleans */
} component;

static void tell(const component *c, fmi2Status status, const char *format, ...) {
    char message[1024];
    va_list arguments;
    if (!c->callbacks || !c->callbacks->logger) return;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    c->callbacks->logger(c->callbacks->componentEnvironment, c->name, status, "solver", "%s", message);
}

/* ---- libraries ----------------------------------------------------------------------------------- */

static void *symbol(component *c, const char *name) {
    for (int i = 0; i < LIBRARIES; i++) {
        void *address = find(c->libraries[i], name);
        if (address) return address;
    }
    tell(c, fmi2Error, "the libraries of SUNDIALS lack the function %s", name);
    return NULL;
}

/* Bind all functions; the FMU's own may lack some, which are then not called. */
static int bind_all(component *c) {
    void *address;
    int complete = 1, major = 0, minor, patch;
    char label[8];
#define BIND_FMI(name)                                                                                                 \
    address = find(c->library, "fmi2" #name);                                                                          \
    memcpy(&c->call.name, &address, sizeof address);
    CALLED(BIND_FMI)
#define BIND_SOLVER(type, name, arguments)                                                                             \
    address = symbol(c, #name);                                                                                        \
    complete &= address != NULL;                                                                                       \
    memcpy(&c->sun.name, &address, sizeof address);
    SOLVER(BIND_SOLVER)
    if (!complete) return 0;
    c->sun.SUNDIALSGetVersionNumber(&major, &minor, &patch, label, (int)sizeof label);
    if (major == SUNDIALS) return 1;
    tell(c, fmi2Error, "the solver is of SUNDIALS %d, and %d is needed", major, SUNDIALS);
    return 0;
}

static void *load_line(component *c, FILE *table) {
    char reason[MOST_PATH] = "", *path = read_line(table);
    void *library = path ? open_library(path, reason, sizeof reason) : NULL;
    if (!library) tell(c, fmi2Error, "the library %s cannot be loaded (%s)", path ? path : "", reason);
    free(path);
    return library;
}

static int load_all(component *c) {
    FILE *table = open_table();
    unsigned long states, indicators;
    int complete = table && (c->library = load_line(c, table)) != NULL;
    for (int i = 0; complete && i < LIBRARIES; i++) complete = (c->libraries[i] = load_line(c, table)) != NULL;
    complete = complete && fscanf(table, "%lu %lu %d", &states, &indicators, &c->tells_steps) == 3;
    if (table) fclose(table);
    if (!complete) return 0;
    c->states = states;
    c->indicators = indicators;
    return bind_all(c);
}

/* ---- the solver ---------------------------------------------------------------------------------- */

static fmi2Status worse(fmi2Status a, fmi2Status b) { return a > b ? a : b; }

/* Without states there is one that does not change, so that events are found by the same solver. */
static size_t size(const component *c) { return c->states ? c->states : 1; }

/* Hand time and states to the FMU. */
static fmi2Status place(component *c, double time, vector x) {
    fmi2Status status = c->call.SetTime(c->instance, time);
    if (!c->states || status > fmi2Warning) return status;
    return worse(status, c->call.SetContinuousStates(c->instance, c->sun.N_VGetArrayPointer(x), c->states));
}

/* What CVode takes: 0, more where a shorter step may help, less where nothing does. */
static int answer(fmi2Status status) { return status <= fmi2Warning ? 0 : status == fmi2Discard ? 1 : -1; }

static int rates_of(double time, vector x, vector rates, void *data) {
    component *c = data;
    double *values = c->sun.N_VGetArrayPointer(rates);
    fmi2Status status = place(c, time, x);
    if (status > fmi2Warning) return answer(status);
    if (c->states) return answer(c->call.GetDerivatives(c->instance, values, c->states));
    values[0] = 0.0;
    return 0;
}

static int indicators_of(double time, vector x, double *indicators, void *data) {
    component *c = data;
    fmi2Status status = place(c, time, x);
    if (status > fmi2Warning) return answer(status);
    return answer(c->call.GetEventIndicators(c->instance, indicators, c->indicators));
}

/* Take states and their sizes from the FMU. */
static fmi2Status take(component *c) {
    double *x = c->sun.N_VGetArrayPointer(c->x), *absolute = c->sun.N_VGetArrayPointer(c->absolute);
    fmi2Status status = fmi2OK;
    x[0] = absolute[0] = 1.0;
    if (c->states) {
        status = c->call.GetContinuousStates(c->instance, x, c->states);
        if (status <= fmi2Warning)
            status = worse(status, c->call.GetNominalsOfContinuousStates(c->instance, absolute, c->states));
    }
    for (size_t i = 0; i < size(c); i++) absolute[i] = c->now.tolerance * (absolute[i] != 0.0 ? fabs(absolute[i]) : 1.0);
    return status;
}

static void end_solver(component *c) {
    if (c->solver) c->sun.CVodeFree(&c->solver);
    if (c->linear) c->sun.SUNLinSolFree(c->linear);
    if (c->matrix) c->sun.SUNMatDestroy(c->matrix);
    if (c->x) c->sun.N_VDestroy(c->x);
    if (c->absolute) c->sun.N_VDestroy(c->absolute);
    if (c->context) c->sun.SUNContext_Free(&c->context);
    c->solver = c->linear = c->matrix = c->x = c->absolute = c->context = NULL;
}

static fmi2Status begin_solver(component *c) {
    long long n = (long long)size(c);
    end_solver(c);
    if (c->sun.SUNContext_Create(0, &c->context)) return fmi2Error;
    c->sun.SUNContext_ClearErrHandlers(c->context);
    c->x = c->sun.N_VNew_Serial(n, c->context);
    c->absolute = c->sun.N_VNew_Serial(n, c->context);
    c->matrix = c->sun.SUNDenseMatrix(n, n, c->context);
    c->linear = c->sun.SUNLinSol_Dense(c->x, c->matrix, c->context);
    c->solver = c->sun.CVodeCreate(BDF, c->context);
    fmi2Status status = take(c);
    if (status > fmi2Warning) return status;
    int failed = c->sun.CVodeInit(c->solver, rates_of, c->now.time, c->x) ||
                 c->sun.CVodeSVtolerances(c->solver, c->now.tolerance, c->absolute) ||
                 c->sun.CVodeSetLinearSolver(c->solver, c->linear, c->matrix) ||
                 c->sun.CVodeSetUserData(c->solver, c) || c->sun.CVodeSetNoInactiveRootWarn(c->solver) ||
                 (c->indicators && c->sun.CVodeRootInit(c->solver, (int)c->indicators, indicators_of));
    if (failed) tell(c, fmi2Error, "CVode cannot begin");
    return failed ? fmi2Error : status;
}

/* ---- events -------------------------------------------------------------------------------------- */

/* Leave Event Mode: discrete states are updated until none changes. */
static fmi2Status leave_events(component *c) {
    fmi2EventInfo info = {.newDiscreteStatesNeeded = fmi2True};
    fmi2Status worst = fmi2OK;
    for (int k = 0; info.newDiscreteStatesNeeded; k++) {
        fmi2Status status = c->call.NewDiscreteStates(c->instance, &info);
        if (status > fmi2Warning) return status;
        worst = worse(worst, status);
        if (info.terminateSimulation) {
            c->now.terminated = 1;
            c->now.mode = ENDED;
            return worst;
        }
        if (k == MOST_EVENTS) {
            tell(c, fmi2Error, "its event iteration does not converge at %.10g s", c->now.time);
            return fmi2Error;
        }
    }
    c->now.has_time_event = info.nextEventTimeDefined;
    c->now.time_event = info.nextEventTime;
    fmi2Status status = c->call.EnterContinuousTimeMode(c->instance);
    if (status > fmi2Warning) return status;
    c->now.mode = CONTINUOUS;
    worst = worse(worst, status);
    if (!c->solver) return worse(worst, begin_solver(c));
    worst = worse(worst, take(c));
    if (worst > fmi2Warning) return worst;
    return c->sun.CVodeReInit(c->solver, c->now.time, c->x) ? fmi2Error : worst;
}

static fmi2Status enter_events(component *c) {
    if (c->now.mode != CONTINUOUS) return fmi2OK;
    c->now.mode = EVENT;
    return c->call.EnterEventMode(c->instance);
}

/* Leave Event Mode if an input has led into it. */
static fmi2Status settle(component *c) { return c->now.mode == EVENT ? leave_events(c) : fmi2OK; }

/* Whether a call sets the values of the last one; they are kept. */
static int is_same(last_call *last, const fmi2ValueReference r[], size_t n, const void *values, size_t width) {
    if (n == last->count && n && !memcmp(r, last->references, n * sizeof *r) && !memcmp(values, last->values, n * width))
        return 1;
    if (n > last->room) {
        last->references = realloc(last->references, n * sizeof *r);
        last->values = realloc(last->values, n * sizeof(double));
        last->room = n;
    }
    last->count = n;
    memcpy(last->references, r, n * sizeof *r);
    memcpy(last->values, values, n * width);
    return 0;
}

/* ---- life ---------------------------------------------------------------------------------------- */

FMI2_Export const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

FMI2_Export const char *fmi2GetVersion(void) { return fmi2Version; }

FMI2_Export fmi2Component fmi2Instantiate(fmi2String name, fmi2Type kind, fmi2String guid, fmi2String resources,
                                          const fmi2CallbackFunctions *callbacks, fmi2Boolean visible,
                                          fmi2Boolean logging) {
    component *c = calloc(1, sizeof *c);
    (void)kind;
    if (!c) return NULL;
    c->callbacks = callbacks;
    c->name = malloc(strlen(name) + 1);
    if (c->name) strcpy(c->name, name);
    if (c->name && load_all(c) && c->call.Instantiate)
        c->instance = c->call.Instantiate(name, fmi2ModelExchange, guid, resources, callbacks, visible, logging);
    if (c->instance) return c;
    free(c->name);
    free(c);
    return NULL;
}

FMI2_Export void fmi2FreeInstance(fmi2Component p) {
    component *c = p;
    if (!c) return;
    end_solver(c);
    c->call.FreeInstance(c->instance);
    for (int i = 0; i < 3; i++) free(c->set[i].references), free(c->set[i].values);
    close_library(c->library);
    for (int i = LIBRARIES - 1; i >= 0; i--) close_library(c->libraries[i]);
    free(c->name);
    free(c);
}

enum { USUAL_TOLERANCE = 1000000 }; /* its reciprocal, as long as no tolerance is told */

FMI2_Export fmi2Status fmi2SetupExperiment(fmi2Component p, fmi2Boolean has_tolerance, fmi2Real tolerance,
                                           fmi2Real start, fmi2Boolean has_stop, fmi2Real stop) {
    component *c = p;
    c->now.time = start;
    c->now.tolerance = has_tolerance ? tolerance : 1.0 / USUAL_TOLERANCE;
    return c->call.SetupExperiment(c->instance, has_tolerance, tolerance, start, has_stop, stop);
}

FMI2_Export fmi2Status fmi2EnterInitializationMode(fmi2Component p) {
    component *c = p;
    return c->call.EnterInitializationMode(c->instance);
}

FMI2_Export fmi2Status fmi2ExitInitializationMode(fmi2Component p) {
    component *c = p;
    fmi2Status status = c->call.ExitInitializationMode(c->instance);
    if (status > fmi2Warning) return status;
    c->now.mode = EVENT;
    return worse(status, leave_events(c));
}

FMI2_Export fmi2Status fmi2Terminate(fmi2Component p) {
    component *c = p;
    c->now.mode = ENDED;
    return c->call.Terminate(c->instance);
}

FMI2_Export fmi2Status fmi2Reset(fmi2Component p) {
    component *c = p;
    end_solver(c);
    c->now.mode = BEFORE;
    c->now.terminated = 0;
    for (int i = 0; i < 3; i++) c->set[i].count = 0;
    return c->call.Reset(c->instance);
}

/* ---- values -------------------------------------------------------------------------------------- */

#define VALUES(type, place)                                                                                            \
    FMI2_Export fmi2Status fmi2Get##type(fmi2Component p, const fmi2ValueReference r[], size_t n, fmi2##type v[]) {     \
        component *c = p;                                                                                              \
        fmi2Status status = settle(c);                                                                                 \
        return status > fmi2Warning ? status : worse(status, c->call.Get##type(c->instance, r, n, v));                  \
    }                                                                                                                  \
    FMI2_Export fmi2Status fmi2Set##type(fmi2Component p, const fmi2ValueReference r[], size_t n,                       \
                                         const fmi2##type v[]) {                                                       \
        component *c = p;                                                                                              \
        if (is_same(&c->set[place], r, n, v, sizeof *v)) return fmi2OK;                                                \
        fmi2Status status = enter_events(c);                                                                           \
        return status > fmi2Warning ? status : worse(status, c->call.Set##type(c->instance, r, n, v));                  \
    }

VALUES(Real, 0)
VALUES(Integer, 1)
VALUES(Boolean, 2)

#define REST(...) __VA_ARGS__
#define HAND_ON(name, arguments, values)                                                                               \
    FMI2_Export fmi2Status fmi2##name arguments { return ((component *)c)->call.name(((component *)c)->instance, REST values); }
HANDED_ON(HAND_ON)

/* ---- states -------------------------------------------------------------------------------------- */

static saved_state *room_for(fmi2FMUstate *state) {
    if (!*state) *state = calloc(1, sizeof(saved_state));
    return *state;
}

FMI2_Export fmi2Status fmi2GetFMUstate(fmi2Component p, fmi2FMUstate *state) {
    component *c = p;
    saved_state *saved = c->call.GetFMUstate ? room_for(state) : NULL;
    if (!saved) return fmi2Error;
    saved->now = c->now;
    return c->call.GetFMUstate(c->instance, &saved->own);
}

/* The solver begins anew there, as after an event. */
FMI2_Export fmi2Status fmi2SetFMUstate(fmi2Component p, fmi2FMUstate state) {
    component *c = p;
    const saved_state *saved = state;
    fmi2Status status = c->call.SetFMUstate(c->instance, saved->own);
    c->now = saved->now;
    for (int i = 0; i < 3; i++) c->set[i].count = 0;
    return status > fmi2Warning || c->now.mode != CONTINUOUS ? status : worse(status, begin_solver(c));
}

FMI2_Export fmi2Status fmi2FreeFMUstate(fmi2Component p, fmi2FMUstate *state) {
    component *c = p;
    saved_state *saved = *state;
    if (!saved) return fmi2OK;
    fmi2Status status = c->call.FreeFMUstate(c->instance, &saved->own);
    free(saved);
    *state = NULL;
    return status;
}

FMI2_Export fmi2Status fmi2SerializedFMUstateSize(fmi2Component p, fmi2FMUstate state, size_t *size) {
    component *c = p;
    fmi2Status status = c->call.SerializedFMUstateSize(c->instance, ((saved_state *)state)->own, size);
    *size += sizeof(progress);
    return status;
}

FMI2_Export fmi2Status fmi2SerializeFMUstate(fmi2Component p, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    component *c = p;
    saved_state *saved = state;
    if (size < sizeof(progress)) return fmi2Error;
    memcpy(bytes, &saved->now, sizeof(progress));
    return c->call.SerializeFMUstate(c->instance, saved->own, bytes + sizeof(progress), size - sizeof(progress));
}

FMI2_Export fmi2Status fmi2DeSerializeFMUstate(fmi2Component p, const fmi2Byte bytes[], size_t size,
                                               fmi2FMUstate *state) {
    component *c = p;
    saved_state *saved = size < sizeof(progress) || !c->call.DeSerializeFMUstate ? NULL : room_for(state);
    if (!saved) return fmi2Error;
    memcpy(&saved->now, bytes, sizeof(progress));
    return c->call.DeSerializeFMUstate(c->instance, bytes + sizeof(progress), size - sizeof(progress), &saved->own);
}

/* ---- steps --------------------------------------------------------------------------------------- */

/* Of a step, by which two times may differ and be the same; CVode cannot integrate that little. */
static const double SAME = 1e-9;

/* Integrate to a time, or to an event before it, at which *event becomes true. */
static fmi2Status integrate(component *c, double end, double size, int *event) {
    fmi2Boolean step_event = fmi2False, ends = fmi2False;
    fmi2Status status;
    double before = c->now.time;
    if (end - before <= SAME * size) {
        c->now.time = end;
        return c->call.SetTime(c->instance, end);
    }
    c->sun.CVodeSetStopTime(c->solver, end);
    int flag = c->sun.CVode(c->solver, end, c->x, &c->now.time, ONE_STEP);
    if (flag < 0) {
        tell(c, fmi2Error, "CVode gives up at %.10g s (code %d)", before, flag);
        return fmi2Error;
    }
    if (flag == TSTOP_RETURN) c->now.time = end;
    status = place(c, c->now.time, c->x);
    if (status > fmi2Warning) return status;
    if (c->tells_steps) {
        status = worse(status, c->call.CompletedIntegratorStep(c->instance, fmi2True, &step_event, &ends));
        if (status > fmi2Warning) return status;
    }
    c->now.terminated = ends;
    *event = flag == ROOT_RETURN || step_event;
    return status;
}

FMI2_Export fmi2Status fmi2DoStep(fmi2Component p, fmi2Real start, fmi2Real size, fmi2Boolean no_state_set_before) {
    component *c = p;
    double end = start + size;
    int events = 0;
    fmi2Status worst = settle(c);
    (void)no_state_set_before;
    while (worst <= fmi2Warning && c->now.time < end && !c->now.terminated) {
        double before = c->now.time;
        int is_time_event = c->now.has_time_event && c->now.time_event <= end + SAME * size, event = 0;
        double until = is_time_event && c->now.time_event < end ? c->now.time_event : end;
        if (until > c->now.time) worst = worse(worst, integrate(c, until, size, &event));
        if (worst > fmi2Warning || c->now.terminated) break;
        if (event || (is_time_event && c->now.time >= until)) {
            worst = worse(worst, enter_events(c));
            if (worst <= fmi2Warning) worst = worse(worst, leave_events(c));
        }
        events = c->now.time > before ? 0 : events + 1;
        if (events > MOST_EVENTS) {
            tell(c, fmi2Error, "its events do not end at %.10g s", c->now.time);
            return fmi2Error;
        }
    }
    if (worst > fmi2Warning || !c->now.terminated) return worst;
    tell(c, fmi2Discard, "its simulation ends at %.10g s", c->now.time);
    return fmi2Discard;
}

FMI2_Export fmi2Status fmi2GetRealStatus(fmi2Component p, const fmi2StatusKind kind, fmi2Real *value) {
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = ((component *)p)->now.time;
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetBooleanStatus(fmi2Component p, const fmi2StatusKind kind, fmi2Boolean *value) {
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = ((component *)p)->now.terminated;
    return fmi2OK;
}

/* ---- what it does not do ------------------------------------------------------------------------- */

#define ABSENT(name, arguments)                                                                                        \
    FMI2_Export fmi2Status fmi2##name arguments { return fmi2Error; }
ABSENT(CancelStep, (fmi2Component c))
ABSENT(SetRealInputDerivatives,
       (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[], const fmi2Real v[]))
ABSENT(GetRealOutputDerivatives,
       (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[], fmi2Real v[]))
ABSENT(GetStatus, (fmi2Component c, const fmi2StatusKind k, fmi2Status *v))
ABSENT(GetIntegerStatus, (fmi2Component c, const fmi2StatusKind k, fmi2Integer *v))
ABSENT(GetStringStatus, (fmi2Component c, const fmi2StatusKind k, fmi2String *v))

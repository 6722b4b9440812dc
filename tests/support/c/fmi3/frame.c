/* A foreign FMU of FMI 3.0 around a small model (`-DMODEL="lag.h"`), with co-simulation and model exchange. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

enum { FLOAT32, FLOAT64, INT8, UINT8, INT16, UINT16, INT32, UINT32, INT64, UINT64, BOOLEAN, STRING, BINARY, TEXT = 64 };

typedef struct {
    size_t size;
    unsigned char bytes[TEXT];
} Blob;

typedef struct {
    fmi3ValueReference reference;
    int type;
    size_t count, offset;
    int settable;
} Slot;

/* The model defines a struct Model with `time`, SLOTS, COUNT_OF_STATES, STATES_AT, RATES_AT, TOKEN, and: */
struct Model;
static void start(struct Model *m);                 /* start values */
static void evaluate(struct Model *m);              /* outputs and rates */
static void advance(struct Model *m, double h);     /* states, exactly, without events */
static double next_event(const struct Model *m);    /* its time; INFINITY if there is none */
static void handle_event(struct Model *m);
static void tangent(struct Model *m);               /* states, inputs and offsets are set to 0 */

#include MODEL

/* A model with clocks defines CLOCKS, and: */
#ifdef CLOCKS
static void tick(struct Model *m, fmi3ValueReference clock);
static int tell_interval(struct Model *m, fmi3ValueReference clock, double *seconds); /* whether it is another */
static double shift_of(fmi3ValueReference clock);
#endif

enum { SLOT_COUNT = sizeof SLOTS / sizeof *SLOTS };
enum { INSTANTIATED, INITIALIZATION, EVENT, STEP, CONTINUOUS, ENDED };

typedef struct {
    Model model;
    int mode, exchange, event_mode, early_return;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3ClockUpdateCallback update; /* of scheduled execution */
} Instance;

static fmi3Status complain(Instance *i, const char *message) {
    if (i->log) i->log(i->environment, fmi3Error, "logStatusError", message);
    return fmi3Error;
}

static const Slot *find(fmi3ValueReference reference, int type) {
    for (size_t k = 0; k < SLOT_COUNT; k++)
        if (SLOTS[k].reference == reference && SLOTS[k].type == type) return &SLOTS[k];
    return NULL;
}

/* Move the values of whole variables; the number of values must be that of all their elements. */
static fmi3Status move(Instance *i, int type, const fmi3ValueReference r[], size_t n, char *values, size_t count,
                       size_t width, int writes) {
    size_t done = 0;
#ifdef STRICT
    if (!writes && i->mode == INSTANTIATED) return complain(i, "nothing can be read yet");
#endif
#ifdef CLOCKS
    if (writes && i->mode == STEP && !i->update) return complain(i, "inputs jump in event mode");
#endif
    if (!writes && i->mode != INSTANTIATED) evaluate(&i->model);
    for (size_t k = 0; k < n; k++) {
        const Slot *slot = find(r[k], type);
        if (!slot) return complain(i, "a variable of this type and reference does not exist");
        if (done + slot->count > count) return complain(i, "too few values");
        char *own = (char *)&i->model + slot->offset;
        if (writes && !slot->settable) return complain(i, "a variable cannot be set");
        if (writes)
            memcpy(own, values + done * width, slot->count * width);
        else
            memcpy(values + done * width, own, slot->count * width);
        done += slot->count;
    }
    return done == count ? fmi3OK : complain(i, "too many values");
}

#define ACCESS(name, type)                                                                                             \
    fmi3Status fmi3Get##name(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3##name v[], size_t count) {   \
        return move(i, type, r, n, (char *)v, count, sizeof *v, 0);                                                    \
    }                                                                                                                  \
    fmi3Status fmi3Set##name(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3##name v[],             \
                             size_t count) {                                                                           \
        return move(i, type, r, n, (char *)v, count, sizeof *v, 1);                                                    \
    }
ACCESS(Float32, FLOAT32)
ACCESS(Float64, FLOAT64)
ACCESS(Int8, INT8)
ACCESS(UInt8, UINT8)
ACCESS(Int16, INT16)
ACCESS(UInt16, UINT16)
ACCESS(Int32, INT32)
ACCESS(UInt32, UINT32)
ACCESS(Int64, INT64)
ACCESS(UInt64, UINT64)
ACCESS(Boolean, BOOLEAN)

fmi3Status fmi3GetString(fmi3Instance p, const fmi3ValueReference r[], size_t n, fmi3String v[], size_t count) {
    Instance *i = p;
    size_t done = 0;
    evaluate(&i->model);
    for (size_t k = 0; k < n; k++) {
        const Slot *slot = find(r[k], STRING);
        if (!slot || done + slot->count > count) return complain(i, "no such text");
        for (size_t e = 0; e < slot->count; e++) v[done++] = (char *)&i->model + slot->offset + e * TEXT;
    }
    return done == count ? fmi3OK : complain(i, "too many texts");
}

/* Old texts are overwritten before new ones are read, as by an FMU that frees them. */
fmi3Status fmi3SetString(fmi3Instance p, const fmi3ValueReference r[], size_t n, const fmi3String v[], size_t count) {
    Instance *i = p;
    size_t done = 0;
    for (size_t k = 0; k < n; k++) {
        const Slot *slot = find(r[k], STRING);
        if (!slot || !slot->settable || done + slot->count > count) return complain(i, "no such text");
        memset((char *)&i->model + slot->offset, 0, slot->count * TEXT);
        for (size_t e = 0; e < slot->count; e++)
            snprintf((char *)&i->model + slot->offset + e * TEXT, TEXT, "%s", v[done++]);
    }
    return done == count ? fmi3OK : complain(i, "too many texts");
}

fmi3Status fmi3GetBinary(fmi3Instance p, const fmi3ValueReference r[], size_t n, size_t sizes[], fmi3Binary v[],
                         size_t count) {
    Instance *i = p;
    size_t done = 0;
    evaluate(&i->model);
    for (size_t k = 0; k < n; k++) {
        const Slot *slot = find(r[k], BINARY);
        if (!slot || done + slot->count > count) return complain(i, "no such binary");
        const Blob *own = (const Blob *)((char *)&i->model + slot->offset);
        for (size_t e = 0; e < slot->count; e++, done++) {
            sizes[done] = own[e].size;
            v[done] = own[e].bytes;
        }
    }
    return done == count ? fmi3OK : complain(i, "too many binaries");
}

fmi3Status fmi3SetBinary(fmi3Instance p, const fmi3ValueReference r[], size_t n, const size_t sizes[],
                         const fmi3Binary v[], size_t count) {
    Instance *i = p;
    size_t done = 0;
    for (size_t k = 0; k < n; k++) {
        const Slot *slot = find(r[k], BINARY);
        if (!slot || !slot->settable || done + slot->count > count) return complain(i, "no such binary");
        Blob *own = (Blob *)((char *)&i->model + slot->offset);
        memset(own, 0, slot->count * sizeof *own);
        for (size_t e = 0; e < slot->count; e++, done++) {
            if (sizes[done] > TEXT) return complain(i, "a binary is too large");
            own[e].size = sizes[done];
            memcpy(own[e].bytes, v[done], sizes[done]);
        }
    }
    return done == count ? fmi3OK : complain(i, "too many binaries");
}

/* ---- life ---- */

const char *fmi3GetVersion(void) { return "3.0"; }

static fmi3Instance make(fmi3String token, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    Instance *i = calloc(1, sizeof *i);
    i->environment = environment;
    i->log = log;
    start(&i->model);
    if (!strcmp(token, TOKEN)) return i;
    complain(i, "the instantiation token is another");
    free(i);
    return NULL;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference r[], size_t n, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    (void)name, (void)visible, (void)logging, (void)r, (void)n, (void)update;
    Instance *i = make(token, environment, log);
    if (!i) return NULL;
    i->event_mode = event_mode;
    i->early_return = early_return;
#ifdef NEEDS_RESOURCES
    char path[4096];
    snprintf(path, sizeof path, "%shere.txt", resources ? resources : "nowhere/");
    FILE *file = fopen(path, "r");
    if (!file || fscanf(file, "%lf", &i->model.NEEDS_RESOURCES) != 1) {
        complain(i, "its resources are not there");
        free(i);
        return NULL;
    }
    fclose(file);
#else
    (void)resources;
#endif
    return i;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
    (void)name, (void)resources, (void)visible, (void)logging;
    Instance *i = make(token, environment, log);
    if (i) i->exchange = 1;
    return i;
}

void fmi3FreeInstance(fmi3Instance i) { free(i); }

static fmi3Status enter(Instance *i, int from, int to) {
    if (i->mode != from) return complain(i, "not in this mode");
    i->mode = to;
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance p, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 now, fmi3Boolean stop_defined, fmi3Float64 stop) {
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    Instance *i = p;
    i->model.time = now;
    return enter(i, INSTANTIATED, INITIALIZATION);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance p) {
    Instance *i = p;
    return enter(i, INITIALIZATION, i->exchange || i->event_mode ? EVENT : STEP);
}

fmi3Status fmi3EnterEventMode(fmi3Instance p) {
    Instance *i = p;
    if (!i->exchange && !i->event_mode) return complain(i, "event mode is not used");
    return enter(i, i->exchange ? CONTINUOUS : STEP, EVENT);
}

fmi3Status fmi3EnterStepMode(fmi3Instance p) { return enter(p, EVENT, STEP); }

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance p) { return enter(p, EVENT, CONTINUOUS); }

fmi3Status fmi3Terminate(fmi3Instance p) {
    ((Instance *)p)->mode = ENDED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance p) {
    Instance *i = p;
    memset(&i->model, 0, sizeof i->model);
    start(&i->model);
    i->mode = INSTANTIATED;
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance p, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *next) {
    Instance *i = p;
    if (i->mode != EVENT) return complain(i, "not in event mode");
    int due = next_event(&i->model) <= i->model.time;
    if (due) handle_event(&i->model);
    *again = *terminate = *nominals = 0;
#ifdef ENDS
    *terminate = due && ENDS(&i->model);
#endif
    *values = due && COUNT_OF_STATES > 0;
    *next = next_event(&i->model);
    *defined = *next < INFINITY;
    return fmi3OK;
}

/* ---- co-simulation ---- */

fmi3Status fmi3DoStep(fmi3Instance p, fmi3Float64 now, fmi3Float64 size, fmi3Boolean no_state, fmi3Boolean *events,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    (void)no_state;
    Instance *i = p;
    Model *m = &i->model;
    if (i->mode != STEP) return complain(i, "not in step mode");
    if (fabs(now - m->time) > 1e-9) return complain(i, "a step from another time");
    *events = *terminate = *early = 0;
    double end = now + size;
    for (double next; (next = next_event(m)) <= end;) {
        advance(m, next - m->time);
        m->time = *last = next;
        *events = i->event_mode;
        if (*events && i->early_return && next < end) {
            *early = 1;
            return fmi3OK;
        }
        handle_event(m);
#ifdef RUDE
        if (RUDE(m, events, terminate, early, last)) return fmi3OK;
#endif
    }
    advance(m, end - m->time);
    m->time = *last = end;
    return fmi3OK;
}

/* ---- model exchange ---- */

#define STATES(m) ((double *)((char *)(m) + STATES_AT))
#define RATES(m) ((double *)((char *)(m) + RATES_AT))

fmi3Status fmi3SetTime(fmi3Instance p, fmi3Float64 time) {
    ((Instance *)p)->model.time = time;
    return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance p, const fmi3Float64 states[], size_t n) {
    Instance *i = p;
    if (n != COUNT_OF_STATES || i->mode != CONTINUOUS) return complain(i, "states cannot be set");
    memcpy(STATES(&i->model), states, n * sizeof *states);
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStates(fmi3Instance p, fmi3Float64 states[], size_t n) {
    if (n != COUNT_OF_STATES) return complain(p, "another number of states");
    memcpy(states, STATES(&((Instance *)p)->model), n * sizeof *states);
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance p, fmi3Float64 rates[], size_t n) {
    Instance *i = p;
    if (n != COUNT_OF_STATES) return complain(i, "another number of states");
    evaluate(&i->model);
    memcpy(rates, RATES(&i->model), n * sizeof *rates);
    return fmi3OK;
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance p, fmi3Float64 nominals[], size_t n) {
    (void)p;
#ifdef NOMINALS
    static const double own[] = NOMINALS;
    for (size_t k = 0; k < n; k++) nominals[k] = own[k];
#else
    for (size_t k = 0; k < n; k++) nominals[k] = 1.0;
#endif
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance p, size_t *n) {
    (void)p;
    *n = COUNT_OF_STATES;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance p, size_t *n) {
    (void)p;
    *n = 0;
    return fmi3OK;
}

fmi3Status fmi3GetEventIndicators(fmi3Instance p, fmi3Float64 indicators[], size_t n) {
    (void)indicators;
    return n ? complain(p, "there are no event indicators") : fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance p, fmi3Boolean no_state, fmi3Boolean *events,
                                       fmi3Boolean *terminate) {
    (void)p, (void)no_state;
    *events = *terminate = 0;
    return fmi3OK;
}

/* ---- states and derivatives ---- */

fmi3Status fmi3GetFMUState(fmi3Instance p, fmi3FMUState *state) {
    if (!*state) *state = malloc(sizeof(Instance));
    memcpy(*state, p, sizeof(Instance));
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance p, fmi3FMUState state) {
    Instance *i = p, *saved = state;
    i->model = saved->model;
    i->mode = saved->mode;
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance p, fmi3FMUState *state) {
    (void)p;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance p, fmi3FMUState state, size_t *size) {
    (void)p, (void)state;
    *size = sizeof(Instance);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance p, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    if (size != sizeof(Instance)) return complain(p, "another size");
    memcpy(bytes, state, size);
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance p, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    if (size != sizeof(Instance)) return complain(p, "another size");
    if (!*state) *state = malloc(size);
    memcpy(*state, bytes, size);
    return fmi3OK;
}

/* Of linear models: the model at the seeds, without anything else. */
fmi3Status fmi3GetDirectionalDerivative(fmi3Instance p, const fmi3ValueReference unknowns[], size_t unknown_count,
                                        const fmi3ValueReference knowns[], size_t known_count,
                                        const fmi3Float64 seeds[], size_t seed_count, fmi3Float64 values[],
                                        size_t value_count) {
    Instance there = *(Instance *)p;
    tangent(&there.model);
    there.mode = STEP;
    size_t done = 0;
    for (size_t k = 0; k < known_count; k++) {
        const Slot *slot = find(knowns[k], FLOAT64);
        if (!slot || done + slot->count > seed_count) return complain(p, "no such known");
        memcpy((char *)&there.model + slot->offset, seeds + done, slot->count * sizeof *seeds);
        done += slot->count;
    }
    return move(&there, FLOAT64, unknowns, unknown_count, (char *)values, value_count, sizeof *values, 0);
}

/* ---- not used ---- */

#define UNUSED(name, ...)                                                                                              \
    fmi3Status fmi3##name(fmi3Instance i, __VA_ARGS__) { return complain(i, "fmi3" #name " is not there"); }
UNUSED(GetAdjointDerivative, const fmi3ValueReference a[], size_t b, const fmi3ValueReference c[], size_t d,
       const fmi3Float64 e[], size_t f, fmi3Float64 g[], size_t h)
UNUSED(GetNumberOfVariableDependencies, fmi3ValueReference a, size_t *b)
UNUSED(GetVariableDependencies, fmi3ValueReference a, size_t b[], fmi3ValueReference c[], size_t d[],
       fmi3DependencyKind e[], size_t f)
UNUSED(GetIntervalFraction, const fmi3ValueReference a[], size_t b, fmi3UInt64 c[], fmi3UInt64 d[],
       fmi3IntervalQualifier e[])
UNUSED(GetShiftFraction, const fmi3ValueReference a[], size_t b, fmi3UInt64 c[], fmi3UInt64 d[])
UNUSED(SetIntervalDecimal, const fmi3ValueReference a[], size_t b, const fmi3Float64 c[])
UNUSED(SetIntervalFraction, const fmi3ValueReference a[], size_t b, const fmi3UInt64 c[], const fmi3UInt64 d[])
UNUSED(SetShiftDecimal, const fmi3ValueReference a[], size_t b, const fmi3Float64 c[])
UNUSED(SetShiftFraction, const fmi3ValueReference a[], size_t b, const fmi3UInt64 c[], const fmi3UInt64 d[])
UNUSED(GetOutputDerivatives, const fmi3ValueReference a[], size_t b, const fmi3Int32 c[], fmi3Float64 d[], size_t e)

fmi3Status fmi3SetDebugLogging(fmi3Instance i, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    (void)i, (void)on, (void)n, (void)categories;
    return fmi3OK;
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance i) { return complain(i, "sizes are fixed"); }

fmi3Status fmi3ExitConfigurationMode(fmi3Instance i) { return complain(i, "sizes are fixed"); }

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance i) {
    (void)i;
    return fmi3OK;
}

/* ---- clocks ---- */

#ifdef CLOCKS

fmi3Status fmi3GetClock(fmi3Instance p, const fmi3ValueReference r[], size_t n, fmi3Clock active[]) {
    Instance *i = p;
    if (i->mode != EVENT && !i->update) return complain(i, "a clock is asked for outside of event mode");
    for (size_t k = 0; k < n; k++) active[k] = take_activation(&i->model, r[k]);
    return fmi3OK;
}

fmi3Status fmi3SetClock(fmi3Instance p, const fmi3ValueReference r[], size_t n, const fmi3Clock ticks[]) {
    Instance *i = p;
    if (i->mode != EVENT) return complain(i, "a clock ticks outside of event mode");
    for (size_t k = 0; k < n; k++)
        if (ticks[k]) tick(&i->model, r[k]);
    return fmi3OK;
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance p, const fmi3ValueReference r[], size_t n, fmi3Float64 seconds[],
                                  fmi3IntervalQualifier known[]) {
    Instance *i = p;
    int allowed = i->mode == INITIALIZATION || i->mode == EVENT || (i->mode == STEP && i->update);
    if (!allowed) return complain(i, "an interval is asked for in another mode");
    for (size_t k = 0; k < n; k++)
        known[k] = tell_interval(&i->model, r[k], &seconds[k]) ? fmi3IntervalChanged : fmi3IntervalUnchanged;
    return fmi3OK;
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance p, const fmi3ValueReference r[], size_t n, fmi3Float64 shifts[]) {
    if (((Instance *)p)->mode != INITIALIZATION) return complain(p, "a shift is asked for in another mode");
    for (size_t k = 0; k < n; k++) shifts[k] = shift_of(r[k]);
    return fmi3OK;
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance p, fmi3ValueReference clock, fmi3Float64 time) {
    Instance *i = p;
    if (time < i->model.time) return complain(i, "a partition is activated in the past");
    i->model.time = time;
    tick(&i->model, clock);
    i->update(i->environment);
    return fmi3OK;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
    (void)name, (void)resources, (void)visible, (void)logging, (void)lock, (void)unlock;
    Instance *i = make(token, environment, log);
    if (i) i->update = update;
    return i;
}

#else

UNUSED(GetClock, const fmi3ValueReference a[], size_t b, fmi3Clock c[])
UNUSED(SetClock, const fmi3ValueReference a[], size_t b, const fmi3Clock c[])
UNUSED(GetIntervalDecimal, const fmi3ValueReference a[], size_t b, fmi3Float64 c[], fmi3IntervalQualifier d[])
UNUSED(GetShiftDecimal, const fmi3ValueReference a[], size_t b, fmi3Float64 c[])
UNUSED(ActivateModelPartition, fmi3ValueReference a, fmi3Float64 b)

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String a, fmi3String b, fmi3String c, fmi3Boolean d, fmi3Boolean e,
                                               fmi3InstanceEnvironment f, fmi3LogMessageCallback g,
                                               fmi3ClockUpdateCallback h, fmi3LockPreemptionCallback i,
                                               fmi3UnlockPreemptionCallback j) {
    (void)a, (void)b, (void)c, (void)d, (void)e, (void)f, (void)g, (void)h, (void)i, (void)j;
    return NULL;
}

#endif

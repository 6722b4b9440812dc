/* The functions of FMI 2.0, carried out by an FMU of FMI 3.0; see `wrapper.h`. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "wrapper.h"

/* ---- messages ------------------------------------------------------------------------------------ */

void tell(const component *c, fmi2Status status, const char *format, ...) {
    char message[1024];
    va_list arguments;
    if (!c->callbacks || !c->callbacks->logger) return;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    c->callbacks->logger(c->callbacks->componentEnvironment, c->name, status, "wrapper", "%s", message);
}

fmi2Status lacking(const component *c, const char *function) {
    tell(c, fmi2Error, "its library lacks the function %s", function);
    return fmi2Error;
}

/* Progress reports are dropped here: an FMU may send one at every call. */
static void pass_on(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message) {
    component *c = environment;
    if (status != fmi3OK && c->callbacks->logger)
        c->callbacks->logger(c->callbacks->componentEnvironment, c->name, (fmi2Status)status, category, "%s",
                             message ? message : "");
}

FMI2_Export const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

FMI2_Export const char *fmi2GetVersion(void) { return fmi2Version; }

FMI2_Export fmi2Status fmi2SetDebugLogging(fmi2Component p, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    component *c = p;
    return CALL(c, SetDebugLogging, on != 0, n, categories);
}

/* ---- life ---------------------------------------------------------------------------------------- */

static char *copied(const char *text) {
    char *copy = malloc(strlen(text) + 1);
    return copy ? strcpy(copy, text) : NULL;
}

/* Messages are asked for, since FMI 3.0 has no reasons of failures without them. Events inside of a step are the FMU's
 * own affair, as in FMI 2.0: inputs jump at communication points, and no event mode tells it so, unless it has clocks,
 * for which the standard demands that mode. */
static void instantiate(component *c, fmi2Type kind, fmi2String token, fmi2Boolean visible) {
    const char *resources = c->resources[0] ? c->resources : NULL;
    fmi3Boolean events = c->kind == WITH_EVENTS;
    if (c->kind == SCHEDULED && c->call.InstantiateScheduledExecution)
        c->instance = c->call.InstantiateScheduledExecution(c->name, token, resources, visible != 0, fmi3True, c, pass_on,
                                                            note_update, lock, lock);
    else if (c->kind == SCHEDULED)
        lacking(c, "fmi3InstantiateScheduledExecution");
    else if (kind == fmi2CoSimulation && c->call.InstantiateCoSimulation)
        c->instance = c->call.InstantiateCoSimulation(c->name, token, resources, visible != 0, fmi3True, events, events,
                                                      NULL, 0, c, pass_on, NULL);
    else if (kind == fmi2ModelExchange && c->call.InstantiateModelExchange)
        c->instance = c->call.InstantiateModelExchange(c->name, token, resources, visible != 0, fmi3True, c, pass_on);
    else
        lacking(c, kind == fmi2CoSimulation ? "fmi3InstantiateCoSimulation" : "fmi3InstantiateModelExchange");
}

FMI2_Export fmi2Component fmi2Instantiate(fmi2String name, fmi2Type kind, fmi2String token, fmi2String location,
                                          const fmi2CallbackFunctions *callbacks, fmi2Boolean visible,
                                          fmi2Boolean logging) {
    (void)location;
    (void)logging;
    component *c = calloc(1, sizeof *c);
    if (!c) return NULL;
    c->callbacks = callbacks;
    c->name = copied(name ? name : "");
    int loaded = c->name && load(c);
    if (kind == fmi2ModelExchange) c->kind = PLAIN; /* whose host has an event mode itself */
    if (loaded) instantiate(c, kind, token, visible);
    if (c->instance) return c;
    unload(c);
    return NULL;
}

FMI2_Export void fmi2FreeInstance(fmi2Component p) {
    component *c = p;
    if (!c) return;
    if (c->call.FreeInstance) c->call.FreeInstance(c->instance);
    unload(c);
}

FMI2_Export fmi2Status fmi2SetupExperiment(fmi2Component p, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                                           fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop) {
    component *c = p;
    c->tolerance_defined = tolerance_defined;
    c->tolerance = tolerance;
    c->start = start;
    c->stop_defined = stop_defined;
    c->stop = stop;
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2EnterInitializationMode(fmi2Component p) {
    component *c = p;
    c->reached = c->start;
    c->terminated = c->initialized = 0;
    fmi2Status status = CALL(c, EnterInitializationMode, c->tolerance_defined != 0, c->tolerance, c->start,
                             c->stop_defined != 0, c->stop);
    if (status > fmi2Warning) return status;
    return worse(status, write_late(c));
}

FMI2_Export fmi2Status fmi2ExitInitializationMode(fmi2Component p) {
    component *c = p;
    fmi2Status status = begin_clocks(c);
    if (status <= fmi2Warning) status = worse(status, CALL_PLAIN(c, ExitInitializationMode));
    if (status > fmi2Warning) return status;
    c->initialized = 1;
    c->in_events = c->kind == WITH_EVENTS;
    return worse(status, c->kind == SCHEDULED ? activate(c, c->start) : settle(c));
}

FMI2_Export fmi2Status fmi2Terminate(fmi2Component p) {
    component *c = p;
    return CALL_PLAIN(c, Terminate);
}

FMI2_Export fmi2Status fmi2Reset(fmi2Component p) {
    component *c = p;
    c->entered = c->initialized = c->in_events = 0;
    c->late_count = 0;
    return CALL_PLAIN(c, Reset);
}

/* ---- states -------------------------------------------------------------------------------------- */

/* A state is that of the FMU, and what the wrapper knows beside it: times, ticks and next ticks. */
typedef struct {
    fmi3FMUState fmu;
    double own[];
} saved;

static size_t own_count(const component *c) { return 6 + 4 * c->clock_count + c->counted_count; }

static double *carry(double *present, double *kept, int restores) {
    if (restores)
        *present = *kept;
    else
        *kept = *present;
    return kept + 1;
}

static double *carry_flag(int *present, double *kept, int restores) {
    double value = *present;
    kept = carry(&value, kept, restores);
    *present = value != 0.0;
    return kept;
}

static void carry_own(component *c, double *kept, int restores) {
    kept = carry_flag(&c->initialized, kept, restores);
    kept = carry_flag(&c->in_events, kept, restores);
    kept = carry_flag(&c->terminated, kept, restores);
    kept = carry(&c->start, kept, restores);
    kept = carry(&c->reached, kept, restores);
    kept = carry(&c->next_event, kept, restores);
    for (ticking *k = c->clocks; k < c->clocks + c->clock_count; k++) {
        kept = carry(&k->interval, kept, restores);
        kept = carry(&k->shift, kept, restores);
        kept = carry(&k->next, kept, restores);
        kept = carry(&k->ticks, kept, restores);
    }
    for (size_t i = 0; i < c->counted_count; i++) kept = carry(&c->counted[i]->ticks, kept, restores);
}

static saved *make_saved(const component *c) {
    saved *s = calloc(1, sizeof *s + own_count(c) * sizeof(double));
    if (!s) tell(c, fmi2Error, "there is no memory for a state");
    return s;
}

static fmi2Status wrong_size(const component *c, size_t size, size_t least) {
    tell(c, fmi2Error, "a state of %lu bytes; it has more than %lu", (unsigned long)size, (unsigned long)least);
    return fmi2Error;
}

/* Give a new state to the host, unless it could not be made. */
static fmi2Status hand_over(saved *made, fmi2FMUstate *state, fmi2Status status) {
    if (status <= fmi2Warning)
        *state = made;
    else if (made != *state)
        free(made);
    return status;
}

FMI2_Export fmi2Status fmi2GetFMUstate(fmi2Component p, fmi2FMUstate *state) {
    component *c = p;
    saved *s = *state ? *state : make_saved(c);
    if (!s) return fmi2Error;
    carry_own(c, s->own, 0);
    return hand_over(s, state, CALL(c, GetFMUState, &s->fmu));
}

FMI2_Export fmi2Status fmi2SetFMUstate(fmi2Component p, fmi2FMUstate state) {
    component *c = p;
    saved *s = state;
    carry_own(c, s->own, 1);
    c->entered = 1; /* nobody saves the state of what has not begun */
    c->late_count = 0;
    return CALL(c, SetFMUState, s->fmu);
}

FMI2_Export fmi2Status fmi2FreeFMUstate(fmi2Component p, fmi2FMUstate *state) {
    component *c = p;
    saved *s = *state;
    if (!s) return fmi2OK;
    fmi2Status status = CALL(c, FreeFMUState, &s->fmu);
    free(s);
    *state = NULL;
    return status;
}

FMI2_Export fmi2Status fmi2SerializedFMUstateSize(fmi2Component p, fmi2FMUstate state, size_t *size) {
    component *c = p;
    fmi2Status status = CALL(c, SerializedFMUStateSize, ((saved *)state)->fmu, size);
    *size += own_count(c) * sizeof(double);
    return status;
}

FMI2_Export fmi2Status fmi2SerializeFMUstate(fmi2Component p, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    component *c = p;
    const saved *s = state;
    size_t own = own_count(c) * sizeof(double);
    if (size < own) return wrong_size(c, size, own);
    memcpy(bytes, s->own, own);
    return CALL(c, SerializeFMUState, s->fmu, (fmi3Byte *)bytes + own, size - own);
}

FMI2_Export fmi2Status fmi2DeSerializeFMUstate(fmi2Component p, const fmi2Byte bytes[], size_t size,
                                               fmi2FMUstate *state) {
    component *c = p;
    size_t own = own_count(c) * sizeof(double);
    if (size < own) return wrong_size(c, size, own);
    saved *s = *state ? *state : make_saved(c);
    if (!s) return fmi2Error;
    fmi2Status status = CALL(c, DeserializeFMUState, (const fmi3Byte *)bytes + own, size - own, &s->fmu);
    if (status <= fmi2Warning) memcpy(s->own, bytes, own);
    return hand_over(s, state, status);
}

/* ---- co-simulation ------------------------------------------------------------------------------- */

/* One call of the FMU: it gets to c->reached, which may be short of the end. */
static fmi2Status advance(component *c, double size, double end, fmi2Boolean no_state_set_before, int *events) {
    fmi3Boolean event = fmi3False, terminate = fmi3False, early = fmi3False;
    double start = c->reached, last = start;
    fmi2Status status = CALL(c, DoStep, start, size, no_state_set_before != 0, &event, &terminate, &early, &last);
    *events |= event;
    c->terminated = terminate;
    c->reached = status > fmi2Warning || terminate || early ? last : end;
    return status;
}

/* One call, and Event Mode where it is used and the call ends at an event. */
static fmi2Status advance_to(component *c, double size, double end, fmi2Boolean no_state_set_before, int *events) {
    double before = c->reached;
    int is_used = c->kind == WITH_EVENTS, stops = is_used && c->next_event < end - SAME * size, event = 0;
    double until = stops ? c->next_event : end;
    fmi2Status status = fmi2OK;
    if (until > before) status = advance(c, stops ? until - before : size, until, no_state_set_before, &event);
    *events |= event && !is_used;
    if (!is_used || status > fmi2Warning || c->terminated) return status;
    if (!event && c->reached < c->next_event && !any_due(c)) return status;
    status = worse(status, enter_events(c));
    return status > fmi2Warning ? status : worse(status, settle(c));
}

/* An FMU of FMI 3.0 may complete the step with which it ends the simulation; one of FMI 2.0 discards it. */
static fmi2Status refuse_to_go_on(const component *c) {
    tell(c, fmi2Discard, "its simulation ends at %.10g s", c->reached);
    return fmi2Discard;
}

/* A step from which the FMU returns early goes on, to its end. */
FMI2_Export fmi2Status fmi2DoStep(fmi2Component p, fmi2Real start, fmi2Real size, fmi2Boolean no_state_set_before) {
    component *c = p;
    fmi2Status worst = settle(c);
    double end = start + size;
    int events = 0, stays = 0;
    if (worst > fmi2Warning) return worst;
    if (c->terminated) return refuse_to_go_on(c);
    if (c->kind == SCHEDULED) {
        worst = activate(c, end);
        c->reached = end;
        return worst;
    }
    c->reached = start;
    do {
        double before = c->reached;
        fmi2Status status = advance_to(c, before == start ? size : end - before, end, no_state_set_before, &events);
        if (status > fmi2Warning) return status;
        worst = worse(worst, status);
        if (c->terminated) {
            if (end - c->reached > 1e-6 * size) return refuse_to_go_on(c);
            break;
        }
        stays = c->reached > before ? 0 : stays + 1;
        if (c->kind == WITH_EVENTS && stays == MOST_EVENTS) return endless(c);
        if (c->reached < end && stays && c->kind == PLAIN) {
            tell(c, fmi2Error, "it returned early from a step at %.10g s, and got no further", before);
            return fmi2Error;
        }
    } while (c->reached < end);
    if (events) {
        tell(c, fmi2Warning, "it asked for event mode, which it was told is not used");
        worst = fmi2Warning;
    }
    return worst;
}

FMI2_Export fmi2Status fmi2CancelStep(fmi2Component c) {
    (void)c;
    return fmi2Error;
}

FMI2_Export fmi2Status fmi2SetRealInputDerivatives(fmi2Component p, const fmi2ValueReference r[], size_t n,
                                                   const fmi2Integer orders[], const fmi2Real values[]) {
    (void)r, (void)n, (void)orders, (void)values;
    tell(p, fmi2Error, "FMI 3.0 has no derivatives of inputs");
    return fmi2Error;
}

FMI2_Export fmi2Status fmi2GetRealOutputDerivatives(fmi2Component p, const fmi2ValueReference r[], size_t n,
                                                    const fmi2Integer orders[], fmi2Real values[]) {
    component *c = p;
    for (size_t i = 0; i < n; i++) {
        const variable *v = r[i] < c->element_count ? &c->variables[c->owners[r[i]]] : NULL;
        if (!v || v->count > 1) {
            tell(c, fmi2Error, "derivatives of outputs are read of scalars only");
            return fmi2Error;
        }
        fmi3Int32 order = orders[i];
        fmi2Status status = CALL(c, GetOutputDerivatives, &v->reference, 1, &order, &values[i], 1);
        if (status > fmi2Warning) return status;
    }
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

FMI2_Export fmi2Status fmi2GetRealStatus(fmi2Component p, const fmi2StatusKind kind, fmi2Real *value) {
    const component *c = p;
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = c->reached;
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

FMI2_Export fmi2Status fmi2GetBooleanStatus(fmi2Component p, const fmi2StatusKind kind, fmi2Boolean *value) {
    const component *c = p;
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = c->terminated;
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

/* ---- model exchange ------------------------------------------------------------------------------ */

FMI2_Export fmi2Status fmi2EnterEventMode(fmi2Component p) {
    component *c = p;
    return CALL_PLAIN(c, EnterEventMode);
}

FMI2_Export fmi2Status fmi2NewDiscreteStates(fmi2Component p, fmi2EventInfo *info) { return update(p, info); }

FMI2_Export fmi2Status fmi2EnterContinuousTimeMode(fmi2Component p) {
    component *c = p;
    return CALL_PLAIN(c, EnterContinuousTimeMode);
}

FMI2_Export fmi2Status fmi2CompletedIntegratorStep(fmi2Component p, fmi2Boolean no_state_set_before,
                                                   fmi2Boolean *enter_event_mode, fmi2Boolean *terminate) {
    component *c = p;
    fmi3Boolean events = fmi3False, ends = fmi3False;
    fmi2Status status = CALL(c, CompletedIntegratorStep, no_state_set_before != 0, &events, &ends);
    *enter_event_mode = events;
    *terminate = ends;
    return status;
}

FMI2_Export fmi2Status fmi2SetTime(fmi2Component p, fmi2Real time) {
    component *c = p;
    c->reached = time;
    return CALL(c, SetTime, time);
}

FMI2_Export fmi2Status fmi2SetContinuousStates(fmi2Component p, const fmi2Real states[], size_t n) {
    component *c = p;
    return CALL(c, SetContinuousStates, states, n);
}

FMI2_Export fmi2Status fmi2GetDerivatives(fmi2Component p, fmi2Real derivatives[], size_t n) {
    component *c = p;
    return CALL(c, GetContinuousStateDerivatives, derivatives, n);
}

FMI2_Export fmi2Status fmi2GetEventIndicators(fmi2Component p, fmi2Real indicators[], size_t n) {
    component *c = p;
    return CALL(c, GetEventIndicators, indicators, n);
}

FMI2_Export fmi2Status fmi2GetContinuousStates(fmi2Component p, fmi2Real states[], size_t n) {
    component *c = p;
    return CALL(c, GetContinuousStates, states, n);
}

FMI2_Export fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component p, fmi2Real nominals[], size_t n) {
    component *c = p;
    return CALL(c, GetNominalsOfContinuousStates, nominals, n);
}

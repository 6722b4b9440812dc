/* Event mode and clocks of an FMU of FMI 3.0.
 *
 * Clocks that tick by time are told of their ticks here, at once if at one instant, and in the order of the table, which
 * is that of their priorities. Nothing triggers an input clock, so one that waits to be triggered never ticks.
 */
#include <float.h>

#include "wrapper.h"

enum { MOST_EVENTS = 1000 };                    /* at one instant */
static const double NEVER = DBL_MAX, SAME = 1e-9; /* of an interval, by which two times may differ and be one instant */

static double earliest(const component *c) {
    double time = NEVER;
    for (size_t k = 0; k < c->clock_count; k++)
        if (c->clocks[k].next < time) time = c->clocks[k].next;
    return time;
}

static int is_due(const component *c, const ticking *k) { return k->next - c->reached <= SAME * k->interval; }

static int any_due(const component *c) {
    for (size_t k = 0; k < c->clock_count; k++)
        if (is_due(c, &c->clocks[k])) return 1;
    return 0;
}

/* Set the time of the tick after one that happens now; a clock that tells its intervals may change it. */
static void pass(component *c, ticking *k) {
    k->ticks++;
    if (k->kind <= CLOCK_FIXED)
        k->next = c->start + k->shift + k->ticks * k->interval;
    else
        k->next = k->kind == CLOCK_COUNTDOWN ? NEVER : c->reached + k->interval;
}

/* Ask the clocks that tell their intervals, each from now on. */
static fmi2Status ask(component *c) {
    fmi2Status worst = fmi2OK;
    for (size_t i = 0; i < c->clock_count && worst <= fmi2Warning; i++) {
        ticking *k = &c->clocks[i];
        fmi3IntervalQualifier known = fmi3IntervalNotYetKnown;
        double interval = 0.0;
        if (k->kind <= CLOCK_FIXED) continue;
        worst = worse(worst, CALL(c, GetIntervalDecimal, &k->reference, 1, &interval, &known));
        if (known != fmi3IntervalChanged) continue;
        k->interval = interval;
        k->next = c->reached + interval;
    }
    return worst;
}

/* Count the clocks that the FMU has activated. */
static fmi2Status count_ticks(component *c) {
    fmi2Status worst = fmi2OK;
    for (size_t i = 0; i < c->counted_count && worst <= fmi2Warning; i++) {
        fmi3Clock active = fmi3ClockInactive;
        worst = worse(worst, CALL(c, GetClock, &c->counted[i]->reference, 1, &active));
        if (active) c->counted[i]->ticks++;
    }
    return worst;
}

/* Begin all clocks, in Initialization Mode, in which those of a fixed interval have computed it. */
static fmi2Status begin_clocks(component *c) {
    fmi2Status status = fmi2OK;
    for (size_t i = 0; i < c->counted_count; i++) c->counted[i]->ticks = 0;
    for (size_t i = 0; i < c->clock_count && status <= fmi2Warning; i++) {
        ticking *k = &c->clocks[i];
        fmi3IntervalQualifier known = fmi3IntervalUnchanged;
        k->ticks = 0;
        k->next = NEVER;
        if (k->kind > CLOCK_FIXED) continue;
        if (k->kind == CLOCK_FIXED) {
            status = CALL(c, GetIntervalDecimal, &k->reference, 1, &k->interval, &known);
            if (status <= fmi2Warning) status = worse(status, CALL(c, GetShiftDecimal, &k->reference, 1, &k->shift));
        }
        if (status <= fmi2Warning && !(k->interval > 0.0)) {
            tell(c, fmi2Error, "the clock of value reference %u has no interval", k->reference);
            status = fmi2Error;
        }
        k->next = c->start + k->shift;
    }
    return status <= fmi2Warning ? worse(status, ask(c)) : status;
}

/* One iteration of Event Mode: clocks that are due tick, and discrete states are updated. */
static fmi2Status update(component *c, fmi2EventInfo *info) {
    static const fmi3Clock ticks = fmi3ClockActive;
    fmi3Boolean again = fmi3False, terminate = fmi3False, nominals = fmi3False, values = fmi3False, next = fmi3False;
    fmi2Status status = fmi2OK;
    double time = NEVER;
    for (size_t k = 0; k < c->clock_count && status <= fmi2Warning; k++) {
        if (!is_due(c, &c->clocks[k])) continue;
        status = worse(status, CALL(c, SetClock, &c->clocks[k].reference, 1, &ticks));
        pass(c, &c->clocks[k]);
    }
    if (status <= fmi2Warning) status = worse(status, ask(c));
    if (status <= fmi2Warning) status = worse(status, count_ticks(c));
    if (status <= fmi2Warning)
        status = worse(status, CALL(c, UpdateDiscreteStates, &again, &terminate, &nominals, &values, &next, &time));
    if (status <= fmi2Warning) status = worse(status, ask(c));
    double tick = earliest(c);
    if (!next || tick < time) time = tick;
    info->newDiscreteStatesNeeded = again || any_due(c);
    info->terminateSimulation = terminate;
    info->nominalsOfContinuousStatesChanged = nominals;
    info->valuesOfContinuousStatesChanged = values;
    info->nextEventTimeDefined = time < NEVER;
    info->nextEventTime = time;
    return status;
}

static fmi2Status endless(const component *c) {
    tell(c, fmi2Error, "its events do not end at %.10g s", c->reached);
    return fmi2Error;
}

/* ---- event mode of co-simulation ----------------------------------------------------------------- */

static fmi2Status leave_events(component *c) {
    fmi2EventInfo info = {.newDiscreteStatesNeeded = fmi2True};
    fmi2Status worst = fmi2OK;
    for (int k = 0; info.newDiscreteStatesNeeded && worst <= fmi2Warning; k++) {
        if (k == MOST_EVENTS) return endless(c);
        worst = worse(worst, update(c, &info));
    }
    c->terminated |= info.terminateSimulation;
    c->next_event = info.nextEventTimeDefined ? info.nextEventTime : NEVER;
    c->in_events = 0;
    return worst > fmi2Warning || c->terminated ? worst : worse(worst, CALL_PLAIN(c, EnterStepMode));
}

/* Values may be set in Event Mode, and be read again after it. */
fmi2Status enter_events(component *c) {
    if (c->kind != WITH_EVENTS || !c->initialized || c->in_events || c->terminated) return fmi2OK;
    c->in_events = 1;
    return CALL_PLAIN(c, EnterEventMode);
}

fmi2Status settle(component *c) { return c->in_events ? leave_events(c) : fmi2OK; }

/* ---- scheduled execution ------------------------------------------------------------------------- */

static void note_update(fmi3InstanceEnvironment environment) { ((component *)environment)->asks = 1; }

static void lock(void) {} /* one partition runs at a time */

/* Activate the partitions of all clocks that tick until a time, each at its own. */
static fmi2Status activate(component *c, double end) {
    fmi2Status worst = fmi2OK;
    int events = 0;
    while (worst <= fmi2Warning) {
        double time = earliest(c);
        ticking *k = c->clocks;
        while (k < c->clocks + c->clock_count && k->next - time > SAME * k->interval) k++;
        if (time == NEVER || time - end > SAME * k->interval) break;
        events = time > c->reached ? 0 : events + 1;
        if (events == MOST_EVENTS) return endless(c);
        c->reached = time;
        c->asks = 0;
        worst = worse(worst, CALL(c, ActivateModelPartition, k->reference, time));
        pass(c, k);
        if (c->asks && worst <= fmi2Warning) worst = worse(worst, count_ticks(c));
        if ((c->asks || k->kind == CLOCK_CHANGING) && worst <= fmi2Warning) worst = worse(worst, ask(c));
    }
    return worst;
}

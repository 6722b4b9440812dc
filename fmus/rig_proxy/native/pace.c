/* A step of the proxy: exchanges on the rig's time, or on the simulation's. */
#include "clock.h"
#include "proxy.h"

#include <math.h>
#include <stdio.h>

/* Held inputs are sent again this often within a long step: a quarter of the watchdog, so that three may be lost. */
static double interval(const Engine *engine) { return fmax(engine->link.session.watchdog / 4.0, 1e-3); }

static bool send_inputs(Engine *engine, double time, double step) {
    return link_exchange(&engine->link, time, step, engine->memory + FIRST_INPUT);
}

/* Exchanges until the step is `due` and an answer of that moment is there: true, or false if it is missing at the end,
   which is `deadline` after the due time, but never after `last`. */
static bool reach(Engine *engine, double time, double step, double due, double last) {
    Link *link = &engine->link;
    uint64_t wanted = 0;           /* sequence of the exchange at the due time */
    double next = 0.0, end = last; /* when to send again, when to give up */
    for (;;) {
        double now = clock_now();
        if (wanted == 0 && now >= due) {
            wanted = link->sequence + 1;
            next = now;
            end = fmin(now + deadline(engine), last);
        }
        if (now >= next) {
            send_inputs(engine, time, step);
            next = now + interval(engine);
        }
        if (link_listen(link, fmin(wanted > 0 ? end : due, next), wanted))
            return true;
        if (wanted > 0 && (clock_now() >= end || !link->in_session || !wire_is_open(&link->wire)))
            return false;
    }
}

/* When a step ends. What a master does before its first step takes no time of the rig; nor is more than a step of a delay
   made up for: what is measured would be as old as ever in a time that goes faster, and a loop over it diverges. That one
   step is what a proxy lags behind another one of the same master, which waits for the clock as well. */
static double due_time(Engine *engine, double time, double step, double entry) {
    double begin = time - engine->start_time;
    if (isnan(engine->origin))
        engine->origin = entry - begin;
    engine->origin = fmax(engine->origin, entry - begin - step);
    return engine->origin + begin + step;
}

static bool step_in_real_time(Engine *engine, double time, double step, Message message) {
    double entry = clock_now(), last = entry + communication_timeout(engine);
    double due = fmin(due_time(engine, time, step, entry), last);
    if (!reach(engine, time, step, due, last))
        engine->missed += 1.0;
    return publish(engine, message);
}

/* The rig's time would be lost with the answer, so that none is an error whatever on_stale says. */
static bool step_in_lockstep(Engine *engine, double time, double step, Message message) {
    double timeout = communication_timeout(engine);
    Link *link = &engine->link;
    if (send_inputs(engine, time, step) && link_listen(link, clock_now() + timeout, link->sequence))
        return publish(engine, message);
    if (!link->in_session)
        snprintf(message, MESSAGE_SIZE, "the rig at %s refuses: %s", link->endpoint, link->reason);
    else if (!wire_is_open(&link->wire))
        snprintf(message, MESSAGE_SIZE, "the rig has closed the connection: its time and ours are apart");
    else
        snprintf(message, MESSAGE_SIZE, "no answer within %.10g s: the rig's time and ours are apart", timeout);
    return false;
}

bool make_step(Engine *engine, double time, double step, Message message) {
    if (step > communication_timeout(engine)) {
        snprintf(message, MESSAGE_SIZE, "a step of %.10g s is longer than communication_timeout, %.10g s", step,
                 communication_timeout(engine));
        return false;
    }
    engine->link.refusing = false;
    if (link_listen(&engine->link, 0.0, 0)) /* what came since the last step says that the rig is latched */
        return publish(engine, message);
    link_mend(&engine->link, clock_now() + deadline(engine), message);
    return engine->link.session.lockstep ? step_in_lockstep(engine, time, step, message)
                                         : step_in_real_time(engine, time, step, message);
}

/* What a proxy tells: the measured values, how old they are, and how well the rig answers. */
#include "clock.h"
#include "proxy.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { CONNECTED, COMMANDS_REFUSED, STALE, LOST }; /* link_state */

/* Which measured value is the oldest. */
static int oldest(const Link *link) {
    int found = 0;
    for (int i = 1; i < MEASURED; i++)
        if (link->born[i] < link->born[found])
            found = i;
    return found;
}

/* The rig has ended the session, or has been silent for too long. */
static bool is_lost(const Engine *engine, double now) {
    return !engine->link.in_session || now - engine->link.answered > communication_timeout(engine);
}

static int link_state(const Engine *engine, double now) {
    const Link *link = &engine->link;
    return is_lost(engine, now)                                 ? LOST
           : now - link->born[oldest(link)] > max_age(engine) ? STALE
           : link->refusing                                     ? COMMANDS_REFUSED
                                                                : CONNECTED;
}

/* Whether the values may be used; if not, the message says why. */
static bool check_values(const Engine *engine, double now, Message message) {
    static const char *const latched[] = {
        [RIG_STOPPING] = "is on the way to its safe state",
        [RIG_SAFE] = "is in its safe state",
        [RIG_NOT_REACHED] = "HAS NOT REACHED ITS SAFE STATE AND MAY STILL BE ENERGISED",
    };
    const Link *link = &engine->link;
    int first = oldest(link);
    double age = now - link->born[first];
    bool fails = strcmp(engine->texts[engine->on_stale], "fail") == 0;
    if (link->state != RIG_RUNNING)
        snprintf(message, MESSAGE_SIZE, "the rig %s: %s", latched[link->state], link->reason);
    else if (fails && !link->in_session && link->reason[0] != '\0')
        snprintf(message, MESSAGE_SIZE, "the rig at %s refuses: %s", link->endpoint, link->reason);
    else if (fails && age > max_age(engine))
        snprintf(message, MESSAGE_SIZE, "%s is %.3g s old; max_age is %.10g s",
                 model_variables[link->measured[first]].name, age, max_age(engine));
    else if (fails && is_lost(engine, now))
        snprintf(message, MESSAGE_SIZE, "no answer from the rig for %.3g s", now - link->answered);
    else
        return true;
    return false;
}

void write_outputs(Engine *engine) {
    const Link *link = &engine->link;
    double *memory = engine->memory, now = clock_now();
    for (int i = 0; i < MEASURED; i++) {
        memory[link->measured[i]] = link->values[i];
        memory[engine->ages[i]] = now - link->born[i];
    }
    memory[engine->round_trip_time] = fmax(link->round_trip, now - link->asked);
    memory[engine->missed_deadlines] = engine->missed;
    memory[engine->link_state] = link_state(engine, now);
}

/* What is told when it begins, and not again while it lasts. */
static void warn(Engine *engine, int before, int state, Message message) {
    Link *link = &engine->link;
    if (state == LOST && before == LOST)
        message[0] = '\0';
    else if (!link->in_session)
        snprintf(message, MESSAGE_SIZE, "the rig at %s refuses: %s", link->endpoint, link->reason);
    else if (link->refusal[0] != '\0' && before != COMMANDS_REFUSED)
        snprintf(message, MESSAGE_SIZE, "refused by the rig: %s", link->refusal);
    link->refusal[0] = '\0';
}

bool publish(Engine *engine, Message message) {
    double now = clock_now();
    int before = (int)engine->memory[engine->link_state];
    write_outputs(engine);
    if (!check_values(engine, now, message))
        return false;
    warn(engine, before, link_state(engine, now), message);
    return true;
}

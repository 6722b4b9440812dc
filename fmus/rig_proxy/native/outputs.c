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

/* Whether the values may be used; if not, the message says why. */
static bool check_values(const Engine *engine, double now, Message message) {
    const Link *link = &engine->link;
    int first = oldest(link);
    double age = now - link->born[first];
    bool fails = strcmp(engine->texts[engine->on_stale], "fail") == 0;
    if (link->safe)
        snprintf(message, MESSAGE_SIZE, "the rig is in its safe state: %s", link->reason);
    else if (fails && !link->in_session && link->reason[0] != '\0')
        snprintf(message, MESSAGE_SIZE, "the rig at %s refuses: %s", link->endpoint, link->reason);
    else if (fails && age > max_age(engine))
        snprintf(message, MESSAGE_SIZE, "%s is %.3g s old; max_age is %.10g s",
                 model_variables[link->measured[first]].name, age, max_age(engine));
    else if (fails && engine->lost)
        snprintf(message, MESSAGE_SIZE, "no answer from the rig for %.3g s", now - link->answered);
    else
        return true;
    return false;
}

bool publish(Engine *engine, Message message) {
    Link *link = &engine->link;
    double *memory = engine->memory, now = clock_now();
    bool stale = now - link->born[oldest(link)] > max_age(engine);
    engine->lost = !link->in_session || now - link->answered > communication_timeout(engine);
    if (!check_values(engine, now, message))
        return false;
    if (engine->lost && memory[engine->link_state] == LOST)
        message[0] = '\0'; /* told when it began */
    if (link->refusal[0] != '\0' && memory[engine->link_state] != COMMANDS_REFUSED)
        snprintf(message, MESSAGE_SIZE, "refused by the rig: %s", link->refusal);
    link->refusal[0] = '\0';
    for (int i = 0; i < MEASURED; i++) {
        memory[link->measured[i]] = link->values[i];
        memory[engine->ages[i]] = now - link->born[i];
    }
    memory[engine->round_trip_time] = link->round_trip;
    memory[engine->missed_deadlines] = engine->missed;
    memory[engine->link_state] = engine->lost ? LOST : stale ? STALE : link->refusing ? COMMANDS_REFUSED : CONNECTED;
    return true;
}

/* Where the variables of a proxy are. They are found by name: the order is the generator's business. */
#include "proxy.h"

#include <stdio.h>
#include <string.h>

/* Index of a variable from `first` up to `end`, or -1. */
static int find_variable(const char *name, size_t size, const char *suffix, int first, int end) {
    for (int i = first; i < end; i++)
        if (strncmp(model_variables[i].name, name, size) == 0 && strcmp(model_variables[i].name + size, suffix) == 0)
            return i;
    return -1;
}

static bool found(int index, int *place, const char *name, Message message) {
    *place = index;
    if (index < 0)
        snprintf(message, MESSAGE_SIZE, "the proxy was built without '%s'", name);
    return index >= 0;
}

static bool find_text(const char *name, int *place, Message message) {
    int index = -1;
    for (int i = 0; i < MODEL_TEXTS; i++)
        if (strcmp(model_texts[i].name, name) == 0)
            index = i;
    return found(index, place, name, message);
}

static bool find_parameter(const char *name, int *place, Message message) {
    return found(find_variable(name, strlen(name), "", FIRST_PARAMETER, FIRST_INPUT), place, name, message);
}

static bool find_output(const char *name, int *place, Message message) {
    return found(find_variable(name, strlen(name), "", FIRST_OUTPUT, FIRST_DERIVATIVE), place, name, message);
}

/* The measured values are the outputs `y` that have a `y_age`. */
static bool find_measured(Engine *engine, Message message) {
    int count = 0;
    for (int i = FIRST_OUTPUT; i < FIRST_DERIVATIVE && count < MEASURED; i++) {
        const char *name = model_variables[i].name;
        int age = find_variable(name, strlen(name), "_age", FIRST_OUTPUT, FIRST_DERIVATIVE);
        if (age < 0)
            continue;
        engine->link.measured[count] = i;
        engine->ages[count++] = age;
    }
    if (count < MEASURED)
        snprintf(message, MESSAGE_SIZE, "the proxy was built with %d ages of values instead of %d", count, MEASURED);
    return count == MEASURED;
}

bool find_variables(Engine *engine, Message message) {
    return find_text("endpoint", &engine->endpoint, message) &&
           find_text("credentials", &engine->credentials, message) &&
           find_text("on_stale", &engine->on_stale, message) &&
           find_parameter("communication_timeout", &engine->communication_timeout, message) &&
           find_parameter("max_age", &engine->max_age, message) &&
           find_parameter("deadline", &engine->deadline, message) &&
           find_output("round_trip_time", &engine->round_trip_time, message) &&
           find_output("missed_deadlines", &engine->missed_deadlines, message) &&
           find_output("link_state", &engine->link_state, message) && find_measured(engine, message);
}

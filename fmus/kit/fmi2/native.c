/* The native engine: calls the generated laws; sampled updates at their exact instants, integration between them. */
#include "native.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define UPDATE_ADDRESS(name) name,
static Law *const updates[] = {LAWS_UPDATES(UPDATE_ADDRESS) NULL};
#undef UPDATE_ADDRESS

static const bool engine_interpolates = true;
static const bool engine_exchanges = true;
static const bool engine_differentiates = true;

Engine *engine_create(double *memory, const TextValue *texts, const char *resources, Message message) {
    Engine *engine = calloc(1, sizeof *engine);
    (void)texts;
    (void)resources;
    if (engine == NULL)
        snprintf(message, MESSAGE_SIZE, "out of memory");
    else
        engine->memory = memory;
    return engine;
}

void engine_free(Engine *engine) { free(engine); }

void engine_terminate(Engine *engine) { (void)engine; }

bool engine_initialize(Engine *engine, Message message) {
    (void)engine;
    (void)message;
    return true;
}

static bool law_failed(Message message, const char *law) {
    snprintf(message, MESSAGE_SIZE, "the law '%s' could not be evaluated", law);
    return false;
}

bool engine_evaluate(Engine *engine, double time, Message message) {
    engine->sloped = false;
    bind(engine, time, engine->memory + FIRST_STATE);
    engine->res[0] = engine->memory + FIRST_OUTPUT;
    return MODEL_OUTPUTS == 0 || call(engine, outputs) || law_failed(message, "outputs");
}

bool engine_differentiate(Engine *engine, double time, Message message) {
    engine->sloped = false;
    bind(engine, time, engine->memory + FIRST_STATE);
    engine->res[0] = engine->memory + FIRST_DERIVATIVE;
    return MODEL_STATES == 0 || call(engine, rates) || law_failed(message, "rates");
}

bool engine_tangent(Engine *engine, double time, const double *seed, double *result, Message message) {
    engine->sloped = false;
    bind(engine, time, engine->memory + FIRST_STATE);
    engine->arg[5] = seed + FIRST_PARAMETER;
    engine->arg[6] = seed + FIRST_INPUT;
    engine->arg[7] = seed + FIRST_STATE;
    engine->arg[8] = seed + FIRST_DISCRETE;
    engine->res[0] = result;
    engine->res[1] = result + MODEL_STATES;
    return call(engine, tangent) || law_failed(message, "tangent");
}

/* All discretes of the group change at once, from the values before the update. */
static bool update(Engine *engine, int group, double time) {
    bind(engine, time, engine->memory + FIRST_STATE);
    engine->res[0] = engine->updated;
    if (!call(engine, updates[group]))
        return false;
    memcpy(engine->memory + FIRST_DISCRETE, engine->updated, MODEL_DISCRETES * sizeof(double));
    return true;
}

double period_of(const Engine *engine, int group) {
    int parameter = model_groups[group].period_parameter;
    return parameter < 0 ? model_groups[group].period : engine->memory[parameter];
}

bool sample(Engine *engine, double time, double end, double *target, Message message) {
    double *counters = engine->memory + MEMORY_COUNTERS, start = engine->memory[MEMORY_START_TIME];
    *target = end;
    for (int i = 0; i < MODEL_GROUPS; i++) {
        double period = period_of(engine, i), next = start + counters[i] * period;
        /* Times this close are the same instant: hosts round, and late in a simulation more than a share of the period. */
        double slack = 1e-9 * period + 1e-15 * fabs(end);
        if (next <= time + slack) {
            if (!update(engine, i, time))
                return law_failed(message, "update");
            counters[i] += 1.0;
            next = start + counters[i] * period;
        }
        if (next < end - slack)
            *target = fmin(*target, next);
    }
    *target = fmax(*target, time);
    return true;
}

bool engine_advance(Engine *engine, double time, double step, Message message) {
    double end = time + step, target;
    engine->origin = time;
    engine->budget = MAX_STEPS;
    engine->sloped = false;
    for (int i = 0; i < MODEL_INPUTS; i++)
        engine->sloped |= engine->memory[MEMORY_SLOPES + i] != 0.0;
    do {
        if (!sample(engine, time, end, &target, message) || !integrate(engine, time, target, message))
            return false;
        time = target;
    } while (time < end);
    return true;
}

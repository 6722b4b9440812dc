/* The native engine: calls the generated laws; sampled updates at their exact instants, integration between them. */
#include "native.h"
#include "samples.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool furnish(Engine *engine, const Model *model, double *memory) {
    size_t states = (size_t)model->states;
    size_t numbers = (size_t)model->inputs + 6 * states + (size_t)model->discretes + (size_t)model->sz_w;
    size_t pointers = (size_t)model->sz_arg + (size_t)model->sz_res;
    double *next = calloc(numbers + (size_t)model->sz_iw + pointers, sizeof(double));
    engine->model = model;
    engine->memory = memory;
    engine->most = MAX_STEPS;
    engine->arrays = next;
    if (next == NULL)
        return false;
    engine->inputs = next;
    engine->trial = next += model->inputs;
    for (int i = 0; i < 5; i++)
        engine->k[i] = next += states;
    engine->updated = next += states;
    engine->w = next += model->discretes;
    engine->iw = (long long *)(next + model->sz_w);
    engine->arg = (const double **)(engine->iw + model->sz_iw);
    engine->res = (double **)(engine->arg + model->sz_arg);
    return true;
}

bool law_failed(Message message, const char *law) {
    snprintf(message, MESSAGE_SIZE, "the law '%s' could not be evaluated", law);
    return false;
}

bool engine_evaluate(Engine *engine, double time, Message message) {
    const Model *model = model_of(engine);
    engine->sloped = false;
    bind(engine, time, engine->memory + model->first_state);
    engine->res[0] = engine->memory + model->first_output;
    return model->outputs == 0 || call(engine, model->outputs_law) || law_failed(message, "outputs");
}

/* All discretes of the group change at once, from the values before the update. */
static bool update(Engine *engine, int group, double time) {
    const Model *model = model_of(engine);
    bind(engine, time, engine->memory + model->first_state);
    engine->res[0] = engine->updated;
    if (!call(engine, model->update_laws[group]))
        return false;
    memcpy(engine->memory + model->first_discrete, engine->updated, (size_t)model->discretes * sizeof(double));
    return true;
}

/* Makes the updates that are due and finds where the integration has to stop next: the next sample or `end`. */
static bool sample(Engine *engine, double time, double end, double *target, Message message) {
    const Model *model = model_of(engine);
    double *memory = engine->memory, *counters = memory + model->counters, start = memory[model->start_time];
    *target = end;
    for (int i = 0; i < model->groups; i++) {
        const Group *group = &model->group[i];
        double next = sample_instant(group, memory, start, counters[i]);
        double slack = sample_slack(group, memory, end);
        if (next <= time + slack) {
            if (!update(engine, i, time))
                return law_failed(message, "update");
            counters[i] += 1.0;
            next = sample_instant(group, memory, start, counters[i]);
        }
        if (next < end - slack)
            *target = fmin(*target, next);
    }
    *target = fmax(*target, time);
    return true;
}

bool engine_advance(Engine *engine, double time, double step, Message message) {
    const Model *model = model_of(engine);
    double end = time + step, target;
    engine->origin = time;
    engine->budget = engine->most;
    engine->sloped = false;
    for (int i = 0; i < model->inputs; i++)
        engine->sloped |= engine->memory[model->slopes + i] != 0.0;
    do {
        if (!sample(engine, time, end, &target, message) || !integrate(engine, time, target, message))
            return false;
        time = target;
    } while (time < end);
    return true;
}

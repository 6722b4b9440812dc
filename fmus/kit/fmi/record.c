/* Runs a whole record in one call, for fitting: the same engine as in the FMU, without the FMI around it, and with an
   integrator of its own where a component is stiff. With any_model.c it is a library that serves all models; each of them
   is in a library of its own (shared_model.c). With shared_model.c it is a library of the one model that is in it. */
#include "exponential.c"
#include "export.h"
#include "native.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int remembered(const Model *model) { return model->states + model->discretes; }

static size_t bytes(int numbers) { return (size_t)numbers * sizeof(double); }

static void start(Engine *engine, double time, const double *parameters, double tolerance) {
    const Model *model = model_of(engine);
    double *memory = engine->memory;
    memcpy(memory + model->first_parameter, parameters, bytes(model->parameters));
    for (int i = 0; i < remembered(model); i++)
        memory[model->first_state + i] = memory[model->start_of[i]];
    memory[model->hint] = INFINITY;
    memory[model->start_time] = time;
    memory[model->tolerance] = tolerance;
}

/* Steps from sample k to sample k + 1. */
static bool step(Engine *engine, const double *time, const double *inputs, size_t k, const double *linear,
                 Message message) {
    const Model *model = model_of(engine);
    double h = time[k + 1] - time[k];
    if (!(h > 0.0) || !isfinite(h)) {
        snprintf(message, MESSAGE_SIZE, "times must increase, but %.10g s follows %.10g s", time[k + 1], time[k]);
        return false;
    }
    for (int i = 0; i < model->inputs; i++) {
        const double *u = inputs + k * (size_t)model->inputs + i;
        engine->memory[model->slopes + i] = linear[i] != 0.0 ? (u[model->inputs] - u[0]) / h : 0.0;
    }
    return engine_advance(engine, time[k], h, message);
}

static bool all_finite_at(const Engine *engine, double time, Message message) {
    const Model *model = model_of(engine);
    const double *memory = engine->memory;
    bool finite = true;
    int i = model->first_input;
    for (int k = i; k < model->first_derivative; k++)
        finite &= isfinite(memory[k]) != 0;
    if (finite)
        return true;
    while (isfinite(memory[i]))
        i++;
    snprintf(message, MESSAGE_SIZE, "'%s' is not a finite number at t = %.10g s", model->variable[i].name, time);
    return false;
}

static bool run(Engine *engine, size_t n, const double *time, const double *inputs, const double *linear,
                double effort, double *steps, double *outputs_at, double *states_at, Message message) {
    const Model *model = model_of(engine);
    double *memory = engine->memory;
    *steps = 0.0;
    for (size_t k = 0; k < n; k++) {
        memcpy(memory + model->first_input, inputs + k * (size_t)model->inputs, bytes(model->inputs));
        if (!engine_evaluate(engine, time[k], message) || !all_finite_at(engine, time[k], message))
            return false;
        memcpy(outputs_at + k * (size_t)model->outputs, memory + model->first_output, bytes(model->outputs));
        memcpy(states_at + k * (size_t)remembered(model), memory + model->first_state, bytes(remembered(model)));
        if (k + 1 == n)
            break;
        engine->most = (long)fmin(MAX_STEPS, effort * (double)n - *steps);
        if (!step(engine, time, inputs, k, linear, message)) {
            if (engine->budget < 0 && engine->most < MAX_STEPS)
                snprintf(message, MESSAGE_SIZE,
                         "more than %g internal steps per sample up to %.10g s: with these parameters a time constant "
                         "is that much shorter than the time between samples",
                         effort, time[k + 1]);
            return false;
        }
        *steps += (double)(engine->most - engine->budget);
    }
    return true;
}

/* Of the model there are n rows each: `inputs`, `outputs_at`, and `states_at` with states, then discretes. Row k of the
   latter two belongs to time[k] with the inputs of row k. An input is held over each interval where its entry of
   `linear` is 0, and interpolated where that is 1. `effort` is how many internal steps per sample are made, on average,
   before it is given up; how many were made is put into `steps`. `ladder` is NULL where the component is not stiff.
   Returns 0, or 1 with a message. */
EXPORT int ppy_simulate(const Model *model, size_t n, const double *time, const double *inputs, const double *linear,
                        const double *parameters, double tolerance, double effort, const Ladder *ladder,
                        double *steps, double *outputs_at, double *states_at, char *message, size_t message_size) {
    /* not on the stack, which a thread may have little of */
    double *memory = calloc((size_t)model->memory_size, sizeof *memory);
    Recorder recorder = {.rate = NULL};
    Message text = "out of memory";
    bool done = memory != NULL && furnish(&recorder.engine, model, memory) &&
                (ladder == NULL || equip(&recorder, ladder));
    if (done && n > 0) {
        start(&recorder.engine, time[0], parameters, tolerance);
        done = run(&recorder.engine, n, time, inputs, linear, effort, steps, outputs_at, states_at, text);
    }
    snprintf(message, message_size, "%s", text);
    free(recorder.rate);
    free(recorder.engine.arrays);
    free(memory);
    return done ? 0 : 1;
}

/* Runs cases that differ in parameters, row by row in `parameters`, and in inputs where these lie `apart` numbers from
   each other; that is 0 where all cases have the same. Of outputs, then states and discretes, the columns `kept` are
   written to `courses`, cases x n x columns. Where a case cannot be run `done` is 0, and what is written of it means
   nothing. Returns 0, or 1 without memory. */
EXPORT int ppy_cases(const Model *model, size_t cases, size_t n, const double *time, const double *inputs, size_t apart,
                     const double *parameters, double tolerance, double effort, const int *kept, size_t columns,
                     double *courses, unsigned char *done) {
    const size_t outputs = (size_t)model->outputs, states = (size_t)remembered(model);
    double *linear = calloc((size_t)model->inputs + 1, sizeof *linear);
    double *outputs_at = malloc((n * (outputs + states) + 1) * sizeof *outputs_at), *states_at = outputs_at + n * outputs;
    const bool possible = linear != NULL && outputs_at != NULL;
    double steps;
    Message unused;
    for (size_t k = 0; possible && k < cases; k++) {
        done[k] = !ppy_simulate(model, n, time, inputs + k * apart, linear, parameters + k * (size_t)model->parameters,
                                tolerance, effort, NULL, &steps, outputs_at, states_at, unused, sizeof unused);
        for (size_t i = 0; i < n; i++)
            for (size_t j = 0; j < columns; j++)
                *courses++ = kept[j] < model->outputs ? outputs_at[i * outputs + (size_t)kept[j]]
                                                      : states_at[i * states + (size_t)kept[j] - outputs];
    }
    free(linear);
    free(outputs_at);
    return possible ? 0 : 1;
}

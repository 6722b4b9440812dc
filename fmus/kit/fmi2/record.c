/* Runs a whole record in one call, for fitting: the same engine as in the FMU, without the FMI around it, and with an
   integrator of its own where a component is stiff. */
#include "exponential.c"
#include "instance.h"
#include "native.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { REMEMBERED = MODEL_STATES + MODEL_DISCRETES };

static void start(double *memory, double time, const double *parameters, double tolerance) {
    memcpy(memory + FIRST_PARAMETER, parameters, MODEL_PARAMETERS * sizeof(double));
    for (int i = 0; i < REMEMBERED; i++)
        memory[FIRST_STATE + i] = memory[model_start_of[i]];
    memory[MEMORY_HINT] = INFINITY;
    memory[MEMORY_START_TIME] = time;
    memory[MEMORY_TOLERANCE] = tolerance;
}

/* Steps from sample k to sample k + 1. */
static bool step(Engine *engine, const double *time, const double *inputs, size_t k, const double *linear,
                 Message message) {
    double h = time[k + 1] - time[k];
    if (!(h > 0.0) || !isfinite(h)) {
        snprintf(message, MESSAGE_SIZE, "times must increase, but %.10g s follows %.10g s", time[k + 1], time[k]);
        return false;
    }
    for (int i = 0; i < MODEL_INPUTS; i++) {
        const double *u = inputs + k * MODEL_INPUTS + i;
        engine->memory[MEMORY_SLOPES + i] = linear[i] != 0.0 ? (u[MODEL_INPUTS] - u[0]) / h : 0.0;
    }
    return engine_advance(engine, time[k], h, message);
}

static bool all_finite_at(const double *memory, double time, Message message) {
    for (int i = FIRST_INPUT; i < FIRST_DERIVATIVE; i++)
        if (!isfinite(memory[i])) {
            snprintf(message, MESSAGE_SIZE, "'%s' is not a finite number at t = %.10g s", model_variables[i].name, time);
            return false;
        }
    return true;
}

static bool run(Engine *engine, size_t n, const double *time, const double *inputs, const double *linear,
                double effort, double *outputs_at, double *states_at, Message message) {
    double *memory = engine->memory, budget = effort * (double)n;
    for (size_t k = 0; k < n; k++) {
        memcpy(memory + FIRST_INPUT, inputs + k * MODEL_INPUTS, MODEL_INPUTS * sizeof(double));
        if (!engine_evaluate(engine, time[k], message) || !all_finite_at(memory, time[k], message))
            return false;
        memcpy(outputs_at + k * MODEL_OUTPUTS, memory + FIRST_OUTPUT, MODEL_OUTPUTS * sizeof(double));
        memcpy(states_at + k * REMEMBERED, memory + FIRST_STATE, REMEMBERED * sizeof(double));
        if (k + 1 == n)
            break;
        if (!step(engine, time, inputs, k, linear, message))
            return false;
        budget -= (double)(MAX_STEPS - engine->budget);
        if (budget < 0.0) {
            snprintf(message, MESSAGE_SIZE,
                     "more than %g internal steps per sample up to %.10g s: with these parameters a time constant is "
                     "that much shorter than the time between samples",
                     effort, time[k + 1]);
            return false;
        }
    }
    return true;
}

/* `inputs` is n x MODEL_INPUTS, `outputs_at` n x MODEL_OUTPUTS, `states_at` n x (states, then discretes), row by row. Row
   k of the latter two belongs to time[k] with the inputs of row k. An input is held over each interval where its entry
   of `linear` is 0, and interpolated where that is 1. `effort` is how many internal steps per sample are made, on
   average, before it is given up. `ladder` is NULL where the component is not stiff. Returns 0, or 1 with a message. */
EXPORT int ppy_simulate(size_t n, const double *time, const double *inputs, const double *linear,
                        const double *parameters, double tolerance, double effort, const Ladder *ladder,
                        double *outputs_at, double *states_at, char *message, size_t message_size) {
    /* not on the stack, which a thread may have little of */
    double *memory = calloc(MEMORY_SIZE, sizeof *memory);
    Recorder *recorder = calloc(1, sizeof *recorder);
    Message text = "out of memory";
    bool done = memory != NULL && recorder != NULL;
    if (done && n > 0) {
        start(memory, time[0], parameters, tolerance);
        recorder->engine.memory = memory;
        if (ladder != NULL)
            recorder->ladder = *ladder;
        done = run(&recorder->engine, n, time, inputs, linear, effort, outputs_at, states_at, text);
    }
    snprintf(message, message_size, "%s", text);
    free(recorder);
    free(memory);
    return done ? 0 : 1;
}

/* Runs cases that differ in parameters, row by row in `parameters`, and in inputs where these lie `apart` numbers from
   each other; that is 0 where all cases have the same. Of outputs, then states and discretes, the columns `kept` are
   written to `courses`, cases x n x columns. Where a case cannot be run `done` is 0, and what is written of it means
   nothing. Returns 0, or 1 without memory. */
EXPORT int ppy_cases(size_t cases, size_t n, const double *time, const double *inputs, size_t apart,
                     const double *parameters, double tolerance, double effort, const int *kept, size_t columns,
                     double *courses, unsigned char *done) {
    double linear[MODEL_INPUTS + 1] = {0.0};
    double *all = malloc((n * (MODEL_OUTPUTS + REMEMBERED) + 1) * sizeof *all), *states = all + n * MODEL_OUTPUTS;
    Message unused;
    if (all == NULL)
        return 1;
    for (size_t k = 0; k < cases; k++) {
        done[k] = !ppy_simulate(n, time, inputs + k * apart, linear, parameters + k * MODEL_PARAMETERS, tolerance,
                                effort, NULL, all, states, unused, sizeof unused);
        for (size_t i = 0; i < n; i++)
            for (size_t j = 0; j < columns; j++)
                *courses++ = kept[j] < MODEL_OUTPUTS ? all[i * MODEL_OUTPUTS + kept[j]]
                                                     : states[i * REMEMBERED + kept[j] - MODEL_OUTPUTS];
    }
    free(all);
    return 0;
}

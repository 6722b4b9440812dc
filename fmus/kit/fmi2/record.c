/* Runs a whole record in one call, for fitting: the same engine as in the FMU, without the FMI around it. */
#ifdef PPY_RECORD
#include "instance.h"
#include "native.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { REMEMBERED = MODEL_STATES + MODEL_DISCRETES };

EXPORT int ppy_simulate(size_t n, const double *time, const double *inputs, int linear, const double *parameters,
                        const double *initial_states, double tolerance, double *outputs_at, double *states_at,
                        char *message, size_t message_size);

static void start(double *memory, double time, const double *parameters, const double *initial_states,
                  double tolerance) {
    memset(memory, 0, MEMORY_SIZE * sizeof(double));
    memcpy(memory + FIRST_PARAMETER, parameters, MODEL_PARAMETERS * sizeof(double));
    for (int i = 0; i < MODEL_STATES + MODEL_DISCRETES; i++)
        memory[FIRST_STATE + i] = memory[model_start_of[i]];
    if (initial_states != NULL)
        memcpy(memory + FIRST_STATE, initial_states, MODEL_STATES * sizeof(double));
    memory[MEMORY_HINT] = INFINITY;
    memory[MEMORY_START_TIME] = time;
    memory[MEMORY_TOLERANCE] = tolerance;
}

/* Steps from sample k to sample k + 1. */
static bool step(Engine *engine, const double *time, const double *inputs, size_t k, int linear, Message message) {
    double h = time[k + 1] - time[k];
    if (!(h > 0.0) || !isfinite(h)) {
        snprintf(message, MESSAGE_SIZE, "times must increase, but %.10g s follows %.10g s", time[k + 1], time[k]);
        return false;
    }
    for (int i = 0; i < MODEL_INPUTS; i++) {
        const double *u = inputs + k * MODEL_INPUTS + i;
        engine->memory[MEMORY_SLOPES + i] = linear ? (u[MODEL_INPUTS] - u[0]) / h : 0.0;
    }
    return engine_advance(engine, time[k], h, message);
}

static bool all_finite(const double *values, int count) {
    for (int i = 0; i < count; i++)
        if (!isfinite(values[i]))
            return false;
    return true;
}

static bool run(Engine *engine, size_t n, const double *time, const double *inputs, int linear, double *outputs_at,
                double *states_at, Message message) {
    double *memory = engine->memory;
    for (size_t k = 0; k < n; k++) {
        memcpy(memory + FIRST_INPUT, inputs + k * MODEL_INPUTS, MODEL_INPUTS * sizeof(double));
        if (!engine_evaluate(engine, time[k], message))
            return false;
        if (!all_finite(memory + FIRST_INPUT, FIRST_DERIVATIVE - FIRST_INPUT)) {
            snprintf(message, MESSAGE_SIZE, "an input, state or output is not a finite number at t = %.10g s",
                     time[k]);
            return false;
        }
        memcpy(outputs_at + k * MODEL_OUTPUTS, memory + FIRST_OUTPUT, MODEL_OUTPUTS * sizeof(double));
        if (states_at != NULL)
            memcpy(states_at + k * REMEMBERED, memory + FIRST_STATE, REMEMBERED * sizeof(double));
        if (k + 1 < n && !step(engine, time, inputs, k, linear, message))
            return false;
    }
    return true;
}

/* `inputs` is n x MODEL_INPUTS, `outputs_at` n x MODEL_OUTPUTS, `states_at` n x (states, then discretes) or NULL, row by row. Row k
   of the latter two belongs to time[k] with the inputs of row k. Inputs are held over each interval, or interpolated
   when `linear` is set. Without `initial_states` the states start at their start parameters, as discretes always do.
   Returns 0, or 1 with a message. */
EXPORT int ppy_simulate(size_t n, const double *time, const double *inputs, int linear, const double *parameters,
                        const double *initial_states, double tolerance, double *outputs_at, double *states_at,
                        char *message, size_t message_size) {
    double memory[MEMORY_SIZE];
    Engine engine = {0};
    Message text = "";
    bool done = true;
    if (n > 0) {
        start(memory, time[0], parameters, initial_states, tolerance);
        engine.memory = memory;
        done = run(&engine, n, time, inputs, linear, outputs_at, states_at, text);
    }
    if (message != NULL && message_size > 0)
        snprintf(message, message_size, "%s", text);
    return done ? 0 : 1;
}
#else
typedef int record_is_not_compiled; /* C wants at least one declaration */
#endif

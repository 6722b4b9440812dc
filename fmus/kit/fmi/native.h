/* The native engine: the laws as generated C, and what its files share. */
#ifndef NATIVE_H
#define NATIVE_H

#include "any_model.h"

#include <math.h>

enum { MAX_STEPS = 1000000 }; /* internal, in one communication step */

struct Engine {
    const Model *model; /* for model_of */
    double *memory;
    double origin; /* the time at which the inputs have the values in memory */
    bool sloped;   /* whether any input has a slope */
    long most;     /* internal steps of a communication step, MAX_STEPS or fewer */
    long budget;   /* what remains of them in this one; negative if that was too few */
    double time;   /* argument of the law being called, as the inputs below */
    double *inputs;
    double *trial;   /* states */
    double *k[5];    /* the rates k1 ... k5 of a trial step */
    double *updated; /* discretes */
    const double **arg;
    double **res;
    long long *iw;
    double *w;
    void *arrays; /* all of the above in one block */
};

/* The model of an engine. Where one is compiled with it, as in an FMU, that is a constant, so that the compiler knows
   every size (this_model.h); else the one that it was given (any_model.c). */
static inline const Model *model_of(const Engine *engine);

/* Gives an engine its arrays, as large as the model needs them. False without memory. */
static bool furnish(Engine *engine, const Model *model, double *memory);

/* Sets the five arguments every law begins with. CasADi may overwrite all beyond a law's own arguments only. */
static inline void bind(Engine *engine, double time, const double *states) {
    const Model *model = model_of(engine);
    const double *memory = engine->memory;
    engine->time = time;
    engine->arg[0] = &engine->time;
    engine->arg[1] = memory + model->first_parameter;
    engine->arg[2] = memory + model->first_input;
    engine->arg[3] = states;
    engine->arg[4] = memory + model->first_discrete;
    if (engine->sloped) {
        for (int i = 0; i < model->inputs; i++)
            engine->inputs[i] = memory[model->first_input + i] + memory[model->slopes + i] * (time - engine->origin);
        engine->arg[2] = engine->inputs;
    }
}

static inline bool call(Engine *engine, Law *law) {
    return law(engine->arg, engine->res, engine->iw, engine->w, 0) == 0;
}

static bool law_failed(Message message, const char *law);

static bool engine_evaluate(Engine *engine, double time, Message message);
static bool engine_advance(Engine *engine, double time, double step, Message message);

/* Integrates the states from `time` to `target`, all else being held. */
static bool integrate(Engine *engine, double time, double target, Message message);

#endif

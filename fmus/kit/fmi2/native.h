/* The native engine: the laws as generated C, and what its files share. */
#ifndef NATIVE_H
#define NATIVE_H

#include "engine.h"

static Law rates, outputs, tangent;
#define DECLARE_UPDATE(name) static Law name;
LAWS_UPDATES(DECLARE_UPDATE)
#undef DECLARE_UPDATE

enum { MAX_STEPS = 1000000 }; /* internal, in one communication step */

struct Engine {
    double *memory;
    double origin; /* the time at which the inputs have the values in memory */
    bool sloped;   /* whether any input has a slope */
    long budget;   /* of MAX_STEPS, what remains in this communication step */
    double time;   /* argument of the law being called, as the inputs below */
    double inputs[MODEL_INPUTS + 1];
    double trial[MODEL_STATES + 1];
    double k[5][MODEL_STATES + 1]; /* the rates k1 ... k5 of a trial step */
    double updated[MODEL_DISCRETES + 1];
    const double *arg[LAWS_SZ_ARG + 1];
    double *res[LAWS_SZ_RES + 1];
    long long iw[LAWS_SZ_IW + 1];
    double w[LAWS_SZ_W + 1];
};

/* Sets the five arguments every law begins with. CasADi may overwrite all beyond a law's own arguments only. */
static inline void bind(Engine *engine, double time, const double *states) {
    const double *memory = engine->memory;
    engine->time = time;
    engine->arg[0] = &engine->time;
    engine->arg[1] = memory + FIRST_PARAMETER;
    engine->arg[2] = memory + FIRST_INPUT;
    engine->arg[3] = states;
    engine->arg[4] = memory + FIRST_DISCRETE;
    if (engine->sloped) {
        for (int i = 0; i < MODEL_INPUTS; i++)
            engine->inputs[i] = memory[FIRST_INPUT + i] + memory[MEMORY_SLOPES + i] * (time - engine->origin);
        engine->arg[2] = engine->inputs;
    }
}

static inline bool call(Engine *engine, Law *law) {
    return law(engine->arg, engine->res, engine->iw, engine->w, 0) == 0;
}

/* Makes the updates that are due and finds where the integration has to stop next: the next sample or `end`. */
static bool sample(Engine *engine, double time, double end, double *target, Message message);

static double period_of(const Engine *engine, int group);

/* Integrates the states from `time` to `target`, all else being held. */
static bool integrate(Engine *engine, double time, double target, Message message);

#endif

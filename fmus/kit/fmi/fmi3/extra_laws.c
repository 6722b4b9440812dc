/* FMI 3.0: the laws of the native engine that this version needs beside the others. */
#include "extra_laws.h"
#include "native.h"

static Law output_rates, adjoint;

static Engine *bound(Instance *instance) {
    Engine *engine = instance->engine;
    engine->sloped = false;
    bind(engine, instance->now.time, engine->memory + FIRST_STATE);
    return engine;
}

bool differentiate_outputs(Instance *instance, double rate[]) {
    Engine *engine = bound(instance);
    engine->res[0] = rate;
    return call(engine, output_rates);
}

bool adjoin(Instance *instance, const double *seed, double *result) {
    Engine *engine = bound(instance);
    engine->arg[5] = seed;
    engine->arg[6] = seed + MODEL_STATES;
    engine->res[0] = result + MODEL_VARIABLES;
    engine->res[1] = result + FIRST_PARAMETER;
    engine->res[2] = result + FIRST_INPUT;
    engine->res[3] = result + FIRST_STATE;
    engine->res[4] = result + FIRST_DISCRETE;
    return call(engine, adjoint);
}

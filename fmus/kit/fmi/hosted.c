/* The native engine in an FMU: of the one model that is compiled with it, and with what only a host asks for. */
#include "exchange.h"
#include "native.h"
#include "this_model.h"

#include <stdio.h>
#include <stdlib.h>

static Law tangent, indicators;

static const bool engine_interpolates = true;
static const bool engine_exchanges = true;
static const bool engine_differentiates = true;

Engine *engine_create(double *memory, const TextValue *texts, const char *resources, Message message) {
    Engine *engine = calloc(1, sizeof *engine);
    (void)texts;
    (void)resources;
    if (engine != NULL && furnish(engine, &this_model, memory))
        return engine;
    snprintf(message, MESSAGE_SIZE, "out of memory");
    engine_free(engine);
    return NULL;
}

void engine_free(Engine *engine) {
    if (engine != NULL)
        free(engine->arrays);
    free(engine);
}

void engine_terminate(Engine *engine) { (void)engine; }

bool engine_initialize(Engine *engine, Message message) {
    (void)engine;
    (void)message;
    return true;
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
    engine->arg[5] = seed + MODEL_VARIABLES;
    engine->arg[6] = seed + FIRST_PARAMETER;
    engine->arg[7] = seed + FIRST_INPUT;
    engine->arg[8] = seed + FIRST_STATE;
    engine->arg[9] = seed + FIRST_DISCRETE;
    engine->res[0] = result;
    engine->res[1] = result + MODEL_STATES;
    return call(engine, tangent) || law_failed(message, "tangent");
}

bool engine_indicate(Engine *engine, double time, double z[]) {
    engine->sloped = false;
    bind(engine, time, engine->memory + FIRST_STATE);
    engine->res[0] = z;
    return call(engine, indicators);
}

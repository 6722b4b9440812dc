/* Of a native engine that takes any model: the one that it was given. */
#include "native.h"

const Model *model_of(const Engine *engine) { return engine->model; }

/* For an engine without laws in C: what it says by `engine_differentiates` that it has not, which nobody calls then. */
#include "engine.h"

bool engine_tangent(Engine *engine, double time, const double *seed, double *result, Message message) {
    (void)engine;
    (void)time;
    (void)seed;
    (void)result;
    (void)message;
    return false;
}

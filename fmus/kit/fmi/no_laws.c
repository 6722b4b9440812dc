/* Completes an engine without laws in C. Nobody calls this: `engine_differentiates` is false. */
#include "engine.h"

bool engine_tangent(Engine *engine, double time, const double *seed, double *result, Message message) {
    (void)engine;
    (void)time;
    (void)seed;
    (void)result;
    (void)message;
    return false;
}

/* FMI 3.0: for an engine without laws in C, what it has not beside no_laws.c; there are no event indicators. */
#include "exchange.h"
#include "extra_laws.h"

bool engine_indicate(Engine *engine, double time, double z[]) {
    (void)engine;
    (void)time;
    (void)z;
    return true;
}

bool differentiate_outputs(Instance *instance, double rate[]) {
    (void)instance;
    (void)rate;
    return false;
}

bool adjoin(Instance *instance, const double *seed, double *result) {
    (void)instance;
    (void)seed;
    (void)result;
    return false;
}

/* FMI 3.0: completes an engine without laws in C, beside no_laws.c. Nobody calls this: there are no derivatives, and no
   event indicators. */
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

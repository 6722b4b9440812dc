/* Set one input, step, get one output, again and again, and nothing else: what a kernel's results are held against. */
#include "fmi2Functions.h"

int bare_loop(fmi2SetRealTYPE *set, fmi2DoStepTYPE *step, fmi2GetRealTYPE *get, fmi2Component instance,
              fmi2ValueReference input, fmi2ValueReference output, size_t n, const double *time, const double *inputs,
              double *outputs) {
    int worst = 0;
    for (size_t k = 0; k < n; k++) {
        if (k > 0) worst |= step(instance, time[k - 1], time[k] - time[k - 1], fmi2True);
        worst |= set(instance, &input, 1, &inputs[k]);
        worst |= get(instance, &output, 1, &outputs[k]);
    }
    return worst;
}

/* The inner loop of a co-simulation host in C: set one input, step, get one output. */
#include "fmi2Functions.h"

/* Steps `first` ... `first + n - 1` of length `h`; `inputs` has n elements. Returns the worst status. */
FMI2_Export int run_steps(fmi2SetRealTYPE *set, fmi2DoStepTYPE *step, fmi2GetRealTYPE *get, fmi2Component instance,
                          fmi2ValueReference input, fmi2ValueReference output, long first, long n, double h,
                          const double *inputs, double *last) {
    fmi2Status worst = fmi2OK;
    for (long k = 0; k < n; k++) {
        fmi2Status status[] = {set(instance, &input, 1, &inputs[k]), step(instance, (double)(first + k) * h, h, fmi2True),
                               get(instance, &output, 1, last)};
        for (int i = 0; i < 3; i++)
            worst = status[i] > worst ? status[i] : worst;
    }
    return (int)worst;
}

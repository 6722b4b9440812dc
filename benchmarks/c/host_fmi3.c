/* The inner loop of a co-simulation host of FMI 3.0 in C: set one input, step, get one output. */
#include "fmi3Functions.h"

/* Steps `first` ... `first + n - 1` of length `h`; `inputs` has n elements. Returns the worst status. */
FMI3_Export int run_steps(fmi3SetFloat64TYPE *set, fmi3DoStepTYPE *step, fmi3GetFloat64TYPE *get, fmi3Instance instance,
                          fmi3ValueReference input, fmi3ValueReference output, long first, long n, double h,
                          const double *inputs, double *last) {
    fmi3Status worst = fmi3OK;
    bool event, terminate, early;
    double reached;
    for (long k = 0; k < n; k++) {
        fmi3Status status[] = {
            set(instance, &input, 1, &inputs[k], 1),
            step(instance, (double)(first + k) * h, h, true, &event, &terminate, &early, &reached),
            get(instance, &output, 1, last, 1),
        };
        for (int i = 0; i < 3; i++)
            worst = status[i] > worst ? status[i] : worst;
    }
    return (int)worst;
}

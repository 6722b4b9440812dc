/* FMI 2.0 model exchange: what is of this version alone. */
#include "exchange.h"

#include <math.h>

EXPORT fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *event) {
    Instance *instance = c;
    fmi2Status status;
    double next;
    if (!allowed(instance, EVENT, __func__))
        return fmi2Error;
    if (event == NULL)
        return report(instance, fmi2Error, "%s: the pointer to the event is NULL", __func__);
    status = update_discretes(instance, __func__, &next);
    if (status != fmi2OK)
        return status;
    event->nextEventTime = next;
    event->nextEventTimeDefined = isfinite(next) ? fmi2True : fmi2False;
    /* of a host that comes late, as those of fixed steps do: what it has missed is sampled now, one after the other */
    event->newDiscreteStatesNeeded = next <= instance->now.time ? fmi2True : fmi2False;
    event->terminateSimulation = fmi2False;
    /* Rates jump at every event: at a sample, where a law switches, where the host's input does. Some hosts restart their
       solvers only if told that values or nominals have changed; to read the nominals again costs nothing. Where there are
       no states, others refuse to read their nominals. */
    event->nominalsOfContinuousStatesChanged = MODEL_STATES > 0 ? fmi2True : fmi2False;
    event->valuesOfContinuousStatesChanged = fmi2False; /* a sample changes what is sampled, never a state */
    return fmi2OK;
}

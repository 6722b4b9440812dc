/* FMI 3.0: creation and preparation of an instance. */
#include "lifecycle.h"

#include <stdio.h>

EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                                fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                                fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                                size_t n_intermediate, fmi3InstanceEnvironment environment,
                                                fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    const Host host = {environment, log, event_mode, event_mode && early_return};
    (void)visible;
    (void)intermediate; /* no intermediate update is declared: these are never wanted */
    (void)n_intermediate;
    (void)update;
    return instance_create(__func__, &host, INSTANCE_INTEGRATES, name, token, resources, logging);
}

/* NULL, with a line to the host. */
static fmi3Instance refuse(const char *function, const Host *host, const char *name) {
    Message message;
    snprintf(message, sizeof message, "%s: %s is made for co-simulation%s", function, model_name,
             engine_exchanges ? " and model exchange" : "");
    deliver(host, name == NULL ? "" : name, fmi3Error, message);
    return NULL;
}

EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                                 fmi3Boolean visible, fmi3Boolean logging,
                                                 fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    const Host host = {environment, log, true, false};
    (void)visible;
    if (!engine_exchanges)
        return refuse(__func__, &host, name);
    return instance_create(__func__, &host, HOST_INTEGRATES, name, token, resources, logging);
}

EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                                      fmi3Boolean visible, fmi3Boolean logging,
                                                      fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                                      fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock,
                                                      fmi3UnlockPreemptionCallback unlock) {
    const Host host = {environment, log, false, false};
    (void)token;
    (void)resources;
    (void)visible;
    (void)logging;
    (void)clock;
    (void)lock;
    (void)unlock;
    return refuse(__func__, &host, name);
}

EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                              fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop) {
    Instance *instance = c;
    fmi3Status status = set_up(instance, __func__, tolerance_defined, tolerance, start, stop_defined, stop);
    if (status == fmi3OK)
        instance->now.mode = INITIALIZATION;
    return status;
}

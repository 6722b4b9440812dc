/* An FMU that does nothing: every function returns at once. What a step through it costs is what the host costs. */
#include <stdlib.h>

#include "fmi2Functions.h"

#define C fmi2Component c
#define NOTHING(name, ...) \
    FMI2_Export fmi2Status name(__VA_ARGS__) { return fmi2OK; }

FMI2_Export const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
FMI2_Export const char *fmi2GetVersion(void) { return fmi2Version; }

FMI2_Export fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                          const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                                          fmi2Boolean logging) {
    return malloc(1);
}
FMI2_Export void fmi2FreeInstance(C) { free(c); }

NOTHING(fmi2SetDebugLogging, C, fmi2Boolean on, size_t n, const fmi2String categories[])
NOTHING(fmi2SetupExperiment, C, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start, fmi2Boolean has_stop,
        fmi2Real stop)
NOTHING(fmi2EnterInitializationMode, C)
NOTHING(fmi2ExitInitializationMode, C)
NOTHING(fmi2Terminate, C)
NOTHING(fmi2Reset, C)
NOTHING(fmi2GetReal, C, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
NOTHING(fmi2GetInteger, C, const fmi2ValueReference vr[], size_t n, fmi2Integer value[])
NOTHING(fmi2GetBoolean, C, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[])
NOTHING(fmi2GetString, C, const fmi2ValueReference vr[], size_t n, fmi2String value[])
NOTHING(fmi2SetReal, C, const fmi2ValueReference vr[], size_t n, const fmi2Real value[])
NOTHING(fmi2SetInteger, C, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[])
NOTHING(fmi2SetBoolean, C, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[])
NOTHING(fmi2SetString, C, const fmi2ValueReference vr[], size_t n, const fmi2String value[])
NOTHING(fmi2GetFMUstate, C, fmi2FMUstate *state)
NOTHING(fmi2SetFMUstate, C, fmi2FMUstate state)
NOTHING(fmi2FreeFMUstate, C, fmi2FMUstate *state)
NOTHING(fmi2SerializedFMUstateSize, C, fmi2FMUstate state, size_t *size)
NOTHING(fmi2SerializeFMUstate, C, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
NOTHING(fmi2DeSerializeFMUstate, C, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
NOTHING(fmi2GetDirectionalDerivative, C, const fmi2ValueReference unknown[], size_t unknowns,
        const fmi2ValueReference known[], size_t knowns, const fmi2Real seed[], fmi2Real result[])
NOTHING(fmi2SetRealInputDerivatives, C, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
        const fmi2Real value[])
NOTHING(fmi2GetRealOutputDerivatives, C, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
        fmi2Real value[])
NOTHING(fmi2DoStep, C, fmi2Real time, fmi2Real step, fmi2Boolean no_set_state)
NOTHING(fmi2CancelStep, C)
NOTHING(fmi2GetStatus, C, const fmi2StatusKind kind, fmi2Status *value)
NOTHING(fmi2GetRealStatus, C, const fmi2StatusKind kind, fmi2Real *value)
NOTHING(fmi2GetIntegerStatus, C, const fmi2StatusKind kind, fmi2Integer *value)
NOTHING(fmi2GetBooleanStatus, C, const fmi2StatusKind kind, fmi2Boolean *value)
NOTHING(fmi2GetStringStatus, C, const fmi2StatusKind kind, fmi2String *value)

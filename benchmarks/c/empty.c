/* An FMU that does nothing: what a step through it costs is what the host costs. A caller passes its
   arguments in registers or clears them from the stack itself, so that functions need not name them. */
#include <stdlib.h>

#define EXPORT __attribute__((visibility("default")))
#define NOTHING(name) \
    EXPORT int fmi2##name(void) { return 0; }
#define NOTHING_FOR(type) NOTHING(Get##type) NOTHING(Set##type)
#define NOTHING_WITH(word) NOTHING(Get##word##Status)

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT void *fmi2Instantiate(void) { return malloc(1); }
EXPORT void fmi2FreeInstance(void *instance) { free(instance); }

NOTHING(SetDebugLogging) NOTHING(SetupExperiment) NOTHING(EnterInitializationMode)
NOTHING(ExitInitializationMode) NOTHING(Terminate) NOTHING(Reset) NOTHING(DoStep) NOTHING(CancelStep)
NOTHING_FOR(Real) NOTHING_FOR(Integer) NOTHING_FOR(Boolean) NOTHING_FOR(String) NOTHING_FOR(FMUstate)
NOTHING_WITH() NOTHING_WITH(Real) NOTHING_WITH(Integer) NOTHING_WITH(Boolean) NOTHING_WITH(String)
NOTHING(FreeFMUstate) NOTHING(SerializedFMUstateSize) NOTHING(SerializeFMUstate)
NOTHING(DeSerializeFMUstate) NOTHING(GetDirectionalDerivative) NOTHING(SetRealInputDerivatives)
NOTHING(GetRealOutputDerivatives)

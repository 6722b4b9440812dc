/* An FMU of FMI 2.0 that computes nothing: a value reference of 100 or more reads what was set 100 below, of any type. */
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"
#include "fmi2TypesPlatform.h"

enum { VALUES = 100 };

typedef struct {
    fmi2Real real[VALUES];
    fmi2Integer integer[VALUES];
    fmi2Boolean boolean[VALUES];
    char *string[VALUES];
} Instance;

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    return calloc(1, sizeof(Instance));
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2Reset(fmi2Component c) {
    memset(c, 0, sizeof(Instance));
    return fmi2OK;
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean t, fmi2Real tolerance, fmi2Real start, fmi2Boolean s,
                               fmi2Real stop) {
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set) { return fmi2OK; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    return fmi2OK;
}

#define ACCESS(Name, Type, field)                                                                                      \
    fmi2Status fmi2Get##Name(fmi2Component c, const fmi2ValueReference r[], size_t n, Type v[]) {                      \
        for (size_t k = 0; k < n; k++) v[k] = ((Instance *)c)->field[r[k] % VALUES];                                   \
        return fmi2OK;                                                                                                 \
    }                                                                                                                  \
    fmi2Status fmi2Set##Name(fmi2Component c, const fmi2ValueReference r[], size_t n, const Type v[]) {                \
        for (size_t k = 0; k < n; k++) ((Instance *)c)->field[r[k] % VALUES] = KEPT(v[k]);                             \
        return fmi2OK;                                                                                                 \
    }
#define KEPT(value) (value)
ACCESS(Real, fmi2Real, real)
ACCESS(Integer, fmi2Integer, integer)
ACCESS(Boolean, fmi2Boolean, boolean)
#undef KEPT
#define KEPT(value) strdup(value)
ACCESS(String, fmi2String, string)

#include "absent.h"

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return "2.0"; }

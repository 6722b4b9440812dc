/* A member for tests of texts and of real time: it tells what text it was given, and takes its time.
 *
 * `characters` and `checksum` are the number of bytes of the text `label` and their sum as it was when the initialization
 * ended. A step that begins at `from` or later, but before `until`, sleeps for `delay` seconds, and fails at `fails_at` or
 * later. `voltage_age` grows with time, `link_state` is 2 once it is running.
 */
#define _POSIX_C_SOURCE 199309L
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2FunctionTypes.h"

enum { CHARACTERS, CHECKSUM, AGE, STATE, DELAY, FROM, UNTIL, FAILS_AT, NUMBER_OF_VALUES };

typedef struct {
    double value[NUMBER_OF_VALUES];
    char label[1024];
    const fmi2CallbackFunctions *functions;
} Instance;

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)name, (void)type, (void)guid, (void)resources, (void)visible, (void)logging;
    Instance *instance = calloc(1, sizeof *instance);
    instance->functions = functions;
    instance->value[FAILS_AT] = 1e9;
    strcpy(instance->label, "abc");
    return instance;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start_time,
                               fmi2Boolean stop_time_defined, fmi2Real stop_time) {
    (void)c, (void)tolerance_defined, (void)tolerance, (void)start_time, (void)stop_time_defined, (void)stop_time;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *instance = c;
    instance->value[CHARACTERS] = (double)strlen(instance->label);
    for (const unsigned char *p = (const unsigned char *)instance->label; *p; p++) instance->value[CHECKSUM] += *p;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) { return c ? fmi2OK : fmi2Error; }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) value[i] = ((Instance *)c)->value[vr[i]];
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) ((Instance *)c)->value[vr[i]] = value[i];
    return fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
    if (n != 1 || vr[0] != 0) return fmi2Error;
    value[0] = ((Instance *)c)->label;
    return fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) {
    if (n != 1 || vr[0] != 0 || strlen(value[0]) >= sizeof ((Instance *)c)->label) return fmi2Error;
    strcpy(((Instance *)c)->label, value[0]);
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_state_set_before) {
    Instance *instance = c;
    double *own = instance->value;
    (void)no_state_set_before;
    if (time >= own[FAILS_AT] - 1e-9) {
        const fmi2CallbackFunctions *f = instance->functions;
        f->logger(f->componentEnvironment, "sleeper", fmi2Error, "category", "the rig has fallen silent");
        return fmi2Error;
    }
    if (own[DELAY] > 0.0 && time >= own[FROM] - 1e-9 && time < own[UNTIL] - 1e-9) {
        struct timespec pause = {(time_t)own[DELAY], (long)((own[DELAY] - (double)(time_t)own[DELAY]) * 1e9)};
        while (nanosleep(&pause, &pause) != 0) continue; /* a signal is no reason to wake up */
    }
    own[AGE] = time + step;
    own[STATE] = 2.0;
    return fmi2OK;
}

#include "absent.h"

ABSENT(GetTypesPlatform)
ABSENT(GetVersion)
ABSENT(SetDebugLogging)
ABSENT(Reset)
ABSENT(GetInteger)
ABSENT(GetBoolean)
ABSENT(SetInteger)
ABSENT(SetBoolean)

/* Calls functions of FMI 2.0 of an FMU in random order with random arguments:
 * random_calls LIBRARY TOKEN COUNT_OF_ELEMENTS CALLS SEED [RESOURCES]. Compiled with sanitizers, as the FMU. */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { MOST = 64 };

static unsigned long long state;
static long complaints;

static unsigned pick(unsigned below) {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return (unsigned)(state >> 33) % below;
}

static void complain(void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message,
                     ...) {
    (void)environment, (void)name, (void)category, (void)message;
    complaints += status > fmi2Warning;
}

#define FIND(name) fmi2##name##TYPE *name = (fmi2##name##TYPE *)dlsym(library, "fmi2" #name)

int main(int count, char **arguments) {
    if (count < 6) return 2;
    fmi2String resources = count > 6 ? arguments[6] : "";
    void *library = dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        puts(dlerror());
        return 2;
    }
    FIND(Instantiate);
    FIND(FreeInstance);
    FIND(SetupExperiment);
    FIND(EnterInitializationMode);
    FIND(ExitInitializationMode);
    FIND(Terminate);
    FIND(Reset);
    FIND(GetReal);
    FIND(GetInteger);
    FIND(GetBoolean);
    FIND(GetString);
    FIND(SetReal);
    FIND(SetInteger);
    FIND(SetBoolean);
    FIND(SetString);
    FIND(GetFMUstate);
    FIND(SetFMUstate);
    FIND(FreeFMUstate);
    FIND(SerializedFMUstateSize);
    FIND(SerializeFMUstate);
    FIND(DeSerializeFMUstate);
    FIND(GetDirectionalDerivative);
    FIND(GetRealOutputDerivatives);
    FIND(DoStep);
    FIND(GetRealStatus);
    FIND(GetBooleanStatus);
    FIND(EnterEventMode);
    FIND(NewDiscreteStates);
    FIND(EnterContinuousTimeMode);
    FIND(CompletedIntegratorStep);
    FIND(SetTime);
    FIND(GetDerivatives);
    FIND(GetContinuousStates);
    FIND(SetContinuousStates);
    FIND(GetEventIndicators);
    unsigned functions = EnterEventMode ? 36 : 27; /* those of model exchange are the last */
    unsigned elements = (unsigned)atoi(arguments[3]);
    long calls = atol(arguments[4]), refused = 0;
    state = strtoull(arguments[5], NULL, 10);
    fmi2CallbackFunctions callbacks = {complain, calloc, free, NULL, NULL};
    fmi2Component c = NULL;
    fmi2FMUstate saved = NULL;
    double time = 0.0;
    for (long k = 0; k < calls; k++) {
        fmi2ValueReference r[MOST], other[MOST];
        double reals[MOST], seeds[MOST];
        int whole[MOST], orders[MOST];
        fmi2String texts[MOST];
        fmi2EventInfo info;
        fmi2Boolean a, b;
        size_t n = pick(MOST), size = 0;
        for (int i = 0; i < MOST; i++) {
            r[i] = pick(20) ? pick(elements) : pick(3) ? elements + pick(9) : 4294967295u;
            other[i] = pick(20) ? pick(elements) : pick(4000000000u);
            reals[i] = (double)pick(1000) - 500.0;
            seeds[i] = pick(3);
            whole[i] = pick(5) ? (int)pick(3) : (int)pick(100000);
            orders[i] = (int)pick(3);
            texts[i] = pick(2) ? "short" : "a text that is longer than those that are there";
        }
        if (!c) {
            fmi2Type kind = pick(3) ? fmi2CoSimulation : fmi2ModelExchange;
            c = Instantiate("c", kind, pick(20) ? arguments[2] : "another", resources, &callbacks, 0, 0);
            time = 0.0;
            continue;
        }
        fmi2Status status = fmi2OK;
        switch (pick(functions)) {
        case 0: /* its states must be freed before */
            if (pick(4)) break;
            if (saved) FreeFMUstate(c, &saved);
            FreeInstance(c);
            c = NULL;
            saved = NULL;
            break;
        case 1: status = SetupExperiment(c, 0, 0.0, time, 0, 0.0); break;
        case 2:
        case 3: status = EnterInitializationMode(c); break;
        case 4:
        case 5: status = ExitInitializationMode(c); break;
        case 6: status = Reset(c); time = 0.0; break;
        case 7: status = pick(9) ? fmi2OK : Terminate(c); break;
        case 8: status = GetReal(c, r, n, reals); break;
        case 9: status = GetInteger(c, r, n, whole); break;
        case 10: status = GetBoolean(c, r, n, whole); break;
        case 11: status = GetString(c, r, n, texts); break;
        case 12: status = SetReal(c, r, n, reals); break;
        case 13: status = SetInteger(c, r, n, whole); break;
        case 14: status = SetBoolean(c, r, n, whole); break;
        case 15: status = SetString(c, r, n, texts); break;
        case 16: status = GetFMUstate(c, &saved); break;
        case 17: if (saved) status = SetFMUstate(c, saved); break;
        case 18: if (saved) status = FreeFMUstate(c, &saved); break;
        case 19:
            if (saved && SerializedFMUstateSize(c, saved, &size) == fmi2OK) {
                char *bytes = malloc(size);
                SerializeFMUstate(c, saved, bytes, size - pick(2));
                if (SerializeFMUstate(c, saved, bytes, size) == fmi2OK)
                    status = DeSerializeFMUstate(c, bytes, size, &saved);
                free(bytes);
            }
            break;
        case 20: status = GetDirectionalDerivative(c, r, n, other, pick(MOST), seeds, reals); break;
        case 21: status = GetRealOutputDerivatives(c, r, n, orders, reals); break;
        case 22:
        case 23:
        case 24:
            status = DoStep(c, time, 0.25, 1);
            if (status == fmi2OK) time += 0.25;
            break;
        case 25: status = GetRealStatus(c, fmi2LastSuccessfulTime, reals); break;
        case 26: status = GetBooleanStatus(c, fmi2Terminated, whole); break;
        case 27: status = EnterEventMode(c); break;
        case 28: status = NewDiscreteStates(c, &info); break;
        case 29: status = EnterContinuousTimeMode(c); break;
        case 30: status = CompletedIntegratorStep(c, 1, &a, &b); break;
        case 31: status = SetTime(c, time); break;
        case 32: status = GetDerivatives(c, reals, pick(5)); break;
        case 33: status = GetContinuousStates(c, reals, pick(5)); break;
        case 34: status = SetContinuousStates(c, reals, pick(5)); break;
        case 35: status = GetEventIndicators(c, reals, pick(2)); break;
        }
        refused += status > fmi2Warning;
    }
    if (c && saved) FreeFMUstate(c, &saved);
    FreeInstance(c);
    printf("%ld refused, %ld complaints\n", refused, complaints);
    return dlclose(library);
}

/* A host that creates the first instances of FMUs in several threads at the same time.
 *
 *     thread_host THREADS REFERENCE LIBRARY GUID RESOURCE_URI [LIBRARY GUID RESOURCE_URI]...
 *
 * Thread k takes FMU k modulo their number. All threads wait for each other; then each creates an instance, initializes
 * it, makes ten steps of 0.1 s and frees it. Each prints one line with the value of the Real output REFERENCE at the
 * end. Messages of the FMU go to the error stream.
 *
 * Exit codes: 0 done, 2 a library does not load, 3 no instance, 4 a call failed, 5 bad usage.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "fmi2Functions.h"

enum { MOST_THREADS = 64, STEPS = 10 };

static pthread_barrier_t barrier;
static fmi2ValueReference reference;

typedef struct {
    void *library;
    const char *guid, *resources;
} Fmu;

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment;
    fprintf(stderr, "[%s] status %d, %s: %s\n", name, (int)status, category, message);
}

static void *function(const Fmu *fmu, const char *name) {
    void *found = dlsym(fmu->library, name);
    if (found == NULL) {
        fprintf(stderr, "thread_host: no function %s\n", name);
        _exit(2);
    }
    return found;
}

static void check(const char *call, fmi2Status status) {
    if (status == fmi2OK) return;
    fprintf(stderr, "thread_host: %s answers %d\n", call, (int)status);
    _exit(4);
}

static void *run(void *argument) {
    static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    const Fmu *fmu = argument;
    fmi2InstantiateTYPE *instantiate = (fmi2InstantiateTYPE *)function(fmu, "fmi2Instantiate");
    fmi2DoStepTYPE *step = (fmi2DoStepTYPE *)function(fmu, "fmi2DoStep");
    double value;
    pthread_barrier_wait(&barrier);
    fmi2Component c = instantiate("host", fmi2CoSimulation, fmu->guid, fmu->resources, &callbacks, 0, 0);
    if (c == NULL) return (void *)&barrier; /* anything but NULL */
    check("fmi2SetupExperiment",
          ((fmi2SetupExperimentTYPE *)function(fmu, "fmi2SetupExperiment"))(c, 0, 0.0, 0.0, 0, 0.0));
    check("fmi2EnterInitializationMode",
          ((fmi2EnterInitializationModeTYPE *)function(fmu, "fmi2EnterInitializationMode"))(c));
    check("fmi2ExitInitializationMode",
          ((fmi2ExitInitializationModeTYPE *)function(fmu, "fmi2ExitInitializationMode"))(c));
    for (int k = 0; k < STEPS; k++) check("fmi2DoStep", step(c, 0.1 * k, 0.1 * (k + 1) - 0.1 * k, 1));
    check("fmi2GetReal", ((fmi2GetRealTYPE *)function(fmu, "fmi2GetReal"))(c, &reference, 1, &value));
    printf("%.17g\n", value);
    check("fmi2Terminate", ((fmi2TerminateTYPE *)function(fmu, "fmi2Terminate"))(c));
    ((fmi2FreeInstanceTYPE *)function(fmu, "fmi2FreeInstance"))(c);
    return NULL;
}

int main(int argc, char **argv) {
    pthread_t threads[MOST_THREADS];
    Fmu fmus[MOST_THREADS];
    int count = argc < 6 ? 0 : atoi(argv[1]), kinds = (argc - 3) / 3;
    if (count < 1 || count > MOST_THREADS || kinds > MOST_THREADS) return 5;
    reference = (fmi2ValueReference)atoi(argv[2]);
    for (int i = 0; i < kinds; i++) {
        fmus[i] = (Fmu){dlopen(argv[3 + 3 * i], RTLD_NOW | RTLD_LOCAL), argv[4 + 3 * i], argv[5 + 3 * i]};
        if (fmus[i].library == NULL) {
            fprintf(stderr, "thread_host: %s\n", dlerror());
            return 2;
        }
    }
    pthread_barrier_init(&barrier, NULL, (unsigned)count);
    for (int i = 0; i < count; i++) pthread_create(&threads[i], NULL, run, &fmus[i % kinds]);
    int code = 0;
    for (int i = 0; i < count; i++) {
        void *failed;
        pthread_join(threads[i], &failed);
        if (failed != NULL) code = 3;
    }
    return code;
}

/* A program into which two source FMUs are linked, each compiled with an FMI2_FUNCTION_PREFIX of its own.
 *
 *     linked_host STEPS { GUID INPUTS OUTPUTS }, twice
 *
 * FIRST and SECOND are the prefixes. INPUTS and OUTPUTS are value references of Real variables, with commas between them.
 * Both FMUs are stepped in turn by 1/64 s; in step k all inputs are 0.001 (k mod 7). A line of the table has the outputs of
 * both at the end of the step.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

typedef struct {
    fmi2InstantiateTYPE *instantiate;
    fmi2SetupExperimentTYPE *setup;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    fmi2SetRealTYPE *set;
    fmi2DoStepTYPE *step;
    fmi2GetRealTYPE *get;
    fmi2TerminateTYPE *terminate;
    fmi2FreeInstanceTYPE *free;
} Functions;

#define PASTE(a, b) a##b
#define NAME(prefix, name) PASTE(prefix, name)
#define DECLARE(prefix)                                                           \
    fmi2InstantiateTYPE NAME(prefix, fmi2Instantiate);                            \
    fmi2SetupExperimentTYPE NAME(prefix, fmi2SetupExperiment);                    \
    fmi2EnterInitializationModeTYPE NAME(prefix, fmi2EnterInitializationMode);    \
    fmi2ExitInitializationModeTYPE NAME(prefix, fmi2ExitInitializationMode);      \
    fmi2SetRealTYPE NAME(prefix, fmi2SetReal);                                    \
    fmi2DoStepTYPE NAME(prefix, fmi2DoStep);                                      \
    fmi2GetRealTYPE NAME(prefix, fmi2GetReal);                                    \
    fmi2TerminateTYPE NAME(prefix, fmi2Terminate);                                \
    fmi2FreeInstanceTYPE NAME(prefix, fmi2FreeInstance);
#define FUNCTIONS(prefix)                                                                                            \
    {NAME(prefix, fmi2Instantiate), NAME(prefix, fmi2SetupExperiment), NAME(prefix, fmi2EnterInitializationMode),    \
     NAME(prefix, fmi2ExitInitializationMode), NAME(prefix, fmi2SetReal), NAME(prefix, fmi2DoStep),                  \
     NAME(prefix, fmi2GetReal), NAME(prefix, fmi2Terminate), NAME(prefix, fmi2FreeInstance)}

DECLARE(FIRST)
DECLARE(SECOND)

enum { MOST = 64 };

typedef struct {
    fmi2ValueReference references[MOST];
    size_t count;
} List;

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment;
    fprintf(stderr, "[%s] status %d, %s: %s\n", name, (int)status, category, message);
}

static List list(char *text) {
    List found = {{0}, 0};
    for (char *word = strtok(text, ","); word != NULL && found.count < MOST; word = strtok(NULL, ","))
        found.references[found.count++] = (fmi2ValueReference)atoi(word);
    return found;
}

static void check(fmi2Status status) {
    if (status != fmi2OK) exit(4);
}

int main(int argc, char **argv) {
    const Functions functions[] = {FUNCTIONS(FIRST), FUNCTIONS(SECOND)};
    const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    fmi2Component component[2];
    List inputs[2], outputs[2];
    if (argc != 8) return 5;
    for (int i = 0; i < 2; i++) {
        const Functions *f = &functions[i];
        component[i] = f->instantiate("linked", fmi2CoSimulation, argv[2 + 3 * i], NULL, &callbacks, 0, 0);
        if (component[i] == NULL) return 3;
        inputs[i] = list(argv[3 + 3 * i]);
        outputs[i] = list(argv[4 + 3 * i]);
        check(f->setup(component[i], fmi2False, 0.0, 0.0, fmi2False, 0.0));
        check(f->enter(component[i]));
        check(f->leave(component[i]));
    }
    for (int k = 0; k < atoi(argv[1]); k++) {
        for (int i = 0; i < 2; i++) {
            double values[MOST];
            for (size_t j = 0; j < inputs[i].count; j++) values[j] = 0.001 * (k % 7);
            check(functions[i].set(component[i], inputs[i].references, inputs[i].count, values));
            check(functions[i].step(component[i], k / 64.0, 1.0 / 64.0, fmi2True));
            check(functions[i].get(component[i], outputs[i].references, outputs[i].count, values));
            for (size_t j = 0; j < outputs[i].count; j++) printf("%.17g ", values[j]);
        }
        printf("\n");
    }
    for (int i = 0; i < 2; i++) {
        check(functions[i].terminate(component[i]));
        functions[i].free(component[i]);
    }
    return 0;
}

/* A co-simulation master without Python: loads one FMI 2.0 binary and runs it over given communication points.
 *
 *     c_host LIBRARY GUID RESOURCE_URI < plan > table
 *
 * The plan is a sequence of numbers and words separated by white space:
 *     number of parameters, then for each    TYPE REFERENCE VALUE
 *     number of inputs, then for each        TYPE REFERENCE
 *     number of outputs, then for each       TYPE REFERENCE
 *     number of communication points, then for each    TIME INPUT...
 * TYPE is r, i or b (Real, Integer, Boolean). The table has one line of output values for each communication point, read
 * after the inputs of that point are set. Messages of the FMU and of this program go to the error stream.
 *
 * Exit codes: 0 done, 2 the library does not load, 3 no instance, 4 a call failed, 5 bad plan.
 */
#define _POSIX_C_SOURCE 200809L
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi2Functions.h"

typedef struct {
    char type;
    fmi2ValueReference reference;
} Variable;

static void *library;

static void fail(int code, const char *what, const char *detail) {
    fprintf(stderr, "c_host: %s: %s\n", what, detail);
    fflush(NULL);
    exit(code);
}

static void *function(const char *name) {
    void *found = dlsym(library, name);
    if (found == NULL) fail(2, "missing function", name);
    return found;
}

static void check(const char *call, fmi2Status status) {
    static const char *const text[] = {"OK", "Warning", "Discard", "Error", "Fatal", "Pending"};
    if (status != fmi2OK) fail(4, call, status <= fmi2Pending ? text[status] : "unknown status");
}

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    va_list arguments;
    (void)environment;
    fprintf(stderr, "[%s] status %d, %s: ", name ? name : "", (int)status, category ? category : "");
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

static double number(void) {
    char word[64], *end;
    if (scanf("%63s", word) != 1) fail(5, "bad plan", "a number is missing");
    double value = strtod(word, &end);
    if (*end != '\0') fail(5, "bad plan", word);
    return value;
}

static Variable variable(void) {
    Variable v;
    if (scanf(" %c", &v.type) != 1) fail(5, "bad plan", "a variable is missing");
    v.reference = (fmi2ValueReference)number();
    return v;
}

static Variable *variables(size_t *count) {
    *count = (size_t)number();
    Variable *list = calloc(*count + 1, sizeof *list);
    if (list == NULL) fail(5, "bad plan", "too many variables");
    for (size_t i = 0; i < *count; i++) list[i] = variable();
    return list;
}

static void set(fmi2Component c, Variable v, double value) {
    if (v.type == 'r') {
        check("fmi2SetReal", ((fmi2SetRealTYPE *)function("fmi2SetReal"))(c, &v.reference, 1, &value));
    } else if (v.type == 'i') {
        fmi2Integer whole = (fmi2Integer)value;
        check("fmi2SetInteger", ((fmi2SetIntegerTYPE *)function("fmi2SetInteger"))(c, &v.reference, 1, &whole));
    } else {
        fmi2Boolean flag = value != 0.0;
        check("fmi2SetBoolean", ((fmi2SetBooleanTYPE *)function("fmi2SetBoolean"))(c, &v.reference, 1, &flag));
    }
}

static double get(fmi2Component c, Variable v) {
    if (v.type == 'r') {
        double value;
        check("fmi2GetReal", ((fmi2GetRealTYPE *)function("fmi2GetReal"))(c, &v.reference, 1, &value));
        return value;
    }
    if (v.type == 'i') {
        fmi2Integer whole;
        check("fmi2GetInteger", ((fmi2GetIntegerTYPE *)function("fmi2GetInteger"))(c, &v.reference, 1, &whole));
        return whole;
    }
    fmi2Boolean flag;
    check("fmi2GetBoolean", ((fmi2GetBooleanTYPE *)function("fmi2GetBoolean"))(c, &v.reference, 1, &flag));
    return flag;
}

int main(int argc, char **argv) {
    if (argc < 4) fail(5, "usage", "c_host LIBRARY GUID RESOURCE_URI");
    library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) fail(2, "cannot load", dlerror());

    const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    fmi2Component c = ((fmi2InstantiateTYPE *)function("fmi2Instantiate"))("host", fmi2CoSimulation, argv[2], argv[3],
                                                                          &callbacks, fmi2False, fmi2False);
    if (c == NULL) fail(3, "fmi2Instantiate", "no instance");

    size_t parameters = (size_t)number();
    for (size_t i = 0; i < parameters; i++) {
        Variable v = variable();
        set(c, v, number());
    }
    size_t inputs, outputs;
    Variable *input = variables(&inputs), *output = variables(&outputs);
    size_t points = (size_t)number();
    double *plan = calloc(points * (1 + inputs) + 1, sizeof *plan);
    if (plan == NULL || points == 0) fail(5, "bad plan", "no communication points");
    for (size_t i = 0; i < points * (1 + inputs); i++) plan[i] = number();

    const double *row = plan, *last = plan + (points - 1) * (1 + inputs);
    check("fmi2SetupExperiment", ((fmi2SetupExperimentTYPE *)function("fmi2SetupExperiment"))(
                                     c, fmi2False, 0.0, row[0], points > 1, last[0]));
    check("fmi2EnterInitializationMode",
          ((fmi2EnterInitializationModeTYPE *)function("fmi2EnterInitializationMode"))(c));
    for (size_t i = 0; i < inputs; i++) set(c, input[i], row[1 + i]);
    check("fmi2ExitInitializationMode",
          ((fmi2ExitInitializationModeTYPE *)function("fmi2ExitInitializationMode"))(c));
    fmi2DoStepTYPE *step = (fmi2DoStepTYPE *)function("fmi2DoStep");
    for (;; row += 1 + inputs) {
        for (size_t i = 0; i < inputs; i++) set(c, input[i], row[1 + i]);
        for (size_t i = 0; i < outputs; i++) printf("%s%.17g", i ? " " : "", get(c, output[i]));
        printf("\n");
        if (row == last) break;
        check("fmi2DoStep", step(c, row[0], row[1 + inputs] - row[0], fmi2True));
    }
    check("fmi2Terminate", ((fmi2TerminateTYPE *)function("fmi2Terminate"))(c));
    ((fmi2FreeInstanceTYPE *)function("fmi2FreeInstance"))(c);
    free(input), free(output), free(plan);
    return 0;
}

/* A co-simulation master without Python: loads one binary and runs it over given communication points.
 *
 *     c_host LIBRARY GUID RESOURCES < plan > table
 *
 * FMI, 2 or 3 when it is compiled, is the version of the binary. RESOURCES is a URI in the one, a path in the other.
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
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#ifdef _WIN32
#include <windows.h>
#define load(path) ((void *)LoadLibraryA(path))
#define symbol(name) ((void *)GetProcAddress(library, name))
#else
#include <dlfcn.h>
#define load(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define symbol(name) dlsym(library, name)
#endif

#if FMI == 3
#include "fmi3Functions.h"
typedef fmi3Instance Instance;
typedef fmi3ValueReference Reference;
typedef fmi3Status Status;
typedef fmi3Int32 Integer;
typedef fmi3Boolean Boolean;
#define NAME(call) "fmi3" #call
#define CALL(call) ((fmi3##call##TYPE *)function(NAME(call)))
#define MOVE(verb, type, type3, v, value) check(NAME(verb##type3), CALL(verb##type3)(c, &(v).reference, 1, value, 1))
#else
#include "fmi2Functions.h"
typedef fmi2Component Instance;
typedef fmi2ValueReference Reference;
typedef fmi2Status Status;
typedef fmi2Integer Integer;
typedef fmi2Boolean Boolean;
#define NAME(call) "fmi2" #call
#define CALL(call) ((fmi2##call##TYPE *)function(NAME(call)))
#define MOVE(verb, type, type3, v, value) check(NAME(verb##type), CALL(verb##type)(c, &(v).reference, 1, value))
#endif

typedef struct {
    char type;
    Reference reference;
} Variable;

static void *library;

static void fail(int code, const char *what, const char *detail) {
    fprintf(stderr, "c_host: %s: %s\n", what, detail);
    fflush(NULL);
    exit(code);
}

static void *function(const char *name) {
    void *found = symbol(name);
    if (found == NULL) fail(2, "missing function", name);
    return found;
}

static void check(const char *call, Status status) {
    static const char *const text[] = {"OK", "Warning", "Discard", "Error", "Fatal", "Pending"};
    if (status != 0) fail(4, call, status < 6 ? text[status] : "unknown status");
}

#if FMI == 3
static void logger(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message) {
    (void)environment;
    fprintf(stderr, "status %d, %s: %s\n", (int)status, category ? category : "", message);
}

static Instance instantiate(const char *guid, const char *resources) {
    return CALL(InstantiateCoSimulation)("host", guid, resources, false, false, false, false, NULL, 0, NULL, logger, NULL);
}

static void initialize(Instance c, double start, int stops, double stop) {
    check("fmi3EnterInitializationMode", CALL(EnterInitializationMode)(c, false, 0.0, start, stops, stop));
}

static Status step(Instance c, double time, double size) {
    fmi3Boolean event, terminate, early;
    double last;
    return CALL(DoStep)(c, time, size, true, &event, &terminate, &early, &last);
}
#else
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

static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};

static Instance instantiate(const char *guid, const char *resources) {
    return CALL(Instantiate)("host", fmi2CoSimulation, guid, resources, &callbacks, fmi2False, fmi2False);
}

static void initialize(Instance c, double start, int stops, double stop) {
    check("fmi2SetupExperiment", CALL(SetupExperiment)(c, fmi2False, 0.0, start, stops, stop));
    check("fmi2EnterInitializationMode", CALL(EnterInitializationMode)(c));
}

static Status step(Instance c, double time, double size) { return CALL(DoStep)(c, time, size, fmi2True); }
#endif

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
    v.reference = (Reference)number();
    return v;
}

static Variable *variables(size_t *count) {
    *count = (size_t)number();
    Variable *list = calloc(*count + 1, sizeof *list);
    if (list == NULL) fail(5, "bad plan", "too many variables");
    for (size_t i = 0; i < *count; i++) list[i] = variable();
    return list;
}

static void set(Instance c, Variable v, double value) {
    if (v.type == 'r') {
        MOVE(Set, Real, Float64, v, &value);
    } else if (v.type == 'i') {
        Integer whole = (Integer)value;
        MOVE(Set, Integer, Int32, v, &whole);
    } else {
        Boolean flag = value != 0.0;
        MOVE(Set, Boolean, Boolean, v, &flag);
    }
}

static double get(Instance c, Variable v) {
    double value;
    Integer whole;
    Boolean flag;
    if (v.type == 'r') {
        MOVE(Get, Real, Float64, v, &value);
        return value;
    }
    if (v.type == 'i') {
        MOVE(Get, Integer, Int32, v, &whole);
        return whole;
    }
    MOVE(Get, Boolean, Boolean, v, &flag);
    return flag;
}

int main(int argc, char **argv) {
    if (argc < 4) fail(5, "usage", "c_host LIBRARY GUID RESOURCES");
    library = load(argv[1]);
#ifdef _WIN32
    if (library == NULL) fail(2, "cannot load", argv[1]);
#else
    if (library == NULL) fail(2, "cannot load", dlerror());
#endif
    Instance c = instantiate(argv[2], argv[3]);
    if (c == NULL) fail(3, NAME(Instantiate), "no instance");

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
    initialize(c, row[0], points > 1, last[0]);
    for (size_t i = 0; i < inputs; i++) set(c, input[i], row[1 + i]);
    check(NAME(ExitInitializationMode), CALL(ExitInitializationMode)(c));
    for (;; row += 1 + inputs) {
        for (size_t i = 0; i < inputs; i++) set(c, input[i], row[1 + i]);
        for (size_t i = 0; i < outputs; i++) printf("%s%.17g", i ? " " : "", get(c, output[i]));
        printf("\n");
        if (row == last) break;
        check(NAME(DoStep), step(c, row[0], row[1 + inputs] - row[0]));
    }
    check(NAME(Terminate), CALL(Terminate)(c));
    CALL(FreeInstance)(c);
    free(input), free(output), free(plan);
    return 0;
}

/* Calls of every function of an FMU of FMI 3.0, in any order and with any arguments; or many instances at once.
 *
 *     random_calls calls TOKEN SEED COUNT [RESOURCES]
 *     random_calls instances TOKEN COUNT [RESOURCES]
 *
 * Arrays are as long as they are said to be, so that a sanitizer sees a function that goes beyond them. An error must
 * have a message, no status may be Fatal, and what was valid before a refused call is so after it. Linked with the FMU.
 */
#include "fmi3Functions.h"
#include "model.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef MODEL_ARRAYS
#define MODEL_ARRAYS(X)
#endif

enum { INSTANCES = 4, STATES = 4, MOST = 6 };

static struct {
    fmi3Instance instance;
    fmi3FMUState states[STATES];
    double time;
} slots[INSTANCES];
static const char *token, *resources;
static unsigned long long seed, messages, answers[5];

static unsigned below(unsigned n) {
    seed = seed * 6364136223846793005ull + 1442695040888963407ull;
    return (unsigned)(seed >> 33) % n;
}

static double number(void) {
    static const double odd[] = {0.0, -0.0, 1.0, -1.0, 1e-300, 1e308, -1e308};
    switch (below(8)) {
    case 0: return NAN;
    case 1: return below(2) ? INFINITY : -INFINITY;
    case 2: return odd[below(sizeof odd / sizeof *odd)];
    default: return (below(2001) - 1000.0) * 1e-4;
    }
}

static void heard(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message) {
    if (environment != slots || category == NULL || message == NULL || strchr(message, '\n') != NULL) {
        fprintf(stderr, "a message that is none, with status %d\n", (int)status);
        exit(3);
    }
    messages++;
}

/* An array of the host, on the heap so that what lies behind it is not ours; NULL now and then. */
static void *array(size_t n, size_t size) {
    void *block = below(40) == 0 ? NULL : malloc(n * size == 0 ? 1 : n * size);
    if (block != NULL)
        memset(block, 0, n * size);
    return block;
}

static fmi3ValueReference *references(size_t n) {
    fmi3ValueReference *vr = array(n, sizeof *vr);
    for (size_t i = 0; vr != NULL && i < n; i++)
        vr[i] = below(50) == 0 ? 0xffffffffu - below(2) : below(160);
    return vr;
}

static double *numbers(size_t n) {
    double *values = array(n, sizeof *values);
    for (size_t i = 0; values != NULL && i < n; i++)
        values[i] = number();
    return values;
}

static void judge(fmi3Status status, const char *name, unsigned long long before, bool real) {
    if ((int)status < 0 || status >= fmi3Fatal || (status == fmi3Error && real && messages == before)) {
        fprintf(stderr, "%s: status %d with %llu messages\n", name, (int)status, messages - before);
        exit(4);
    }
    answers[status]++;
}

static void make(int k) {
    const char *name = below(20) == 0 ? NULL : "one", *whose = below(20) == 0 ? "{another}" : token;
    if (slots[k].instance != NULL)
        return;
    slots[k].time = 0.0;
    if (below(3) == 0)
        slots[k].instance = fmi3InstantiateModelExchange(name, whose, NULL, false, below(2), slots, heard);
    else
        slots[k].instance = fmi3InstantiateCoSimulation(name, whose, below(10) ? resources : NULL, false, below(2),
                                                        below(2), below(2), NULL, 0, slots, heard, NULL);
    if (below(50) == 0 &&
        fmi3InstantiateScheduledExecution(name, whose, NULL, false, true, slots, heard, NULL, NULL, NULL) != NULL)
        exit(5);
}

static void end(int k) {
    for (int i = 0; i < STATES; i++)
        if (slots[k].instance != NULL && slots[k].states[i] != NULL)
            fmi3FreeFMUState(slots[k].instance, &slots[k].states[i]);
    fmi3FreeInstance(slots[k].instance);
    slots[k].instance = NULL;
}

/* How many values variables have, arrays one for each element; now and then another number. */
static size_t count_values(const fmi3ValueReference *vr, size_t n) {
    size_t sum = n;
    if (below(10) == 0)
        return below(8) == 0 ? below(200) : below(MOST);
#define ADD(name, first, size) sum += vr[i] == first ? size - 1 : 0;
    for (size_t i = 0; vr != NULL && i < n; i++) {
        MODEL_ARRAYS(ADD)
    }
#undef ADD
    return sum;
}

/* Where a host goes most of the time, so that the rest of the calls meets every mode. */
static fmi3Status proceed(fmi3Instance one, int k) {
    bool event, terminate, early;
    double last;
    fmi3Status status;
    switch (below(3)) {
    case 0: return fmi3EnterInitializationMode(one, false, 0.0, 0.0, false, 0.0);
    case 1: return fmi3ExitInitializationMode(one);
    default:
        status = fmi3DoStep(one, slots[k].time, 1e-3 * (1 + below(3)), true, &event, &terminate, &early, &last);
        if (status == fmi3OK)
            slots[k].time = last;
        return status;
    }
}

#define ACCESS(type)                                                                                                    \
    {                                                                                                                   \
        fmi3##type *typed = array(n_values, sizeof *typed);                                                             \
        for (size_t i = 0; typed != NULL && i < n_values; i++)                                                          \
            typed[i] = (fmi3##type)below(3);                                                                            \
        status = below(2) ? fmi3Get##type(one, vr, n, typed, n_values) : fmi3Set##type(one, vr, n, typed, n_values);    \
        free(typed);                                                                                                    \
        break;                                                                                                          \
    }

static fmi3Status access_variable(fmi3Instance one) {
    size_t n = below(MOST);
    fmi3ValueReference *vr = references(n);
    size_t n_values = count_values(vr, n);
    double *values = numbers(n_values);
    fmi3Status status = fmi3OK;
    switch (below(16)) {
    case 0: ACCESS(Float32)
    case 1: ACCESS(Int8)
    case 2: ACCESS(UInt8)
    case 3: ACCESS(Int16)
    case 4: ACCESS(UInt16)
    case 5: ACCESS(Int32)
    case 6: ACCESS(UInt32)
    case 7: ACCESS(Int64)
    case 8: ACCESS(UInt64)
    case 9: ACCESS(Boolean)
    case 10: {
        fmi3String *texts = array(n_values, sizeof *texts);
        for (size_t i = 0; texts != NULL && i < n_values; i++)
            texts[i] = below(4) == 0 ? NULL : "tcp://127.0.0.1:1";
        status = below(2) ? fmi3GetString(one, vr, n, texts, n_values) : fmi3SetString(one, vr, n, texts, n_values);
        free(texts);
        break;
    }
    case 11: {
        size_t *sizes = array(n_values, sizeof *sizes);
        fmi3Binary *blobs = array(n_values, sizeof *blobs);
        status = below(2) ? fmi3GetBinary(one, vr, n, sizes, blobs, n_values)
                          : fmi3SetBinary(one, vr, n, sizes, blobs, n_values);
        free(sizes);
        free(blobs);
        break;
    }
    case 12: {
        fmi3Clock *clocks = array(n, sizeof *clocks);
        status = below(2) ? fmi3GetClock(one, vr, n, clocks) : fmi3SetClock(one, vr, n, clocks);
        free(clocks);
        break;
    }
    case 13: status = fmi3GetFloat64(one, vr, n, values, n_values); break;
    default: status = fmi3SetFloat64(one, vr, n, values, n_values); break;
    }
    free(vr);
    free(values);
    return status;
}

static fmi3Status differentiate(fmi3Instance one) {
    size_t n = below(MOST), m = below(MOST);
    fmi3ValueReference *unknowns = references(n), *knowns = references(m);
    size_t of_unknowns = count_values(unknowns, n), of_knowns = count_values(knowns, m);
    double *of_first = numbers(of_unknowns), *of_second = numbers(of_knowns);
    fmi3Int32 *orders = array(n, sizeof *orders);
    fmi3Status status;
    for (size_t i = 0; orders != NULL && i < n; i++)
        orders[i] = (fmi3Int32)below(3);
    switch (below(3)) {
    case 0: status = fmi3GetDirectionalDerivative(one, unknowns, n, knowns, m, of_second, of_knowns, of_first, of_unknowns); break;
    case 1: status = fmi3GetAdjointDerivative(one, unknowns, n, knowns, m, of_first, of_unknowns, of_second, of_knowns); break;
    default: status = fmi3GetOutputDerivatives(one, unknowns, n, orders, of_first, of_unknowns); break;
    }
    free(unknowns);
    free(knowns);
    free(of_first);
    free(of_second);
    free(orders);
    return status;
}

static fmi3Status of_state(fmi3Instance one, int k) {
    fmi3FMUState *state = &slots[k].states[below(STATES)];
    size_t size = 0;
    fmi3Byte *bytes;
    fmi3Status status;
    switch (below(4)) {
    case 0: return fmi3GetFMUState(one, below(30) == 0 ? NULL : state);
    case 1: return fmi3FreeFMUState(one, below(30) == 0 ? NULL : state);
    case 2: return fmi3SetFMUState(one, *state);
    default:
        status = fmi3SerializedFMUStateSize(one, *state, &size);
        if (status != fmi3OK)
            return status;
        bytes = malloc(size);
        status = fmi3SerializeFMUState(one, *state, bytes, size - below(2));
        if (status == fmi3OK && below(3) == 0)
            bytes[below((unsigned)size)] ^= 1u << below(8);
        if (status == fmi3OK)
            status = fmi3DeserializeFMUState(one, bytes, size - (below(10) == 0), &slots[k].states[below(STATES)]);
        free(bytes);
        return status;
    }
}

static fmi3Status exchange(fmi3Instance one) {
    size_t n = below(12), count;
    double *values = numbers(n), last;
    bool flags[5];
    fmi3Status status;
    switch (below(14)) {
    case 0: status = fmi3SetTime(one, number()); break;
    case 1: status = fmi3SetContinuousStates(one, values, n); break;
    case 2: status = fmi3GetContinuousStates(one, values, n); break;
    case 3: status = fmi3GetContinuousStateDerivatives(one, values, n); break;
    case 4: status = fmi3GetNominalsOfContinuousStates(one, values, n); break;
    case 5: status = fmi3GetEventIndicators(one, values, n); break;
    case 6: status = fmi3GetNumberOfEventIndicators(one, below(9) ? &count : NULL); break;
    case 7: status = fmi3GetNumberOfContinuousStates(one, below(9) ? &count : NULL); break;
    case 8: status = fmi3EnterEventMode(one); break;
    case 9: status = fmi3EnterContinuousTimeMode(one); break;
    case 10: status = fmi3CompletedIntegratorStep(one, true, flags, below(9) ? flags + 1 : NULL); break;
    case 11: status = fmi3EnterStepMode(one); break;
    case 12: status = fmi3EvaluateDiscreteStates(one); break;
    default:
        status = fmi3UpdateDiscreteStates(one, flags, flags + 1, flags + 2, flags + 3, below(9) ? flags + 4 : NULL, &last);
    }
    free(values);
    return status;
}

static fmi3Status of_life(fmi3Instance one) {
    const fmi3String names[] = {"logStatusError", NULL};
    bool event, terminate, early;
    double last, step = number();
    if (step > 1.0 && step < INFINITY) /* as many samples as are allowed take Python some ten minutes */
        step = 1.0;
    switch (below(10)) {
    case 0: return fmi3Reset(one);
    case 1: return fmi3Terminate(one);
    case 2: return fmi3SetDebugLogging(one, below(2), below(3), below(2) ? names : NULL);
    case 3: return fmi3EnterInitializationMode(one, below(2), number(), number(), below(2), number());
    case 4: return fmi3EnterConfigurationMode(one);
    case 5: return fmi3ExitConfigurationMode(one);
    case 6: return fmi3ActivateModelPartition(one, below(9), number());
    case 7: return fmi3DoStep(one, number(), step, below(2), &event, &terminate, &early, below(9) ? &last : NULL);
    case 8: return fmi3GetNumberOfVariableDependencies(one, below(99), NULL);
    default: return fmi3GetVariableDependencies(one, below(99), NULL, NULL, NULL, NULL, 0);
    }
}

static fmi3Status of_clocks(fmi3Instance one) {
    size_t n = below(3);
    fmi3ValueReference *vr = references(n);
    double *values = numbers(n);
    fmi3UInt64 *counters = array(n, sizeof *counters), *resolutions = array(n, sizeof *resolutions);
    fmi3IntervalQualifier *qualifiers = array(n, sizeof *qualifiers);
    fmi3Status status;
    switch (below(8)) {
    case 0: status = fmi3GetIntervalDecimal(one, vr, n, values, qualifiers); break;
    case 1: status = fmi3GetIntervalFraction(one, vr, n, counters, resolutions, qualifiers); break;
    case 2: status = fmi3GetShiftDecimal(one, vr, n, values); break;
    case 3: status = fmi3GetShiftFraction(one, vr, n, counters, resolutions); break;
    case 4: status = fmi3SetIntervalDecimal(one, vr, n, values); break;
    case 5: status = fmi3SetIntervalFraction(one, vr, n, counters, resolutions); break;
    case 6: status = fmi3SetShiftDecimal(one, vr, n, values); break;
    default: status = fmi3SetShiftFraction(one, vr, n, counters, resolutions);
    }
    free(vr);
    free(values);
    free(counters);
    free(resolutions);
    free(qualifiers);
    return status;
}

static int calls(unsigned long count) {
    if (strcmp(fmi3GetVersion(), "3.0") != 0)
        return 6;
    for (unsigned long i = 0; i < count; i++) {
        int k = (int)below(INSTANCES);
        unsigned long long before = messages;
        fmi3Instance one = below(200) == 0 ? NULL : slots[k].instance;
        unsigned what = below(100);
        if (what < 3)
            make(k);
        else if (what == 3 && below(20) == 0)
            end(k);
        else if (what < 40)
            judge(proceed(one, k), "to proceed", before, one != NULL);
        else if (what < 65)
            judge(access_variable(one), "access to a variable", before, one != NULL);
        else if (what < 72)
            judge(differentiate(one), "derivatives", before, one != NULL);
        else if (what < 80)
            judge(of_state(one, k), "a state", before, one != NULL);
        else if (what < 94)
            judge(exchange(one), "model exchange", before, one != NULL);
        else if (what < 98)
            judge(of_life(one), "life", before, one != NULL);
        else
            judge(of_clocks(one), "clocks", before, one != NULL);
        if (below(400) == 0 && slots[k].instance != NULL) { /* a failed or ended instance would stay so */
            judge(fmi3Reset(slots[k].instance), "reset", messages, true);
            slots[k].time = 0.0;
        }
    }
    for (int k = 0; k < INSTANCES; k++)
        end(k);
    printf("%llu OK, %llu discarded, %llu errors, %llu messages\n", answers[fmi3OK], answers[fmi3Discard],
           answers[fmi3Error], messages);
    return answers[fmi3OK] > count / 10 && answers[fmi3Error] > count / 10 ? 0 : 7;
}

/* Many instances side by side: each makes the same steps, and none changes another. */
static int instances(unsigned long count) {
    fmi3Instance *all = calloc(count, sizeof *all);
    fmi3ValueReference *vr = malloc(100 * sizeof *vr);
    double first[100], mine[100], last = 0.0, time = 0.0;
    bool event, terminate, early;
    size_t n = 0;
    for (unsigned long i = 0; i < count; i++) {
        all[i] = fmi3InstantiateCoSimulation("one", token, resources, false, false, false, false, NULL, 0, slots, heard, NULL);
        if (all[i] == NULL || fmi3EnterInitializationMode(all[i], false, 0.0, 0.0, false, 0.0) != fmi3OK ||
            fmi3ExitInitializationMode(all[i]) != fmi3OK)
            return 8;
    }
    for (fmi3ValueReference r = 0; r < 100; r++) { /* those that can be read as numbers */
        vr[n] = r;
        n += fmi3GetFloat64(all[0], &r, 1, mine, 1) == fmi3OK;
    }
    for (int step = 0; step < 5; step++, time = last)
        for (unsigned long i = 0; i < count; i++) {
            if (fmi3DoStep(all[i], time, 0.01, true, &event, &terminate, &early, &last) != fmi3OK ||
                fmi3GetFloat64(all[i], vr, n, i == 0 ? first : mine, n) != fmi3OK)
                return 9;
            if (i > 0 && memcmp(first, mine, n * sizeof *first) != 0)
                return 10;
        }
    for (unsigned long i = 0; i < count; i++)
        fmi3FreeInstance(all[i]);
    free(all);
    free(vr);
    printf("%lu instances with %zu variables each\n", count, n);
    return 0;
}

int main(int argc, char *argv[]) {
    if (argc < 4)
        return 1;
    token = argv[2];
    bool many = strcmp(argv[1], "instances") == 0;
    resources = argc > 5 - many ? argv[5 - many] : "/nowhere";
    if (many)
        return instances(strtoul(argv[3], NULL, 10));
    seed = strtoull(argv[3], NULL, 10);
    return calls(strtoul(argv[4], NULL, 10));
}

/* An FMU that does what no FMU may do: one of the acts below, at the first step that begins at 1 s or later, or
 * wherever the act says. Until then it is the honest one of one state.
 */
#define _GNU_SOURCE
#include "honest.c" /* one_state.c, of which four functions are called honest_... */

#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <sys/resource.h>
#include <unistd.h>

static volatile double sink;
static volatile int late;

static void hang(void) {
    for (;;) sink += 1.0;
}

/* Hangs at no cost to the machine; the file that the environment names, if it does, is there from then on. */
static void rest(void) {
    const char *sign = getenv("PPY_TEST_RESTS");
    if (sign != NULL) fclose(fopen(sign, "w"));
    for (;;) pause();
}

static int recurse(int depth) {
    volatile char room[4096];
    room[0] = (char)depth;
    return recurse(depth + 1) + room[0];
}

static void take_memory(void) {
    for (;;) {
        char *block = malloc(1 << 24);
        if (block == NULL) abort();
        memset(block, 1, 1 << 24);
    }
}

static void deaf(void) {
    sigset_t all;
    sigfillset(&all);
    pthread_sigmask(SIG_BLOCK, &all, NULL);
    hang();
}

static void close_from(int first) {
    for (int i = first; i < 256; i++) close(i);
}

static void write_everywhere(void) {
    char text[64];
    memset(text, 'A', sizeof text);
    for (int i = 3; i < 64; i++) write(i, text, sizeof text);
}

static void leave_process(void) {
    if (fork() == 0)
        for (;;) pause();
}

static void allow_none(int what) {
    struct rlimit none = {0, 0};
    setrlimit(what, &none);
}

static fmi2Status order(fmi2Component c) {
    const fmi2CallbackFunctions *host = ((Instance *)c)->functions;
    host->logger(host->componentEnvironment, NULL, fmi2Error, NULL, "\033[2J\nand more");
    return fmi2Error;
}

static void print_much(void) {
    for (int i = 0; i < 200000; i++) puts("this is what a chatty model has to say at every step of its life");
}

static void damage_heap(void) {
    char *block = malloc(64);
    memset(block - 64, 255, 256);
    free(block);
    free(malloc(100));
    abort();
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String expected_guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
#ifdef AT_START
    AT_START;
#endif
    return honest_Instantiate(name, type, expected_guid, resources, functions, visible, logging);
}

void fmi2FreeInstance(fmi2Component c) {
#ifdef AT_END
    AT_END;
#endif
    honest_FreeInstance(c);
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
#ifdef AT_READING
    if (late) AT_READING;
#endif
    return honest_GetReal(c, vr, n, value);
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_state_set_before) {
    if (time >= 1.0 - 1e-9) {
        late = 1;
#ifdef AT_STEP
        AT_STEP;
#endif
    }
    return honest_DoStep(c, time, step, no_state_set_before);
}

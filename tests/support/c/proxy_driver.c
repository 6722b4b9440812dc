/* Drives the engine of a rig proxy by lines on standard input, one answer per line; for tests of the engine alone.
 *
 *     set NAME VALUE | text NAME VALUE | initialize TIME | advance TIME STEP | evaluate TIME | terminate | free | create
 *         -> ok or error, message, seconds it took, outputs; separated by tabs
 *     burst STEP COUNT -> ok or error, message, seconds of the longest of so many steps, outputs
 *     locale NAME -> ok or error
 *     frame HEX   -> what the engine reads in a frame
 */
#include "clock.h"
#include "messages.h"
#include "proxy.h"

#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static double memory[MEMORY_SIZE];
static TextValue texts[MODEL_TEXTS + 1];
static char line[4 * FRAME_MOST];
static Engine *engine;
static char chosen[64] = "C"; /* the locale while the engine is at work */

static void defaults(void) {
    for (int i = 0; i < MODEL_VARIABLES; i++)
        memory[i] = model_variables[i].start;
    for (int i = 0; i < MODEL_TEXTS; i++)
        snprintf(texts[i], TEXT_SIZE, "%s", model_texts[i].start);
}

static bool set(const char *name, const char *value) {
    for (int i = 0; i < MODEL_VARIABLES; i++)
        if (strcmp(model_variables[i].name, name) == 0) {
            memory[i] = strtod(value, NULL);
            return true;
        }
    return false;
}

static bool text(const char *name, const char *value) {
    for (int i = 0; i < MODEL_TEXTS; i++)
        if (strcmp(model_texts[i].name, name) == 0) {
            snprintf(texts[i], TEXT_SIZE, "%s", value);
            return true;
        }
    return false;
}

static bool call(const char *command, const char *first, const char *second, Message message) {
    if (strcmp(command, "create") == 0) {
        defaults();
        engine = engine_create(memory, (const TextValue *)texts, NULL, message);
        return engine != NULL;
    }
    if (strcmp(command, "set") == 0)
        return set(first, second);
    if (strcmp(command, "text") == 0)
        return text(first, second);
    if (strcmp(command, "initialize") == 0 || strcmp(command, "advance") == 0) {
        double time = strtod(first, NULL), step = strtod(second, NULL);
        bool done;
        setlocale(LC_ALL, chosen);
        memory[MEMORY_START_TIME] = time;
        done = *command == 'i' ? engine_initialize(engine, message) : engine_advance(engine, time, step, message);
        setlocale(LC_ALL, "C");
        return done;
    }
    if (strcmp(command, "evaluate") == 0)
        return engine_evaluate(engine, strtod(first, NULL), message);
    if (strcmp(command, "terminate") == 0)
        engine_terminate(engine);
    else if (strcmp(command, "free") == 0)
        engine_free(engine);
    else
        return false;
    return true;
}

static double burst(double step, int count, Message message, bool *done) {
    double longest = 0.0;
    *done = true;
    for (int k = 0; k < count && *done; k++) {
        double begin = clock_now();
        *done = engine_advance(engine, step * k, step, message);
        longest = fmax(longest, clock_now() - begin);
    }
    return longest;
}

static void print_numbers(const double *values, int count) {
    for (int i = 0; i < count; i++)
        printf("%s%a", i > 0 ? " " : "", values[i]);
}

/* An allocation of exactly the size, so that a read behind its end is seen. */
static void read_frame(const char *hexadecimal) {
    size_t size = strlen(hexadecimal) / 2;
    char *frame = malloc(size > 0 ? size : 1);
    Reply reply;
    memset(&reply, 0, sizeof reply);
    for (size_t i = 0; i < size; i++) {
        unsigned byte = 0;
        sscanf(hexadecimal + 2 * i, "%2x", &byte);
        frame[i] = (char)byte;
    }
    reply_read(frame, size, &reply);
    printf("%d\t%s\t%llu\t", (int)reply.kind, reply.session, (unsigned long long)reply.sequence);
    print_numbers((double[]){reply.sent, reply.clock, reply.period, reply.watchdog}, 4);
    printf("\t%d\t%d\t%s\t%d\t%s\t", reply.lockstep, reply.state, reply.reason, reply.refusals, reply.refusal);
    print_numbers(reply.values, MEASURED);
    printf("\t");
    print_numbers(reply.ages, MEASURED);
    free(frame);
}

int main(void) {
    while (fgets(line, sizeof line, stdin) != NULL) {
        Message message = "";
        char *command = strtok(line, " \n"), *first = strtok(NULL, " \n"), *second = strtok(NULL, "\n");
        double begin = clock_now();
        if (strcmp(command, "frame") == 0)
            read_frame(first == NULL ? "" : first);
        else if (strcmp(command, "locale") == 0)
            printf("%s", setlocale(LC_ALL, strncpy(chosen, first, sizeof chosen - 1)) != NULL ? "ok" : "error");
        else {
            bool done;
            double seconds;
            if (strcmp(command, "burst") == 0)
                seconds = burst(strtod(first, NULL), atoi(second), message, &done);
            else {
                done = call(command, first, second == NULL ? "" : second, message);
                seconds = clock_now() - begin;
            }
            printf("%s\t%s\t%a\t", done ? "ok" : "error", message, seconds);
            print_numbers(memory + FIRST_OUTPUT, MODEL_OUTPUTS);
        }
        printf("\n");
        fflush(stdout);
    }
    return 0;
}

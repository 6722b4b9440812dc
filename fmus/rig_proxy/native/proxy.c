/* The engine of the rig proxy, as engine.h has it: parameters and life cycle. */
#include "proxy.h"
#include "clock.h"
#include "endpoint.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const bool engine_interpolates = false;
static const bool engine_exchanges = false;
static const bool engine_differentiates = false;

static const double FAREWELL = 0.2; /* s, for the rig's answer to `disconnect` */

/* ---- parameters --------------------------------------------------------------------------------- */

double communication_timeout(const Engine *engine) { return engine->memory[engine->communication_timeout]; }
double max_age(const Engine *engine) { return engine->memory[engine->max_age]; }
double deadline(const Engine *engine) { return engine->memory[engine->deadline]; }

static bool check_time(const Engine *engine, int parameter, Message message) {
    double value = engine->memory[parameter];
    if (isfinite(value) && value > 0.0)
        return true;
    snprintf(message, MESSAGE_SIZE, "parameter '%s' = %.10g s: must be greater than 0",
             model_variables[parameter].name, value);
    return false;
}

static bool check_parameters(Engine *engine, Message message) {
    const char *stale = engine->texts[engine->on_stale];
    if (strcmp(stale, "hold") != 0 && strcmp(stale, "fail") != 0) {
        snprintf(message, MESSAGE_SIZE, "parameter 'on_stale' = '%s': must be hold or fail", stale);
        return false;
    }
    if (!check_time(engine, engine->communication_timeout, message) || !check_time(engine, engine->max_age, message) ||
        !check_time(engine, engine->deadline, message))
        return false;
    if (deadline(engine) > communication_timeout(engine)) {
        snprintf(message, MESSAGE_SIZE, "parameter 'deadline' = %.10g s is longer than communication_timeout, %.10g s",
                 deadline(engine), communication_timeout(engine));
        return false;
    }
    if (engine->texts[engine->credentials][0] != '\0') {
        snprintf(message, MESSAGE_SIZE,
                 "parameter 'credentials': this build has no encryption; leave it empty and give the key file to "
                 "`ppy rig bridge`, which carries the proxy on encrypted");
        return false;
    }
    engine->link.endpoint = engine->texts[engine->endpoint];
    return endpoint_read(engine->link.endpoint, &engine->link.address, message);
}

/* ---- life cycle --------------------------------------------------------------------------------- */

Engine *engine_create(double *memory, const TextValue *texts, const char *resources, Message message) {
    Engine *engine = calloc(1, sizeof *engine);
    (void)resources;
    if (engine == NULL) {
        snprintf(message, MESSAGE_SIZE, "out of memory");
        return NULL;
    }
    if (!sockets_start()) {
        snprintf(message, MESSAGE_SIZE, "the system gives no sockets");
        free(engine);
        return NULL;
    }
    engine->memory = memory;
    engine->texts = texts;
    engine->link.wire.socket = NO_SOCKET;
    link_forget(&engine->link);
    if (!link_name(&engine->link)) {
        snprintf(message, MESSAGE_SIZE, "the system gives no random numbers");
        engine_free(engine);
        return NULL;
    }
    if (!find_variables(engine, message)) {
        engine_free(engine);
        return NULL;
    }
    return engine;
}

/* Ends the session in order, and waits no longer than that for the rig to say so. */
static void end_within(Engine *engine, double seconds) {
    link_close(&engine->link, fmax(0.0, fmin(seconds, FAREWELL)));
    if (engine->running)
        clock_coarse();
    engine->running = false;
}

void engine_terminate(Engine *engine) { end_within(engine, FAREWELL); }

void engine_free(Engine *engine) {
    engine_terminate(engine);
    sockets_stop();
    free(engine);
}

/* A run begins: nothing is left of the one before. */
static void forget(Engine *engine) {
    link_forget(&engine->link);
    engine->missed = 0.0;
}

static bool connect_to_rig(Engine *engine, Message message) {
    double timeout = communication_timeout(engine);
    Link *link = &engine->link;
    if (!link_open(link, engine->start_time, clock_now() + timeout, message)) {
        if (message[0] == '\0')
            snprintf(message, MESSAGE_SIZE,
                     "no answer within %.10g s from %s; is `ppy rig serve` running, or do the keys not match?", timeout,
                     link->endpoint);
        return false;
    }
    for (int i = 0; i < MEASURED; i++)
        if (!isfinite(link->session.values[i])) {
            snprintf(message, MESSAGE_SIZE, "the rig has no value of %s", model_variables[link->measured[i]].name);
            return false;
        }
    return true;
}

bool engine_initialize(Engine *engine, Message message) {
    engine_terminate(engine);
    forget(engine);
    if (!check_parameters(engine, message))
        return false;
    clock_fine();
    engine->running = true;
    engine->start_time = engine->memory[MEMORY_START_TIME];
    if (connect_to_rig(engine, message)) {
        engine->origin = NAN;
        if (publish(engine, message))
            return true;
    }
    engine_terminate(engine);
    return false;
}

bool engine_advance(Engine *engine, double time, double step, Message message) {
    double last = clock_now() + communication_timeout(engine);
    message[0] = '\0';
    if (!engine->running) {
        snprintf(message, MESSAGE_SIZE, "there is no link to the rig");
        return false;
    }
    for (int i = FIRST_INPUT; i < FIRST_STATE; i++)
        if (!isfinite(engine->memory[i])) {
            snprintf(message, MESSAGE_SIZE, "'%s' is not a finite number", model_variables[i].name);
            engine_terminate(engine);
            return false;
        }
    if (make_step(engine, time, step, message))
        return true;
    end_within(engine, last - clock_now()); /* a rig that nobody steers any more is to be at zero */
    return false;
}

/* ---- laws, of which there are none: outputs are what was measured, and how old it is now ---------------- */

bool engine_evaluate(Engine *engine, double time, Message message) {
    (void)time;
    (void)message;
    write_outputs(engine);
    return true;
}

bool engine_differentiate(Engine *engine, double time, Message message) {
    (void)engine;
    (void)time;
    (void)message;
    return true;
}

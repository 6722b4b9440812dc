/* What the files of the front-end share: the instance, its modes and the reporting of errors. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include "engine.h"
#include "host.h"

/* Modes of the state machines of FMI, of co-simulation and of model exchange; bits, so that a set is a sum. */
enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    STEP_COMPLETE = 4,
    FAILED = 8,
    TERMINATED = 16,
    EVENT = 32,
    CONTINUOUS = 64,
    BEFORE_START = INSTANTIATED | INITIALIZATION,
    RUNNING = STEP_COMPLETE | EVENT | CONTINUOUS,
    READABLE = INITIALIZATION | RUNNING | FAILED | TERMINATED,
    ANY_MODE = INSTANTIATED | READABLE
};

/* All that changes during the life of an instance: copying it saves or restores the FMU state.
   Only doubles, so that it has no padding and equal states are equal bytes. */
typedef struct {
    double mode;
    double outputs_outdated;     /* 1.0 when they must be evaluated before they are read */
    double derivatives_outdated; /* the same; few hosts ever read them */
    double time;
    double stop_time; /* +infinity when the host defined none */
    double sides[MODEL_INDICATORS + 1]; /* signs of the event indicators at the latest event; 0.0 where not known */
    double changes[MODEL_INPUTS + 1]; /* of discrete inputs at the next event, which were set before it */
    double memory[MEMORY_SIZE];
} State;

/* Who integrates the states: the instance, in co-simulation, or the host, in model exchange. */
typedef enum { INSTANCE_INTEGRATES, HOST_INTEGRATES } Integrator;

typedef struct {
    State now;
    State before; /* the state to return to when a step fails */
    Engine *engine;
    TextValue texts[MODEL_TEXTS + 1];
    Integrator integrator;
    char *name;
    Host host;
    bool logging;
    bool warned; /* that a discrete input was set in continuous-time mode */
} Instance;

/* Whether the host enters event mode: in model exchange it always does. */
static inline bool handles_events(const Instance *instance) {
    return instance->integrator == HOST_INTEGRATES || host_handles_events(&instance->host);
}

/* Gives one line to the logger of the host, if there is one, in a form that every logger can take. */
static void deliver(const Host *host, const char *name, Status status, const char *text);

/* Reports one line through the logger of the host and returns `status`. Warnings need logging to be on. */
static Status report(const Instance *instance, Status status, const char *format, ...);

/* Whether `function` may be called now; reports it if not. False for a NULL instance. */
static bool allowed(const Instance *instance, int modes, const char *function);

/* Declares outputs and derivatives outdated, and lets states follow their start parameters before the simulation starts. */
static void touch(Instance *instance, bool parameters);

/* Puts the instance back to `before` and, for good, into the mode FAILED. */
static Status fail(Instance *instance);

#endif

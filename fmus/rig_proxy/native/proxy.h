/* The engine of the rig proxy: no laws, but a rig at the other end of a wire. */
#ifndef PROXY_H
#define PROXY_H

#include "link.h"

struct Engine {
    double *memory;
    const TextValue *texts;
    int endpoint, credentials, on_stale;                                   /* indices of texts, */
    int communication_timeout, max_age, deadline;                          /* of parameters, */
    int ages[MEASURED + 1], round_trip_time, missed_deadlines, link_state; /* of outputs */

    Link link;
    bool running;      /* from initialization to termination */
    double origin;     /* our clock at the start time of the simulation */
    double start_time; /* s */
    double missed;     /* steps without an answer by their deadline */
};

/* Finds the variables by name (variables.c). False with a message if one is missing. */
static bool find_variables(Engine *engine, Message message);

/* Commands the rig for a step and waits for its end (pace.c). False with a message if the simulation cannot go on. */
static bool make_step(Engine *engine, double time, double step, Message message);

/* Writes values, ages and the state of the link, as they are now, to the outputs (outputs.c). */
static void write_outputs(Engine *engine);

/* The same at the end of a step. False with a message if the values may not be used, or true with one that is a
   warning. */
static bool publish(Engine *engine, Message message);

/* Values of the parameters, in s. */
static double communication_timeout(const Engine *engine);
static double max_age(const Engine *engine);
static double deadline(const Engine *engine);

#endif

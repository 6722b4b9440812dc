/* What is the same for every model: the types of its tables and laws, and what an engine does.
 *
 * The sizes, the tables and the memory of the model that is compiled are in engine.h, which has this file, too.
 */
#ifndef CONTRACT_H
#define CONTRACT_H

#include <math.h> /* INFINITY in the tables */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* ---- model ------------------------------------------------------------------------------------- */

typedef enum { ROLE_PARAMETER, ROLE_INPUT, ROLE_STATE, ROLE_DISCRETE, ROLE_OUTPUT, ROLE_DERIVATIVE } Role;
typedef enum { TYPE_REAL, TYPE_INTEGER, TYPE_BOOLEAN } Type;

typedef struct {
    const char *name;
    const char *unit; /* "1" where there is none */
    Role role;
    Type type;
    double start;            /* used for parameters and inputs; states and discretes start at a parameter */
    double minimum, maximum; /* -INFINITY, INFINITY where open; both ends are allowed values */
    double nominal;          /* > 0, in the unit of the variable */
} Variable;

typedef struct {
    double period;        /* s, used when period_parameter is negative */
    int period_parameter; /* index of the parameter that holds the period, or -1 */
} Group;

/* A parameter that is a text. */
typedef struct {
    const char *name, *start;
} Text;

/* CasADi's calling convention; `mem` is unused. */
typedef int Law(const double **arg, double **res, long long *iw, double *w, int mem);

/* ---- engine ------------------------------------------------------------------------------------ */

enum { MESSAGE_SIZE = 1024 };
typedef char Message[MESSAGE_SIZE]; /* one line, filled in by whoever returns NULL or false */

typedef struct Engine Engine;

/* An engine also defines the constants `static const bool engine_interpolates, engine_differentiates, engine_exchanges`:
   whether inputs may have slopes, whether engine_tangent works, and whether it has the functions of model exchange. */

enum { TEXT_SIZE = 512 }; /* with the terminating zero */
typedef char TextValue[TEXT_SIZE];

/* `memory` and `texts` outlive the engine. `resources` is the resource location as the host gave it, or NULL. */
static Engine *engine_create(double *memory, const TextValue *texts, const char *resources, Message message);
static void engine_free(Engine *engine);

/* The simulation has ended, or begins anew; for engines that hold something outside of the memory. */
static void engine_terminate(Engine *engine);

/* Called at the end of initialization: parameters are in range, states and discretes at their start values. */
static bool engine_initialize(Engine *engine, Message message);

/* Outputs, or derivatives, at `time` from all other variables. */
static bool engine_evaluate(Engine *engine, double time, Message message);
static bool engine_differentiate(Engine *engine, double time, Message message);

/* States and discretes from `time` to `time + step`; outputs and derivatives need not be up to date after it. A message
   beside success is a warning. */
static bool engine_advance(Engine *engine, double time, double step, Message message);

/* `seed` is a direction [parameters | inputs | states | discretes], `result` takes [derivatives | outputs]. */
static bool engine_tangent(Engine *engine, double time, const double *seed, double *result, Message message);

/* ---- common ------------------------------------------------------------------------------------ */

/* FNV-1a; start with HASH_START, or with the hash of what came before. */
#define HASH_START UINT64_C(14695981039346656037)
static inline uint64_t hash(uint64_t value, const void *data, size_t size) {
    const unsigned char *bytes = data;
    for (size_t i = 0; i < size; i++)
        value = (value ^ bytes[i]) * UINT64_C(1099511628211);
    return value;
}

#endif

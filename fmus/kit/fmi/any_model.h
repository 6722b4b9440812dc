/* What models have in common: the types of their tables and laws, and a model as the native engine takes it. */
#ifndef ANY_MODEL_H
#define ANY_MODEL_H

#include <stdbool.h>
#include <stddef.h>

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
    bool tunable;            /* whether a host may move the parameter during a simulation */
} Variable;

typedef struct {
    double period;        /* s, used when period_parameter is negative */
    int period_parameter; /* index of the parameter that holds the period, or -1 */
    int shift_parameters[2]; /* indices of parameters whose sum is the time of the first sample after the start, or -1 */
} Group;

/* A parameter that is a text. */
typedef struct {
    const char *name, *start;
} Text;

/* CasADi's calling convention; `mem` is unused. */
typedef int Law(const double **arg, double **res, long long *iw, double *w, int mem);

enum { MESSAGE_SIZE = 1024 };
typedef char Message[MESSAGE_SIZE]; /* one line, filled in by whoever returns NULL or false */

typedef struct Engine Engine;

/* One model. The native engine is compiled for one, as in an FMU, or for any, which it is given then. */
typedef struct {
    /* how many there are */
    int parameters, inputs, states, discretes, outputs, groups;
    /* where they begin in the memory of an instance, and what the engine remembers there (engine.h) */
    int first_parameter, first_input, first_state, first_discrete, first_output, first_derivative;
    int hint, start_time, tolerance, counters, slopes, memory_size;
    /* tables, see tables.h in engine.h */
    const Variable *variable;
    const int *start_of;
    const Group *group;
    /* laws, and the largest work arrays that they need */
    Law *rates_law, *outputs_law, *const *update_laws;
    int sz_arg, sz_res, sz_iw, sz_w;
} Model;

#endif

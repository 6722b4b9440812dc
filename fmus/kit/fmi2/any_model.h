/* A model as the native engine takes it: sizes, tables and laws, of the one model that an FMU is compiled for, or of any
   that an engine for records is given. */
#ifndef ANY_MODEL_H
#define ANY_MODEL_H

#include "contract.h"

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

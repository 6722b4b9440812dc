/* The model that is compiled here, as the native engine takes one. */
#ifndef THIS_MODEL_H
#define THIS_MODEL_H

#include "any_model.h"
#include "engine.h"

static Law rates, outputs;
#define DECLARE_UPDATE(name) static Law name;
LAWS_UPDATES(DECLARE_UPDATE)
#undef DECLARE_UPDATE

#define UPDATE_ADDRESS(name) name,
static Law *const updates[] = {LAWS_UPDATES(UPDATE_ADDRESS) NULL};
#undef UPDATE_ADDRESS

static const Model this_model = {
    .parameters = MODEL_PARAMETERS,
    .inputs = MODEL_INPUTS,
    .states = MODEL_STATES,
    .discretes = MODEL_DISCRETES,
    .outputs = MODEL_OUTPUTS,
    .groups = MODEL_GROUPS,
    .first_parameter = FIRST_PARAMETER,
    .first_input = FIRST_INPUT,
    .first_state = FIRST_STATE,
    .first_discrete = FIRST_DISCRETE,
    .first_output = FIRST_OUTPUT,
    .first_derivative = FIRST_DERIVATIVE,
    .hint = MEMORY_HINT,
    .start_time = MEMORY_START_TIME,
    .tolerance = MEMORY_TOLERANCE,
    .counters = MEMORY_COUNTERS,
    .slopes = MEMORY_SLOPES,
    .memory_size = MEMORY_SIZE,
    .variable = model_variables,
    .start_of = model_start_of,
    .group = model_groups,
    .rates_law = rates,
    .outputs_law = outputs,
    .update_laws = updates,
    .sz_arg = LAWS_SZ_ARG,
    .sz_res = LAWS_SZ_RES,
    .sz_iw = LAWS_SZ_IW,
    .sz_w = LAWS_SZ_W,
};

static inline const Model *model_of(const Engine *engine) {
    (void)engine;
    return &this_model;
}

#endif

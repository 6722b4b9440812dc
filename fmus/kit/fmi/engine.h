/* The contract between the generated model, the FMI front-end and the engines.
 *
 * An FMU is compiled from three parts:
 *     front-end   instance.c evaluate.c lifecycle.c access.c snapshot.c step.c      (the same in every FMU)
 *     engine      native.c integrate.c hosted.c,
 *                 or python.c library.c interpreter.c resources.c,
 *                 or packed.c (with native.c and fmu_member.c in it),   or a component's own
 *     model       model.h tables.h, and laws.c with the native engine   (generated)
 *
 * any_model.h has what does not hang on the model. With it the native engine also runs records without FMI (record.c).
 *
 * All of it is one translation unit, and all but the functions of FMI is static: FMUs compiled from source, each with an
 * FMI2_FUNCTION_PREFIX of its own, can be linked into one program. The engine comes first in the unit.
 *
 * What the generator writes
 * -------------------------
 * model.h, sizes known at compile time (macros; laws sizes only with the native engine):
 *     MODEL_PARAMETERS MODEL_INPUTS MODEL_STATES MODEL_DISCRETES MODEL_OUTPUTS MODEL_GROUPS MODEL_TEXTS
 *     LAWS_SZ_ARG LAWS_SZ_RES LAWS_SZ_IW LAWS_SZ_W      maxima over all functions of laws.c
 *     MODEL_INDICATORS     event indicators, none but with the native engine
 *     MODEL_ARRAYS(X)      expands to  X("name", first value reference, number of elements) ...  for the arrays of FMI 3.0
 *     LAWS_UPDATES(X)      expands to  X(update_0) X(update_1) ...  and to nothing without groups
 * tables.h, read below, static constants:
 *     char model_name[], model_guid[]
 *     double model_tolerance             relative, e.g. 1e-6
 *     Variable model_variables[]         index = value reference, MODEL_VARIABLES of them
 *     int model_start_of[]               index of the start parameter of every state, then every discrete
 *     Group model_groups[]               MODEL_GROUPS of them
 *     Text model_texts[]                 MODEL_TEXTS of them
 *     bool model_restorable              whether a copy of the memory is all there is to an instance
 *     An array without elements gets one unused element, for C has no empty arrays.
 * laws.c, from CasADi, with the signature `Law` of any_model.h and the inputs
 *     time (1), parameters, inputs, states, discretes
 *     rates    -> the derivatives of the states
 *     outputs  -> the outputs
 *     update_k -> all discretes after the update of group k; those outside the group unchanged
 *     tangent  has five more inputs, a direction of time, parameters, inputs, states and discretes,
 *              -> the directional derivatives of the rates and of the outputs
 *     indicators -> what changes its sign where rates or outputs switch
 *     Every result is dense (casadi.densify): a sparse one would put its values in the wrong places.
 *     Before anything else it says `#define CASADI_SYMBOL_EXPORT static inline`, for it has functions that nobody calls.
 *
 * Memory of an instance: one block of doubles
 * -------------------------------------------
 * First the variables, the value reference being the index; booleans are 0.0 or 1.0, integers integral:
 *     [parameters | inputs | states | discretes | outputs | derivatives]
 * then what the engine has to remember, so that a copy of the block is a copy of the instance:
 *     hint                 internal step to try next; +infinity tries the whole communication step
 *     start time           sample k of a group falls on start time + shift + k * period
 *     tolerance            relative tolerance of the integration
 *     parameters changed   the front-end sets 1.0 when anything a parameter determines may have changed
 *                          (parameter set, reset, state restored); the engine may clear it
 *     counters             for each group the k of its next sample
 *     slopes               for each input its time derivative over the next step (native engine)
 *     members              MODEL_MEMBERS numbers, of the engine of a packed system (packed.c)
 *
 * Texts are parameters too, but stand beside that block; text i has the value reference MODEL_VARIABLES + i.
 */
#ifndef ENGINE_H
#define ENGINE_H

#include <math.h> /* INFINITY in the tables */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "any_model.h"
#include "model.h"

#ifndef MODEL_MEMBERS /* defined in model.h of a packed system */
#define MODEL_MEMBERS 0
#endif
#ifndef MODEL_ARRAYS /* defined in model.h of a component with arrays */
#define MODEL_ARRAYS(X)
#endif

enum {
    FIRST_PARAMETER = 0,
    FIRST_INPUT = FIRST_PARAMETER + MODEL_PARAMETERS,
    FIRST_STATE = FIRST_INPUT + MODEL_INPUTS,
    FIRST_DISCRETE = FIRST_STATE + MODEL_STATES,
    FIRST_OUTPUT = FIRST_DISCRETE + MODEL_DISCRETES,
    FIRST_DERIVATIVE = FIRST_OUTPUT + MODEL_OUTPUTS,
    MODEL_VARIABLES = FIRST_DERIVATIVE + MODEL_STATES,
    MEMORY_HINT = MODEL_VARIABLES,
    MEMORY_START_TIME,
    MEMORY_TOLERANCE,
    MEMORY_PARAMETERS_CHANGED,
    MEMORY_COUNTERS,
    MEMORY_SLOPES = MEMORY_COUNTERS + MODEL_GROUPS,
    MEMORY_MEMBERS = MEMORY_SLOPES + MODEL_INPUTS,
    MEMORY_SIZE = MEMORY_MEMBERS + MODEL_MEMBERS
};

#include "tables.h"

/* ---- engine ------------------------------------------------------------------------------------ */

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
   beside success is a warning. A step of 0 s makes the updates that are due; without groups nobody asks for one. */
static bool engine_advance(Engine *engine, double time, double step, Message message);

/* `seed` is a direction [parameters | inputs | states | discretes] and, at MODEL_VARIABLES, of the time; `result` takes
   [derivatives | outputs]. */
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

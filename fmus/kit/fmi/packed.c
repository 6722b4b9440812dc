/* The engine of a packed system: each member by the native engine or, one without laws, by its own library
 * (fmu_member.c), and the exchange of values between them.
 *
 * What a master does at a communication point, and in the step to the next, is a list of operations in the master's order.
 * The generated members.h has these lists, and the tables and laws of the members. All that changes is in the memory of
 * the instance, from MEMORY_MEMBERS on:
 *     started     0.0 until the initialization ends; until then members follow their parameters
 *     exchanged   1.0 if no member has stepped since the latest exchange
 *     inputs      those of that exchange
 *     members     the memory of each, laid out as its Model says
 *     read        the values of outputs that the others receive, as they were when they were read
 */
#include "engine.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The engine of a member is that of an FMU of its own, under another name. */
typedef struct Member Member;
#define Engine Member
#define engine_evaluate member_evaluate
#define engine_advance member_advance
#include "native.c"

#include "any_model.c"
#include "integrate.c"

#include "fmu_member.c"
#include "resources.c"
#undef Engine
#undef engine_evaluate
#undef engine_advance

typedef enum {
    END,
    COPY,     /* target = factor * source + offset */
    MAP,      /* target = offset if source = factor */
    EVALUATE, /* the outputs of a member */
    STEP,     /* of a member */
    SOLVE     /* an algebraic loop */
} Action;

typedef struct {
    Action action;
    int which;          /* member or loop */
    int target, source; /* places in memory */
    double factor, offset;
} Operation;

/* Inputs of members that depend on themselves: each receives its value by a COPY of `links` after all of `around`. */
typedef struct {
    const char *name;
    int size;
    const Operation *links, *around;
    const double *scale; /* nominal values of the inputs */
} Loop;

typedef struct {
    const char *name;
    const Model *model;
    int memory; /* where its memory begins */
    double tolerance;
    const FmuTable *fmu; /* NULL of one with laws */
} Part;

/* A model from the names and numbers of its tables and laws; its memory is laid out as in engine.h. */
#define MEMBER_MODEL(laws, p, i, s, d, o, g, arg, res, iw, w)                                                           \
    static const Model laws##_model = {                                                                                \
        .parameters = p, .inputs = i, .states = s, .discretes = d, .outputs = o, .groups = g,                          \
        .first_parameter = 0, .first_input = p, .first_state = p + i, .first_discrete = p + i + s,                     \
        .first_output = p + i + s + d, .first_derivative = p + i + s + d + o,                                          \
        .hint = p + i + 2 * s + d + o, .start_time = p + i + 2 * s + d + o + 1,                                        \
        .tolerance = p + i + 2 * s + d + o + 2, .counters = p + i + 2 * s + d + o + 4,                                 \
        .slopes = p + i + 2 * s + d + o + 4 + g, .memory_size = p + 2 * i + 2 * s + d + o + 4 + g,                     \
        .variable = laws##_variables, .start_of = laws##_start_of, .group = laws##_groups,                             \
        .rates_law = laws##_rates, .outputs_law = laws##_outputs, .update_laws = laws##_updates,                       \
        .sz_arg = arg, .sz_res = res, .sz_iw = iw, .sz_w = w}

enum { STARTED = MEMORY_MEMBERS, EXCHANGED, EXCHANGED_INPUTS, MEMBERS_BEGIN = EXCHANGED_INPUTS + MODEL_INPUTS };

#include "members.h"

struct Engine {
    double *memory;
    Member members[MEMBERS];
    FmuMember fmus[MEMBERS]; /* of members without laws */
};

static const bool engine_interpolates = false;
static const bool engine_exchanges = false;
static const bool engine_differentiates = false;

static bool perform(Engine *engine, const Operation *operation, double time, double end, Message message);

static bool name_part(const char *name, Message message) {
    Message text;
    snprintf(text, sizeof text, "%s", message);
    snprintf(message, MESSAGE_SIZE, "%.400s: %.600s", name, text);
    return false;
}

/* Whether variables of a member, from the first to before the end, are finite. */
static bool range_finite(const Member *member, int first, int end, double time, Message message) {
    for (int i = first; i < end; i++)
        if (!isfinite(member->memory[i])) {
            snprintf(message, MESSAGE_SIZE, "'%s' is not a finite number at t = %.10g s", member->model->variable[i].name,
                     time);
            return false;
        }
    return true;
}

/* ---- algebraic loops ---------------------------------------------------------------------------- */

enum { MOST_ITERATIONS = 50, MOST_HALVINGS = 20 };
static const double accuracy = 1e-13;    /* of a loop, relative to nominal + |value| */
static const double acceptable = 1000.0; /* times that, where rounding permits no more */

/* r = g(x) - x, in nominal values. */
static bool residual(Engine *engine, const Loop *loop, double time, const double *x, double *r, Message message) {
    double *memory = engine->memory;
    for (int i = 0; i < loop->size; i++)
        memory[loop->links[i].target] = x[i] * loop->scale[i];
    if (!perform(engine, loop->around, time, time, message))
        return false;
    for (int i = 0; i < loop->size; i++) {
        const Operation *link = &loop->links[i];
        r[i] = (link->factor * memory[link->source] + link->offset) / loop->scale[i] - x[i];
    }
    return true;
}

static double error_of(const Loop *loop, const double *x, const double *r) {
    double worst = 0.0;
    for (int i = 0; i < loop->size; i++) {
        double error = fabs(r[i]) / (accuracy * (1.0 + fabs(x[i])));
        worst = isfinite(error) ? fmax(worst, error) : INFINITY;
    }
    return worst;
}

/* Solves a * x = b by elimination with row pivots; both are overwritten, b by x. False if a is singular. */
static bool eliminate(int n, double *a, double *b) {
    for (int k = 0; k < n; k++) {
        int pivot = k;
        for (int i = k + 1; i < n; i++)
            pivot = fabs(a[i * n + k]) > fabs(a[pivot * n + k]) ? i : pivot;
        if (!(fabs(a[pivot * n + k]) > 0.0))
            return false;
        for (int j = 0; j < n; j++) {
            double kept = a[k * n + j];
            a[k * n + j] = a[pivot * n + j];
            a[pivot * n + j] = kept;
        }
        double kept = b[k];
        b[k] = b[pivot];
        b[pivot] = kept;
        for (int i = k + 1; i < n; i++) {
            double factor = a[i * n + k] / a[k * n + k];
            for (int j = k; j < n; j++)
                a[i * n + j] -= factor * a[k * n + j];
            b[i] -= factor * b[k];
        }
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++)
            b[i] -= a[i * n + j] * b[j];
        b[i] /= a[i * n + i];
    }
    return true;
}

/* Newton's step from x, where the residual is r, into `step`; the Jacobian is measured by differences. */
static bool newton(Engine *engine, const Loop *loop, double time, double *x, const double *r, double *step,
                   Message message) {
    int n = loop->size;
    double jacobian[LARGEST_LOOP * LARGEST_LOOP], moved[LARGEST_LOOP];
    for (int j = 0; j < n; j++) {
        double kept = x[j];
        x[j] = kept + 1e-6 * (1.0 + fabs(kept));
        if (!residual(engine, loop, time, x, moved, message))
            return false;
        for (int i = 0; i < n; i++)
            jacobian[i * n + j] = (moved[i] - r[i]) / (x[j] - kept);
        x[j] = kept;
        step[j] = -r[j];
    }
    snprintf(message, MESSAGE_SIZE, "%s: its Jacobian is singular at %.10g s", loop->name, time);
    return eliminate(n, jacobian, step);
}

/* The inputs and outputs of a loop at their solution, from those of the last: a step is halved until the error falls. */
static bool solve(Engine *engine, const Loop *loop, double time, Message message) {
    double x[LARGEST_LOOP], r[LARGEST_LOOP], step[LARGEST_LOOP], trial[LARGEST_LOOP], error;
    for (int i = 0; i < loop->size; i++)
        x[i] = engine->memory[loop->links[i].target] / loop->scale[i];
    if (!residual(engine, loop, time, x, r, message))
        return false;
    error = error_of(loop, x, r);
    for (int iteration = 0; error > 1.0 && iteration < MOST_ITERATIONS; iteration++) {
        double part = 1.0, after = INFINITY;
        if (!newton(engine, loop, time, x, r, step, message))
            return false;
        for (int halving = 0; halving < MOST_HALVINGS && !(after < error); halving++, part *= 0.5) {
            for (int i = 0; i < loop->size; i++)
                trial[i] = x[i] + part * step[i];
            if (!residual(engine, loop, time, trial, r, message))
                return false;
            after = error_of(loop, trial, r);
        }
        if (!(after < error))
            break;
        memcpy(x, trial, sizeof x);
        error = after;
    }
    if (!(error <= acceptable)) {
        snprintf(message, MESSAGE_SIZE, "%s: no solution found at %.10g s", loop->name, time);
        return false;
    }
    return residual(engine, loop, time, x, r, message);
}

/* ---- operations --------------------------------------------------------------------------------- */

static bool evaluate(Engine *engine, int k, double time, Message message) {
    Member *member = &engine->members[k];
    const Model *model = member->model;
    bool made = parts[k].fmu ? fmu_evaluate(&engine->fmus[k], message) : member_evaluate(member, time, message);
    return made && range_finite(member, model->first_output, model->first_derivative, time, message);
}

static bool step(Engine *engine, int k, double time, double end, Message message) {
    Member *member = &engine->members[k];
    const Model *model = member->model;
    bool made;
    if (parts[k].fmu)
        return fmu_step(&engine->fmus[k], time, end - time, message);
    made = member_advance(member, time, end - time, message);
    member->most = member->budget; /* for the rest of the host's step */
    return made && range_finite(member, model->first_input, model->first_output, end, message);
}

bool perform(Engine *engine, const Operation *operation, double time, double end, Message message) {
    double *memory = engine->memory;
    for (const Operation *o = operation; o->action != END; o++) {
        bool done = true;
        switch (o->action) {
        case COPY: memory[o->target] = o->factor * memory[o->source] + o->offset; break;
        case MAP: memory[o->target] = memory[o->source] == o->factor ? o->offset : memory[o->target]; break;
        case EVALUATE: done = evaluate(engine, o->which, end, message); break;
        case STEP: done = step(engine, o->which, time, end, message); break;
        case SOLVE:
            if (!solve(engine, &loops[o->which], end, message))
                return false;
            break;
        case END: break;
        }
        if (!done)
            return name_part(parts[o->which].name, message);
    }
    return true;
}

/* Members at their start, with the parameters of the system. */
static bool start(Engine *engine, double time, Message message) {
    double *memory = engine->memory;
    for (int k = 0; k < MEMBERS; k++) {
        const Model *model = parts[k].model;
        double *own = memory + parts[k].memory;
        if (engine->fmus[k].instance != NULL)
            continue; /* it begins anew only if its parameters are others */
        memset(own, 0, (size_t)model->memory_size * sizeof *own);
        for (int i = 0; i < model->first_derivative; i++)
            own[i] = model->variable[i].start;
        own[model->hint] = INFINITY;
        own[model->start_time] = memory[MEMORY_START_TIME];
        own[model->tolerance] = fmin(parts[k].tolerance, memory[MEMORY_TOLERANCE]);
    }
    if (!perform(engine, parameters_of_members, time, time, message))
        return false;
    for (int k = 0; k < MEMBERS; k++) {
        const Model *model = parts[k].model;
        double *own = memory + parts[k].memory;
        if (parts[k].fmu && !fmu_begin(&engine->fmus[k], memory[MEMORY_START_TIME], message))
            return name_part(parts[k].name, message);
        for (int i = 0; i < model->states + model->discretes; i++)
            own[model->first_state + i] = own[model->start_of[i]];
    }
    return perform(engine, readings_at_start, time, time, message);
}

/* FMUs may begin with values of others, which have to pass through all members. */
static bool propagate(Engine *engine, double time, Message message) {
    for (int k = 0; FMUS > 0 && k < MEMBERS + 1; k++)
        if (!perform(engine, exchange, time, time, message) || !perform(engine, readings_at_start, time, time, message))
            return false;
    return true;
}

static bool periods_valid(const Member *member, Message message) {
    for (int i = 0; i < member->model->groups; i++) {
        int parameter = member->model->group[i].period_parameter;
        if (parameter < 0 || member->memory[parameter] > 0.0)
            continue;
        snprintf(message, MESSAGE_SIZE, "parameter '%s' = %.10g s is a sample period and must be greater than 0",
                 member->model->variable[parameter].name, member->memory[parameter]);
        return false;
    }
    return true;
}

/* ---- what the front-end calls ------------------------------------------------------------------- */

Engine *engine_create(double *memory, const TextValue *texts, const char *resources, Message message) {
    Engine *engine = calloc(1, sizeof *engine);
    bool made = engine != NULL;
    (void)texts;
    snprintf(message, MESSAGE_SIZE, "out of memory");
    for (int k = 0; made && k < MEMBERS; k++) {
        double *own = memory + parts[k].memory;
        engine->fmus[k] = (FmuMember){.name = parts[k].name, .model = parts[k].model, .memory = own};
        made = furnish(&engine->members[k], parts[k].model, own);
        if (made && parts[k].fmu)
            made = fmu_open(&engine->fmus[k], parts[k].fmu, resources, message) || name_part(parts[k].name, message);
    }
    if (made) {
        *message = '\0';
        engine->memory = memory;
        return engine;
    }
    engine_free(engine);
    return NULL;
}

void engine_free(Engine *engine) {
    for (int k = 0; engine != NULL && k < MEMBERS; k++) {
        free(engine->members[k].arrays);
        fmu_close(&engine->fmus[k]);
    }
    free(engine);
}

void engine_terminate(Engine *engine) {
    for (int k = 0; k < MEMBERS; k++)
        fmu_end(&engine->fmus[k]);
}

bool engine_initialize(Engine *engine, Message message) {
    double time = engine->memory[MEMORY_START_TIME];
    if (!start(engine, time, message) || !propagate(engine, time, message))
        return false;
    for (int k = 0; k < MEMBERS; k++) {
        bool begun = periods_valid(&engine->members[k], message);
        if (!begun || (parts[k].fmu && !fmu_initialize(&engine->fmus[k], message)))
            return name_part(parts[k].name, message);
    }
    engine->memory[STARTED] = 1.0;
    engine->memory[EXCHANGED] = 0.0;
    return FMUS == 0 || perform(engine, readings_at_start, time, time, message);
}

/* FMUs that run hear of parameters that were moved. */
static bool send_tuned(Engine *engine, Message message) {
    for (int k = 0; k < MEMBERS; k++)
        if (engine->fmus[k].initialized && !send_parameters(&engine->fmus[k], message))
            return name_part(parts[k].name, message);
    return true;
}

/* The exchange at a communication point, unless it would be that of before. */
bool engine_evaluate(Engine *engine, double time, Message message) {
    const size_t size = MODEL_INPUTS * sizeof(double);
    double *memory = engine->memory, *inputs = memory + FIRST_INPUT, *before = memory + EXCHANGED_INPUTS;
    if (memory[STARTED] == 0.0 && !(start(engine, time, message) && propagate(engine, time, message)))
        return false;
    if (memory[MEMORY_PARAMETERS_CHANGED] != 0.0) {
        if (!perform(engine, parameters_of_members, time, time, message) || !send_tuned(engine, message))
            return false;
        memory[MEMORY_PARAMETERS_CHANGED] = memory[EXCHANGED] = 0.0;
    }
    if (memory[STARTED] != 0.0 && memory[EXCHANGED] != 0.0 && memcmp(before, inputs, size) == 0)
        return true;
    if (!perform(engine, exchange, time, time, message))
        return false;
    memcpy(before, inputs, size);
    memory[EXCHANGED] = 1.0;
    return true;
}

bool engine_differentiate(Engine *engine, double time, Message message) {
    (void)engine;
    (void)time;
    (void)message;
    return true;
}

/* As many communication steps of the system as there are in this one of the host, all of one size, or one. */
bool engine_advance(Engine *engine, double time, double size, Message message) {
    double count = fmax(1.0, ceil(size / engine->memory[COMMUNICATION_STEP] - 1e-6));
    double end = time + size, from = time;
    if (!(count <= MAX_STEPS)) {
        snprintf(message, MESSAGE_SIZE, "more than %d communication steps of %g s", MAX_STEPS,
                 engine->memory[COMMUNICATION_STEP]);
        return false;
    }
    for (int k = 0; k < MEMBERS; k++)
        engine->members[k].most = MAX_STEPS;
    for (double k = 1.0; k <= count; k += 1.0) {
        double to = k == count ? end : time + size * k / count;
        if (!engine_evaluate(engine, from, message))
            return false;
        engine->memory[EXCHANGED] = 0.0;
        if (!perform(engine, steps_of_members, from, to, message))
            return false;
        from = to;
    }
    return true;
}

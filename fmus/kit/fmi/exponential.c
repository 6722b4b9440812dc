/* Integration of the states of a stiff component over a record: exactly what is linear, by stages what is not.
 *
 * The rates are A x + g, and A is the same throughout the record. Without a change of g during a step, or with one that
 * is linear in time, a step is exact however long. Else it is that of Krogstad (2005): stages as in the classic
 * Runge-Kutta method, each weighted by functions of h A, order 4 in what is not linear. Steps are halved and doubled,
 * so that these functions are computed once for a record (../record/linearisation.py); what is shorter than the shortest
 * is left to the Runge-Kutta method. The operations are those of ../record/exponential.py.
 */
#include "native.h"

#include <stdlib.h>

static bool integrate_by_runge_kutta(Engine *engine, double time, double target, Message message);
#define integrate integrate_by_runge_kutta
#include "integrate.c"
#undef integrate

#define SAME 1e-9    /* relative: steps this close are the same */
#define ROUNDED 1e-6 /* relative: intervals this close are the same but for the rounding of a clock */

/* The functions for steps of largest / 2^level, as `Ladder` in ../record/linearisation.py has them. */
typedef struct {
    int levels; /* 0 where nothing is stiff */
    int affine;
    int states; /* of the component itself, without sensitivities: rows of a block */
    double largest;
    double worth; /* steps per second that cost no more than those of Runge and Kutta */
    const double *matrix, *phi;
} Ladder;

/* An engine that runs over a record. */
typedef struct {
    Engine engine;
    Ladder ladder;
    int level;    /* of the step to try next */
    double steps; /* tried since the record began */
    /* of the step being tried, for each state; in one block, which begins with `rate` */
    double *rate, *stage, *plain, *middle, *d2, *d3, *d4, *one, *half, *moved;
} Recorder;

/* Takes over a ladder, and makes the arrays of its steps. False without memory. */
static bool equip(Recorder *recorder, const Ladder *ladder) {
    double **const arrays[] = {&recorder->rate, &recorder->stage, &recorder->plain, &recorder->middle, &recorder->d2,
                               &recorder->d3,   &recorder->d4,    &recorder->one,   &recorder->half,   &recorder->moved};
    const size_t count = sizeof arrays / sizeof *arrays, states = (size_t)model_of(&recorder->engine)->states;
    double *next = calloc(count * states + 1, sizeof *next);
    recorder->ladder = *ladder;
    for (size_t i = 0; next != NULL && i < count; i++, next += states)
        *arrays[i] = next;
    return next != NULL;
}

static void clear(const Recorder *recorder, double *values) {
    memset(values, 0, (size_t)model_of(&recorder->engine)->states * sizeof(double));
}

/* Adds scale * M v; M is kept as the stack of its blocks, of so many rows and columns each. */
static inline void add_blocks(int rows, int blocks, double *sum, double scale, const double *m, const double *v) {
    for (int block = 0; block < blocks; block++) {
        const double *of_block = m + block * rows * rows, *vb = v + block * rows;
        for (int i = 0; i < rows; i++) {
            double product = 0.0;
            for (int j = 0; j < rows; j++)
                product += m[i * rows + j] * vb[j];
            for (int j = 0; block > 0 && j < rows; j++)
                product += of_block[i * rows + j] * v[j];
            sum[block * rows + i] += scale * product;
        }
    }
}

/* The same for blocks of one size, without loops over their rows and columns: half of the time. */
typedef void Sum(int blocks, double *sum, double scale, const double *m, const double *v);
#define BLOCKS_OF(rows)                                                                                                \
    static void add_blocks_of_##rows(int blocks, double *sum, double scale, const double *m, const double *v) {        \
        add_blocks(rows, blocks, sum, scale, m, v);                                                                    \
    }
BLOCKS_OF(1)
BLOCKS_OF(2)
BLOCKS_OF(3)
BLOCKS_OF(4)
BLOCKS_OF(5)
BLOCKS_OF(6)
BLOCKS_OF(7)
BLOCKS_OF(8)
#undef BLOCKS_OF
static Sum *const usual[] = {NULL,
                             add_blocks_of_1,
                             add_blocks_of_2,
                             add_blocks_of_3,
                             add_blocks_of_4,
                             add_blocks_of_5,
                             add_blocks_of_6,
                             add_blocks_of_7,
                             add_blocks_of_8};

static void add_product(const Recorder *recorder, double *sum, double scale, const double *m, const double *v) {
    const int rows = recorder->ladder.states, blocks = model_of(&recorder->engine)->states / rows;
    if ((size_t)rows < sizeof usual / sizeof *usual)
        usual[rows](blocks, sum, scale, m, v);
    else
        add_blocks(rows, blocks, sum, scale, m, v);
}

static const double *phi(const Recorder *recorder, int level, int order) {
    const int size = recorder->ladder.states * model_of(&recorder->engine)->states; /* of the stack of blocks */
    return recorder->ladder.phi + (3 * level + order - 1) * size;
}

/* How much the rest g has changed since the start of the step, where the states have moved from x by `moved`. */
static void changed(Recorder *recorder, double time, const double *x, const double *moved, double *difference) {
    const int states = model_of(&recorder->engine)->states;
    for (int i = 0; i < states; i++)
        recorder->stage[i] = x[i] + moved[i];
    rates_at(&recorder->engine, time, recorder->stage, difference);
    for (int i = 0; i < states; i++)
        difference[i] -= recorder->rate[i];
    add_product(recorder, difference, -1.0, recorder->ladder.matrix, moved);
}

/* One step of what is affine, from x; by how much the states move is in `moved`. */
static void affine_step(Recorder *recorder, double time, double h, int level, const double *x, double *moved) {
    clear(recorder, moved);
    rates_at(&recorder->engine, time, x, recorder->rate);
    if (recorder->engine.sloped) {
        changed(recorder, time + h, x, moved, recorder->d2);
        add_product(recorder, moved, h, phi(recorder, level, 2), recorder->d2);
    }
    add_product(recorder, moved, h, phi(recorder, level, 1), recorder->rate);
}

/* One step of Krogstad's method. */
static void krogstad_step(Recorder *recorder, double time, double h, int level, const double *x, double *moved) {
    const int states = model_of(&recorder->engine)->states;
    double *d2 = recorder->d2, *d3 = recorder->d3, *d4 = recorder->d4, *plain = recorder->plain;
    rates_at(&recorder->engine, time, x, recorder->rate);
    clear(recorder, moved);
    add_product(recorder, moved, 0.5 * h, phi(recorder, level + 1, 1), recorder->rate);
    changed(recorder, time + 0.5 * h, x, moved, d2);
    add_product(recorder, moved, h, phi(recorder, level + 1, 2), d2);
    changed(recorder, time + 0.5 * h, x, moved, d3);
    clear(recorder, plain);
    add_product(recorder, plain, h, phi(recorder, level, 1), recorder->rate);
    memcpy(moved, plain, (size_t)states * sizeof(double));
    add_product(recorder, moved, 2.0 * h, phi(recorder, level, 2), d3);
    changed(recorder, time + h, x, moved, d4);
    for (int i = 0; i < states; i++) {
        double both = d2[i] + d3[i];
        d2[i] = 2.0 * both - d4[i];
        d3[i] = 4.0 * (d4[i] - both);
    }
    memcpy(moved, plain, (size_t)states * sizeof(double));
    add_product(recorder, moved, h, phi(recorder, level, 2), d2);
    add_product(recorder, moved, h, phi(recorder, level, 3), d3);
}

/* One step and two of half its length, which are taken, corrected by their difference over 15: at order 4 their error.
   It is asked of the end alone, so that nothing between can hide from it. A hundredth of the tolerance is allowed, so
   that slopes by parameters are as good as signals. */
static double try_step_and_halves(Recorder *recorder, double time, double h, int level) {
    const Model *model = model_of(&recorder->engine);
    const double *x = recorder->engine.memory + model->first_state;
    double *one = recorder->one, *half = recorder->half, *moved = recorder->moved;
    double tolerance = 0.01 * recorder->engine.memory[model->tolerance], worst = 0.0;
    krogstad_step(recorder, time, h, level, x, one);
    krogstad_step(recorder, time, 0.5 * h, level + 1, x, half);
    for (int i = 0; i < model->states; i++)
        recorder->middle[i] = x[i] + half[i];
    krogstad_step(recorder, time + 0.5 * h, 0.5 * h, level + 1, recorder->middle, moved);
    for (int i = 0; i < model->states; i++) {
        double difference = (half[i] + moved[i] - one[i]) / 15.0;
        double error = fabs(difference) / tolerance / (model->variable[model->first_state + i].nominal + fabs(x[i]));
        moved[i] += half[i] + difference;
        if (!isfinite(error))
            return INFINITY;
        worst = fmax(worst, error);
    }
    return worst;
}

static double try_affine(Recorder *recorder, double time, double h, int level) {
    const Model *model = model_of(&recorder->engine);
    affine_step(recorder, time, h, level, recorder->engine.memory + model->first_state, recorder->moved);
    for (int i = 0; i < model->states; i++)
        if (!isfinite(recorder->moved[i]))
            return INFINITY;
    return 0.0;
}

/* What of an interval a step has left over because the clock rounds its instants, or has made too much. */
static void follow_clock(Recorder *recorder, double target, double left) {
    const Model *model = model_of(&recorder->engine);
    double *x = recorder->engine.memory + model->first_state;
    rates_at(&recorder->engine, target, x, recorder->rate);
    for (int i = 0; i < model->states; i++)
        x[i] += left * recorder->rate[i];
}

static double step_of(const Ladder *ladder, int level) { return ldexp(ladder->largest, -level); }

bool integrate(Engine *engine, double time, double target, Message message) {
    const Model *model = model_of(engine);
    Recorder *recorder = (Recorder *)engine;
    const Ladder *ladder = &recorder->ladder;
    const double allowed = ladder->worth * (target - engine->memory[model->start_time]);
    if (ladder->levels == 0 || time >= target)
        return integrate_by_runge_kutta(engine, time, target, message);
    while (time < target) {
        double remaining = target - time, h, error;
        int level = recorder->level;
        if (recorder->steps > allowed)
            return integrate_by_runge_kutta(engine, time, target, message);
        while (level < ladder->levels && step_of(ladder, level) > remaining * (1.0 + ROUNDED))
            level++;
        if (level >= ladder->levels) {
            recorder->level = recorder->level < ladder->levels ? recorder->level : ladder->levels - 1;
            return integrate_by_runge_kutta(engine, time, target, message);
        }
        h = step_of(ladder, level);
        if (!spend(engine, time, message))
            return false;
        recorder->steps++;
        error = (ladder->affine ? try_affine : try_step_and_halves)(recorder, time, h, level);
        if (error > 1.0) {
            recorder->level = level + 1;
            continue;
        }
        time = h >= remaining * (1.0 - ROUNDED) ? target : time + h;
        for (int i = 0; i < model->states; i++)
            engine->memory[model->first_state + i] += recorder->moved[i];
        if (time == target && fabs(remaining - h) > SAME * remaining)
            follow_clock(recorder, target, remaining - h);
        /* a step shortened to stay before the target says nothing against a longer one */
        if (error < 1.0 / 32.0 && level == recorder->level && level > 0)
            recorder->level--;
    }
    return true;
}

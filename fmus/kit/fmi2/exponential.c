/* Integration of the states of a stiff component over a record: exactly what is linear, by stages what is not.
 *
 * The rates are A x + g, and A is the same throughout the record. Without a change of g during a step, or with one that
 * is linear in time, a step is exact however long. Else it is that of Krogstad (2005): stages as in the classic
 * Runge-Kutta method, each weighted by functions of h A, order 4 in what is not linear. Steps are halved and doubled,
 * so that these functions are computed once for a record (../record/linearisation.py); what is shorter than the shortest
 * is left to the Runge-Kutta method. The operations are those of ../record/exponential.py.
 */
#include "native.h"

static bool integrate_by_runge_kutta(Engine *engine, double time, double target, Message message);
#define integrate integrate_by_runge_kutta
#include "integrate.c"
#undef integrate

#include "record.h" /* RECORD_STATES: those of the component itself, without sensitivities */

#define SAME 1e-9    /* relative: steps this close are the same */
#define ROUNDED 1e-6 /* relative: intervals this close are the same but for the rounding of a clock */

enum { BLOCKS = MODEL_STATES / (RECORD_STATES > 0 ? RECORD_STATES : 1) };
enum { BLOCK = RECORD_STATES * RECORD_STATES, MATRIX = BLOCKS * BLOCK };

/* The functions for steps of largest / 2^level, as `Ladder` in ../record/linearisation.py has them. */
typedef struct {
    int levels; /* 0 where nothing is stiff */
    int affine;
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
    /* of the step being tried; not on the stack, which a thread may have little of */
    double rate[MODEL_STATES + 1], stage[MODEL_STATES + 1], plain[MODEL_STATES + 1], middle[MODEL_STATES + 1];
    double d2[MODEL_STATES + 1], d3[MODEL_STATES + 1], d4[MODEL_STATES + 1];
    double one[MODEL_STATES + 1], half[MODEL_STATES + 1], moved[MODEL_STATES + 1];
} Recorder;

/* Adds scale * M v; M is kept as the stack of its blocks. */
static void add_product(double *sum, double scale, const double *m, const double *v) {
    for (int block = 0; block < BLOCKS; block++) {
        const double *of_block = m + block * BLOCK, *vb = v + block * RECORD_STATES;
        for (int i = 0; i < RECORD_STATES; i++) {
            double product = 0.0;
            for (int j = 0; j < RECORD_STATES; j++)
                product += m[i * RECORD_STATES + j] * vb[j];
            for (int j = 0; block > 0 && j < RECORD_STATES; j++)
                product += of_block[i * RECORD_STATES + j] * v[j];
            sum[block * RECORD_STATES + i] += scale * product;
        }
    }
}

static const double *phi(const Recorder *recorder, int level, int order) {
    return recorder->ladder.phi + (3 * level + order - 1) * MATRIX;
}

/* How much the rest g has changed since the start of the step, where the states have moved from x by `moved`. */
static void changed(Recorder *recorder, double time, const double *x, const double *moved, double *difference) {
    for (int i = 0; i < MODEL_STATES; i++)
        recorder->stage[i] = x[i] + moved[i];
    rates_at(&recorder->engine, time, recorder->stage, difference);
    for (int i = 0; i < MODEL_STATES; i++)
        difference[i] -= recorder->rate[i];
    add_product(difference, -1.0, recorder->ladder.matrix, moved);
}

static void clear(double *values) { memset(values, 0, MODEL_STATES * sizeof(double)); }

/* One step of what is affine, from x; by how much the states move is in `moved`. */
static void affine_step(Recorder *recorder, double time, double h, int level, const double *x, double *moved) {
    clear(moved);
    rates_at(&recorder->engine, time, x, recorder->rate);
    if (recorder->engine.sloped) {
        changed(recorder, time + h, x, moved, recorder->d2);
        add_product(moved, h, phi(recorder, level, 2), recorder->d2);
    }
    add_product(moved, h, phi(recorder, level, 1), recorder->rate);
}

/* One step of Krogstad's method. */
static void krogstad_step(Recorder *recorder, double time, double h, int level, const double *x, double *moved) {
    double *d2 = recorder->d2, *d3 = recorder->d3, *d4 = recorder->d4, *plain = recorder->plain;
    rates_at(&recorder->engine, time, x, recorder->rate);
    clear(moved);
    add_product(moved, 0.5 * h, phi(recorder, level + 1, 1), recorder->rate);
    changed(recorder, time + 0.5 * h, x, moved, d2);
    add_product(moved, h, phi(recorder, level + 1, 2), d2);
    changed(recorder, time + 0.5 * h, x, moved, d3);
    clear(plain);
    add_product(plain, h, phi(recorder, level, 1), recorder->rate);
    memcpy(moved, plain, MODEL_STATES * sizeof(double));
    add_product(moved, 2.0 * h, phi(recorder, level, 2), d3);
    changed(recorder, time + h, x, moved, d4);
    for (int i = 0; i < MODEL_STATES; i++) {
        double both = d2[i] + d3[i];
        d2[i] = 2.0 * both - d4[i];
        d3[i] = 4.0 * (d4[i] - both);
    }
    memcpy(moved, plain, MODEL_STATES * sizeof(double));
    add_product(moved, h, phi(recorder, level, 2), d2);
    add_product(moved, h, phi(recorder, level, 3), d3);
}

/* One step and two of half its length, which are taken, corrected by their difference over 15: at order 4 their error.
   It is asked of the end alone, so that nothing between can hide from it. A hundredth of the tolerance is allowed, so
   that slopes by parameters are as good as signals. */
static double try_step_and_halves(Recorder *recorder, double time, double h, int level) {
    const double *x = recorder->engine.memory + FIRST_STATE;
    double *one = recorder->one, *half = recorder->half, *moved = recorder->moved;
    double tolerance = 0.01 * recorder->engine.memory[MEMORY_TOLERANCE], worst = 0.0;
    krogstad_step(recorder, time, h, level, x, one);
    krogstad_step(recorder, time, 0.5 * h, level + 1, x, half);
    for (int i = 0; i < MODEL_STATES; i++)
        recorder->middle[i] = x[i] + half[i];
    krogstad_step(recorder, time + 0.5 * h, 0.5 * h, level + 1, recorder->middle, moved);
    for (int i = 0; i < MODEL_STATES; i++) {
        double difference = (half[i] + moved[i] - one[i]) / 15.0;
        double error = fabs(difference) / tolerance / (model_variables[FIRST_STATE + i].nominal + fabs(x[i]));
        moved[i] += half[i] + difference;
        if (!isfinite(error))
            return INFINITY;
        worst = fmax(worst, error);
    }
    return worst;
}

static double try_affine(Recorder *recorder, double time, double h, int level) {
    affine_step(recorder, time, h, level, recorder->engine.memory + FIRST_STATE, recorder->moved);
    for (int i = 0; i < MODEL_STATES; i++)
        if (!isfinite(recorder->moved[i]))
            return INFINITY;
    return 0.0;
}

/* What of an interval a step has left over because the clock rounds its instants, or has made too much. */
static void follow_clock(Recorder *recorder, double target, double left) {
    double *x = recorder->engine.memory + FIRST_STATE;
    rates_at(&recorder->engine, target, x, recorder->rate);
    for (int i = 0; i < MODEL_STATES; i++)
        x[i] += left * recorder->rate[i];
}

static double step_of(const Ladder *ladder, int level) { return ldexp(ladder->largest, -level); }

bool integrate(Engine *engine, double time, double target, Message message) {
    Recorder *recorder = (Recorder *)engine;
    const Ladder *ladder = &recorder->ladder;
    const double allowed = ladder->worth * (target - engine->memory[MEMORY_START_TIME]);
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
        for (int i = 0; i < MODEL_STATES; i++)
            engine->memory[FIRST_STATE + i] += recorder->moved[i];
        if (time == target && fabs(remaining - h) > SAME * remaining)
            follow_clock(recorder, target, remaining - h);
        /* a step shortened to stay before the target says nothing against a longer one */
        if (error < 1.0 / 32.0 && level == recorder->level && level > 0)
            recorder->level--;
    }
    return true;
}

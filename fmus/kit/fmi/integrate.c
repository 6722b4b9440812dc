/* Integration of the states: classic Runge-Kutta of order 4 with an embedded estimate of order 3.
 *
 * The fifth rate, at three quarters of the step, serves only the estimate (Zonneveld 1964). The step size found for one
 * communication step is remembered in the memory of the instance and tried in the next. The operations and their order
 * are those of ../integrate.py, so that both builds round alike.
 */
#include "native.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static void rates_at(Engine *engine, double time, const double *states, double *result) {
    const Model *model = model_of(engine);
    bind(engine, time, states);
    engine->res[0] = result;
    if (!call(engine, model->rates_law))
        for (int i = 0; i < model->states; i++)
            result[i] = NAN;
}

static void displaced(Engine *engine, const double *x, double h, const double *rate) {
    const int states = model_of(engine)->states;
    for (int i = 0; i < states; i++)
        engine->trial[i] = x[i] + h * rate[i];
}

/* Tries one step; the new states are in `trial`. The error is relative to what is tolerated.
 *
 * The estimate vanishes for a decay by one time constant in a step; k2 - k3 does not, and weighs little in short steps.
 */
static double try_step(Engine *engine, double time, double h) {
    const Model *model = model_of(engine);
    const double *x = engine->memory + model->first_state;
    double *k1 = engine->k[0], *k2 = engine->k[1], *k3 = engine->k[2], *k4 = engine->k[3], *k5 = engine->k[4];
    double tolerance = engine->memory[model->tolerance], coarse = sqrt(tolerance), worst = 0.0;
    rates_at(engine, time, x, k1);
    displaced(engine, x, 0.5 * h, k1);
    rates_at(engine, time + 0.5 * h, engine->trial, k2);
    displaced(engine, x, 0.5 * h, k2);
    rates_at(engine, time + 0.5 * h, engine->trial, k3);
    displaced(engine, x, h, k3);
    rates_at(engine, time + h, engine->trial, k4);
    for (int i = 0; i < model->states; i++)
        engine->trial[i] = x[i] + h / 32.0 * (5.0 * k1[i] + 7.0 * k2[i] + 13.0 * k3[i] - k4[i]);
    rates_at(engine, time + 0.75 * h, engine->trial, k5);
    for (int i = 0; i < model->states; i++)
        engine->trial[i] = x[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    for (int i = 0; i < model->states; i++) {
        double size = model->variable[model->first_state + i].nominal + fabs(x[i]);
        double estimate = k1[i] - 3.0 * (k2[i] + k3[i] + k4[i]) + 8.0 * k5[i];
        double error = (fabs(h / 7.5 / tolerance * estimate) + fabs(h / coarse * (k2[i] - k3[i]))) / size;
        if (!isfinite(error) || !isfinite(engine->trial[i]))
            return INFINITY;
        worst = fmax(worst, error);
    }
    return worst;
}

/* The state that stops the integration: one whose rate is not finite, else the fastest. */
static const char *culprit(const Engine *engine) {
    const Model *model = model_of(engine);
    int worst = 0;
    double fastest = -1.0;
    for (int i = 0; i < model->states; i++) {
        const Variable *state = &model->variable[model->first_state + i];
        double speed = fabs(engine->k[0][i]) / (state->nominal + fabs(engine->memory[model->first_state + i]));
        if (!isfinite(speed))
            return state->name;
        if (speed > fastest) {
            fastest = speed;
            worst = i;
        }
    }
    return model->variable[model->first_state + worst].name;
}

static bool give_up(const Engine *engine, double time, double error, Message message) {
    if (isfinite(error))
        snprintf(message, MESSAGE_SIZE, "accuracy %g cannot be reached at %.10g s",
                 engine->memory[model_of(engine)->tolerance], time);
    else
        snprintf(message, MESSAGE_SIZE, "not finite: %s at %.10g s", culprit(engine), time);
    return false;
}

/* Counts an internal step, so that no communication step takes for ever. */
static bool spend(Engine *engine, double time, Message message) {
    if (engine->budget-- > 0)
        return true;
    snprintf(message, MESSAGE_SIZE,
             "more than 1000000 internal steps in one communication step at %.10g s: with these parameters a time "
             "constant is far too short for a step so long",
             time);
    return false;
}

/* The step to try after one of size `h`, which had this error. */
static double following(double h, double error) {
    return h * (error == 0.0 ? 5.0 : isfinite(error) ? fmin(fmax(0.9 / sqrt(sqrt(error)), 0.2), 5.0) : 0.1);
}

bool integrate(Engine *engine, double time, double target, Message message) {
    const Model *model = model_of(engine);
    double *hint = engine->memory + model->hint;
    if (model->states == 0 || time >= target)
        return spend(engine, time, message);
    while (time < target) {
        double remaining = target - time;
        double h = *hint <= 0.999 * remaining ? *hint : remaining, error;
        if (!spend(engine, time, message))
            return false;
        error = try_step(engine, time, h);
        if (error <= 1.0) {
            time = h == remaining ? target : time + h;
            memcpy(engine->memory + model->first_state, engine->trial, (size_t)model->states * sizeof(double));
            /* A step shortened to land on the target says nothing against a longer one. */
            if (isfinite(*hint))
                *hint = h == remaining ? fmax(*hint, following(h, error)) : following(h, error);
        } else if (h < 1e-14 * fmax(1.0, fabs(time))) {
            return give_up(engine, time, error, message);
        } else {
            *hint = following(h, error);
        }
    }
    return true;
}

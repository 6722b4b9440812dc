/* The force-driven actuator over a whole record, written by hand: what its simulation costs with nothing around it.
 *
 * The arithmetic is that of the kit's integrator (Runge-Kutta of order 4, error estimate of order 3, step control), for
 * this one model: no laws called through pointers, no inputs with slopes, no sampled updates, no checks of the results.
 */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "fmi2Functions.h"

enum { CHARGE, KELVIN, MAXWELL, STATES };

typedef struct {
    double R1, R2, C, alpha, k1, b1, k2, b2;
} Parameters;

static void rates(const Parameters *p, double current, double force, const double *x, double *rate) {
    rate[CHARGE] = (p->R2 * current - x[CHARGE] / p->C) / (p->R1 + p->R2);
    rate[KELVIN] = (force - p->k2 * x[KELVIN]) / p->b2;
    rate[MAXWELL] = force / p->b1;
}

/* Tries one step; the error is relative to what is tolerated. */
static double try_step(const Parameters *p, double current, double force, double h, double tolerance, const double *x,
                       const double *k1, double *k5, double *trial) {
    static const double nominal[STATES] = {1.0, 1e-4, 1e-4};
    double k2[STATES], k3[STATES], k4[STATES], worst = 0.0;
    for (int i = 0; i < STATES; i++)
        trial[i] = x[i] + 0.5 * h * k1[i];
    rates(p, current, force, trial, k2);
    for (int i = 0; i < STATES; i++)
        trial[i] = x[i] + 0.5 * h * k2[i];
    rates(p, current, force, trial, k3);
    for (int i = 0; i < STATES; i++)
        trial[i] = x[i] + h * k3[i];
    rates(p, current, force, trial, k4);
    for (int i = 0; i < STATES; i++)
        trial[i] = x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
    rates(p, current, force, trial, k5);
    for (int i = 0; i < STATES; i++)
        worst = fmax(worst, fabs(h / 10.0 / tolerance * (k4[i] - k5[i])) / (nominal[i] + fabs(x[i])));
    return worst;
}

/* From `time` to `target`; returns the number of steps tried. */
static long advance(const Parameters *p, double current, double force, double time, double target, double tolerance,
                    double *x, double *hint) {
    double k1[STATES], k5[STATES], trial[STATES];
    long tried = 0;
    rates(p, current, force, x, k1);
    while (time < target) {
        double left = target - time, h = *hint <= 0.999 * left ? *hint : left;
        double error = try_step(p, current, force, h, tolerance, x, k1, k5, trial);
        double next = h * (error == 0.0 ? 5.0 : fmin(fmax(0.9 / sqrt(sqrt(error)), 0.2), 5.0));
        tried++;
        if (error <= 1.0) {
            time = h == left ? target : time + h;
            memcpy(x, trial, sizeof trial);
            memcpy(k1, k5, sizeof k5);
            if (isfinite(*hint))
                *hint = h == left ? fmax(*hint, next) : next;
        } else {
            *hint = next;
        }
    }
    return tried;
}

/* `inputs` has rows (current, force); `outputs` gets (voltage, displacement by charge, by load, total), `states` the
   three states. Returns the number of internal steps tried. */
FMI2_Export long bare_record(size_t n, const double *time, const double *inputs, const Parameters *p, double tolerance,
                             double *outputs, double *states) {
    double x[STATES] = {0.0}, hint = INFINITY;
    long tried = 0;
    for (size_t k = 0; k < n; k++) {
        double current = inputs[2 * k], force = inputs[2 * k + 1], *y = outputs + 4 * k;
        y[0] = p->R1 * ((p->R2 * current - x[CHARGE] / p->C) / (p->R1 + p->R2)) + x[CHARGE] / p->C;
        y[1] = p->alpha * x[CHARGE];
        y[2] = x[KELVIN] + x[MAXWELL] + force / p->k1;
        y[3] = y[1] + y[2];
        memcpy(states + STATES * k, x, sizeof x);
        if (k + 1 < n)
            tried += advance(p, current, force, time[k], time[k + 1], tolerance, x, &hint);
    }
    return tried;
}

/* Free run of a model whose laws are changed by terms, with exact sensitivities.
 *
 * A term adds  size * m * sum_j c_j phi_j((v - middle) / scale)  to one law, where v is a signal or
 * a memory of it and m is 1 or another signal. Terms are data: one library of a model serves for
 * every set of them. The sensitivities S = dX/dtheta are total derivatives, dS/dt = f_x S + f_a
 * da/dtheta + f_theta (Hairer, Norsett, Wanner: Solving Ordinary Differential Equations I, section
 * I.14), by the classical Runge-Kutta method with equal steps between two samples.
 *
 * Before this text stand the functions of the model as CasADi writes them and its sizes: NX states,
 * NU inputs, NY outputs, NP parameters, NL laws, and the sizes of CasADi's work arrays. Signals are
 * numbered inputs, states, laws, time. Of the sparse matrices of CasADi there are functions for the
 * rows by states, times their slopes; of others, where each row begins, and of each element the
 * column and its position in what the function returns.
 *
 * Discrete states are the last of the states. Their rates are zero, and at each tick of their clock
 * the update x+ = U(x, u, t, p, a) takes their place, with S+ = U_x S + U_a da/dtheta + U_theta. A
 * tick belongs to the step after it: an output at its instant shows the values before it. If the
 * clock is later by d, its tick is, and the states behind it differ by U_x f + U_t - f+ times d, f
 * being their rates before and behind (Hiskens, Pai: Trajectory sensitivity analysis of hybrid
 * systems, IEEE Trans. Circuits and Systems I 47, 2000).
 *
 * With a gain a run is that of an observer: after each sample, measured less simulated outputs
 * correct the states, X += G (y - Y(X)) and S += -G dY/dtheta (Ljung: System Identification, section
 * 4.3, on the innovations form). Outputs and states at a sample are as predicted, before that.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum shape { CONSTANT, LINEAR, MODULUS, SQUARE, ODD_SQUARE, CUBE, ROOT, DRY, DEAD_ZONE, ABOVE, BELOW, EXPONENTIAL, LEVELLING, SINH, STEP, CURVE };
enum memory { NONE, LAG, FADING, TWO_LAGS, RATE_LIMIT, PLAY, DAHL, HEAT, INTEGRAL, THROUGHPUT, BACKLASH };

#define KNOTS 13
#define ROUNDED 0.02   /* of the scale, within which a root is straight */
#define ABRUPT 0.004   /* of the scale, within which a step is made */
#define STEEPEST 30.0  /* exponent, beyond which an exponential is constant */
#define LATER 1e-4     /* of a step, by which an update is later for its slope */
#define LARGEST 1e12   /* of a state or an output, beyond which a run has left its range */

typedef struct {
    int law, signal, memory, shape, factor, knots;
    double size, scale, middle;
    double places[KNOTS];
} term;

typedef struct {
    int n, substeps, free, terms, constants, sensitive, measured, starts;
    const double *time, *inputs, *parameters, *values, *start, *tick_time;
    const int *smooth, *position, *tick_clock, *tick; /* tick: the first of each step, n of them */
    const int *output, *state; /* with slopes; by whose start value there are slopes */
    const int *shifts; /* of each clock, which of the free parameters shift it: clocks x free */
    const term *term;
    const double *observed, *gain; /* n x NY, NaN is a gap; n x NX x NY, or 0 for a free run */
    const double *bends; /* n x NU, slopes of smooth inputs at the samples, or 0 for straight lines */
    double *outputs, *slopes, *states;
} run;

#define SIGNALS (NU + NX + NL + 1)

typedef struct {
    const run *of;
    int ns, nz;            /* columns of sensitivities; memories */
    int changed, of_laws;  /* laws with additions; whether a term looks at a law */
    int all_laws;          /* whether there is a column for an addition to each law */
    int is_known;          /* whether additions and rates of memories are those of the next stage */
    int *first, *store;    /* of each term its first constant, and its memory or -1 */
    int *law, *row;        /* the changed laws; of each term the place of its law among them */
    int *column, *place;   /* of each parameter its column, of each law its place, or -1 */
    double *arg_a, *none;  /* additions to laws; zeros */
    double *constant;      /* exponentials of the values of terms: constants of memories, and widths */
    double *da;            /* changed x ns */
    double *g, *gx, *gp;   /* laws and their derivatives */
    double *f, *fx, *fp, *fa;
    double *ds, *dv, *dm;  /* ns each */
    double *Y, *K, *T, *L; /* a point within a step, the rates of its stages, and their slopes */
    double *u, *before, *dbefore; /* inputs; signals of bristles before a step */
    double *w;
    int *iw;
} work;

typedef struct {
    const int *start, *column, *from;
} pattern;

typedef struct {
    const row *x;
    pattern p, a; /* by parameters and additions to laws */
} derivatives;

#define PATTERN(function, result) \
    {function##_##result##_start, function##_##result##_column, function##_##result##_from}
#define DERIVATIVES(function) {function##_rows, PATTERN(function, 2), PATTERN(function, 3)}

static const derivatives of_rates = DERIVATIVES(rate_slopes_of), of_outputs = DERIVATIVES(output_slopes_of);
static const derivatives of_laws = {laws_of_rows, PATTERN(laws_of, 2), {0}};
static const derivatives of_updates[] = {UPDATE_SLOPES};

typedef int (*function_of)(const double **, double **, int *, double *, int);
static const function_of updates_of[] = {UPDATES};

static void call(function_of function,
                 const double *x, const double *u, double t, const double *p, const double *a,
                 double **res, work *k) {
    const double *arg[8] = {x, u, &t, p, a, 0, 0, 0};
    double *results[16] = {0};
    memcpy(results, res, 8 * sizeof(double *));
    function(arg, results, k->iw, k->w, 0);
}

/* the interval between the knots of a curve in which z is, or the nearest one */
static int interval(const term *q, double z) {
    int i = (int)((z - q->places[0]) / (q->places[1] - q->places[0]));
    return i < 0 || z < q->places[0] ? 0 : i > q->knots - 2 ? q->knots - 2 : i;
}

/* the part of value j in the slope at knot i, over an interval: a chord at the ends, else a parabola */
static double slope_part(int last, int i, int j) {
    if (i == 0) return (j == 1) - (j == 0);
    if (i == last) return (j == last) - (j == last - 1);
    return 0.5 * ((j == i + 1) - (j == i - 1));
}

/* shape functions of z and their derivatives by z and by the logarithm of the width */
static void shape_at(const term *q, int j, double z, double w, double *value, double *by_z, double *by_w) {
    double m = fabs(z), sign = z < 0.0 ? -1.0 : 1.0, e;
    *by_w = 0.0;
    switch (q->shape) {
    case CONSTANT: *value = 1.0; *by_z = 0.0; break;
    case LINEAR: *value = z; *by_z = 1.0; break;
    case MODULUS: *value = m; *by_z = sign; break;
    case SQUARE: *value = z * z; *by_z = 2.0 * z; break;
    case ODD_SQUARE: *value = z * m; *by_z = 2.0 * m; break;
    case CUBE: *value = z * z * z; *by_z = 3.0 * z * z; break;
    case ROOT:
        e = sqrt(m + ROUNDED);
        *value = z / e;
        *by_z = 1.0 / e - 0.5 * m / (e * e * e);
        break;
    case DRY:
        e = tanh(z / w);
        *value = e;
        *by_z = (1.0 - e * e) / w;
        *by_w = -(1.0 - e * e) * z / w;
        break;
    case DEAD_ZONE:
        *value = m > w ? z - sign * w : 0.0;
        *by_z = m > w;
        *by_w = m > w ? -sign * w : 0.0;
        break;
    case ABOVE:
        *value = z > w ? z - w : 0.0;
        *by_z = z > w;
        *by_w = z > w ? -w : 0.0;
        break;
    case BELOW:
        *value = z < -w ? z + w : 0.0;
        *by_z = z < -w;
        *by_w = z < -w ? w : 0.0;
        break;
    case EXPONENTIAL:
    case LEVELLING: {
        double side = q->shape == EXPONENTIAL ? 1.0 : -1.0, power = side * z / w;
        int inside = power < STEEPEST;
        e = exp(inside ? power : STEEPEST);
        *value = side * (e - 1.0);
        *by_z = inside ? e / w : 0.0;
        *by_w = -z * *by_z;
        break;
    }
    case SINH:
        e = m / w;
        *by_z = e < STEEPEST ? cosh(e) / w : 0.0;
        *value = sign * sinh(e < STEEPEST ? e : STEEPEST);
        *by_w = -z * *by_z;
        break;
    case STEP:
        e = tanh((z - w) / ABRUPT);
        *value = 0.5 + 0.5 * e;
        *by_z = 0.5 * (1.0 - e * e) / ABRUPT;
        *by_w = -w * *by_z;
        break;
    default: {  /* CURVE: part j of cubics between even knots, constant beyond them (smooth_table) */
        int last = q->knots - 1, i = interval(q, z);
        double wide = q->places[1] - q->places[0], x = (z - q->places[i]) / wide, rest = 1.0 - x;
        if (x <= 0.0 || x >= 1.0) {
            int at_end = z <= q->places[0] || z >= q->places[last];
            *value = j == (x <= 0.0 ? i : i + 1);
            if (at_end) { *by_z = 0.0; break; }
        }
        double low = slope_part(last, i, j), high = slope_part(last, i + 1, j);
        double from = j == i, to = j == i + 1;
        *value = from * (1.0 + 2.0 * x) * rest * rest + to * x * x * (3.0 - 2.0 * x)
                 + low * x * rest * rest - high * x * x * rest;
        *by_z = (6.0 * x * rest * (to - from) + low * rest * (1.0 - 3.0 * x) + high * x * (3.0 * x - 2.0))
                / wide;
    }
    }
}

static int coefficients(const term *q) { return q->shape == CURVE ? q->knots : 1; }
static int has_width(const term *q) { return q->shape >= DRY && q->shape <= STEP; }
static int counts(const term *q) { return q->memory == INTEGRAL || q->memory == THROUGHPUT; }
static int follows(const term *q) { return q->memory == PLAY || q->memory == DAHL || q->memory == BACKLASH; }
static int of_memory(const term *q) {
    if (q->memory == NONE || counts(q)) return 0;
    return q->memory == TWO_LAGS || q->memory == RATE_LIMIT ? 2 : 1;
}

/* add a row of derivatives by parameters to those by what is free */
static void add_parameters(const pattern *by, int i, const double *values, double *out, const work *k) {
    for (int e = by->start[i]; e < by->start[i + 1]; e++) {
        int q = k->column[by->column[e]];
        if (q >= 0) out[q] += values[by->from[e]];
    }
}

/* add a row of derivatives by additions to laws, times the slopes of those to changed laws */
static void add_laws(const pattern *by, int i, const double *values, double *restrict out, const work *k) {
    for (int e = by->start[i]; e < by->start[i + 1]; e++) {
        int row = k->place[by->column[e]];
        if (row < 0) continue;
        const double v = values[by->from[e]], *s = k->da + row * k->ns;
        for (int q = 0; q < k->ns; q++) out[q] += v * s[q];
    }
}

/* A signal at a point, and in *d its total derivatives by theta: a row of S or of `out`, 0 for none. */
static double signal(int i, const double *X, const double *S, const double *u, double t, work *k,
                     double *out, const double **d) {
    int ns = k->ns, l = i - NU - NX;
    *d = 0;
    if (i < NU) return u[i];
    if (l < 0) {
        if (S) *d = S + (i - NU) * ns;
        return X[i - NU];
    }
    if (l == NL) return t;
    if (S) {
        of_laws.x[l](k->gx, S, out, ns);
        add_parameters(&of_laws.p, l, k->gp, out, k);
        *d = out;
    }
    return k->g[l];
}

static int is_law(int i) { return i >= NU + NX && i < NU + NX + NL; }

/* laws without terms at a point, where a term looks at one */
static void see_laws(const double *X, const double *u, double t, int sensitive, work *k) {
    if (!k->of_laws) return;
    double *laws[8] = {k->g, sensitive ? k->gx : 0, sensitive ? k->gp : 0};
    call(laws_of, X, u, t, k->of->parameters, k->none, laws, k);
}

/* additions to the laws and rates of the memories at a point */
static void add_terms(const double *X, const double *S, const double *u, double t, double *dX, double *dS, work *k) {
    const run *r = k->of;
    int ns = k->ns, sensitive = S != 0;
    for (int i = 0; i < k->changed; i++) k->arg_a[k->law[i]] = 0.0;
    if (sensitive) {
        memset(k->da, 0, k->changed * ns * sizeof(double));
        if (k->all_laws) for (int l = 0; l < NL; l++) k->da[l * ns + r->free + r->constants + l] = 1.0;
    }
    see_laws(X, u, t, sensitive, k);
    for (int i = 0; i < r->terms; i++) {
        const term *q = r->term + i;
        int nc = coefficients(q), c0 = k->first[i], z = k->store[i], at_memory = c0 + nc;
        const double *c = r->values + c0;
        int col = r->free + c0;
        const double *ds, *dm, *dv;
        double s = signal(q->signal, X, S, u, t, k, k->ds, &ds), v = s;
        dv = ds;
        if (q->memory != NONE) {
            double Z = X[z];
            const double *sz = sensitive ? S + z * ns : 0;
            if (follows(q)) {
                if (dX) dX[z] = 0.0;
                if (dS) memset(dS + z * ns, 0, ns * sizeof(double));
            } else if (counts(q)) {
                double side = q->memory == THROUGHPUT && s < 0.0 ? -1.0 : 1.0;
                if (dX) dX[z] = side * s;
                if (dS) for (int j = 0; j < ns; j++) dS[z * ns + j] = ds ? side * ds[j] : 0.0;
            } else if (dX) {
                double tau = k->constant[at_memory];
                double into = q->memory == HEAT ? s * s : s, by_into = q->memory == HEAT ? 2.0 * s : 1.0;
                double gap = into - Z, by_gap = 1.0 / tau, by_first = -gap / tau, by_second = 0.0, rate;
                if (q->memory == TWO_LAGS && gap < 0.0) {
                    double ratio = k->constant[at_memory + 1];
                    by_gap /= ratio; by_first /= ratio; by_second = -gap * by_gap;
                }
                rate = gap * by_gap;
                if (q->memory == RATE_LIMIT) {
                    double most = q->scale * k->constant[at_memory + 1], e = tanh(rate / most);
                    by_second = most * (e - (1.0 - e * e) * rate / most);
                    by_gap *= 1.0 - e * e; by_first *= 1.0 - e * e;
                    rate = most * e;
                }
                dX[z] = rate;
                if (dS) {
                    double *to = dS + z * ns;
                    for (int j = 0; j < ns; j++) to[j] = -by_gap * sz[j];
                    if (ds) for (int j = 0; j < ns; j++) to[j] += by_gap * by_into * ds[j];
                    dS[z * ns + r->free + at_memory] += by_first;
                    if (of_memory(q) == 2) dS[z * ns + r->free + at_memory + 1] += by_second;
                }
            }
            int behind = q->memory == FADING || q->memory == TWO_LAGS || q->memory == RATE_LIMIT || q->memory == BACKLASH;
            v = behind ? s - Z : Z;
            dv = sz;
            if (sensitive && behind) {
                for (int j = 0; j < ns; j++) k->dv[j] = (ds ? ds[j] : 0.0) - sz[j];
                dv = k->dv;
            }
        }
        double m = 1.0;
        dm = 0;
        if (q->factor >= 0) m = signal(q->factor, X, S, u, t, k, k->dm, &dm);
        int at_width = at_memory + of_memory(q);
        double w = has_width(q) ? k->constant[at_width] : 1.0;
        double zz = (v - q->middle) / q->scale, sum = 0.0, by_z = 0.0, by_w = 0.0, size = q->size;
        double *da = k->da + k->row[i] * ns;
        int from = 0, until = nc;
        if (q->shape == CURVE) {  /* parts further off are zero */
            int here = interval(q, zz);
            from = here > 0 ? here - 1 : 0;
            until = here + 3 < nc ? here + 3 : nc;
        }
        for (int j = from; j < until; j++) {
            double a, b, d;
            shape_at(q, j, zz, w, &a, &b, &d);
            sum += c[j] * a; by_z += c[j] * b; by_w += c[j] * d;
            if (sensitive) da[col + j] += size * m * a;
        }
        k->arg_a[q->law] += size * m * sum;
        if (sensitive) {
            double by_v = size * m * by_z / q->scale;
            if (dv) for (int j = 0; j < ns; j++) da[j] += by_v * dv[j];
            if (dm) for (int j = 0; j < ns; j++) da[j] += size * sum * dm[j];
            if (has_width(q)) da[r->free + at_width] += size * m * by_w;
        }
    }
}

/* a row of the total derivatives of a function */
static void chain(int i, const derivatives *by, const double *S, double *o, const work *k) {
    by->x[i](k->fx, S, o, k->ns);
    add_laws(&by->a, i, k->fa, o, k);
    add_parameters(&by->p, i, k->fp, o, k);
}

static void rates(const double *X, const double *S, const double *u, double t, double *dX, double *dS, work *k) {
    if (!k->is_known) add_terms(X, S, u, t, dX, dS, k);
    k->is_known = 0;
    double *values[8] = {dX}, *all[8] = {dX, k->fx, k->fp, k->fa};
    if (!S) { call(rates_of, X, u, t, k->of->parameters, k->arg_a, values, k); return; }
    call(rate_slopes_of, X, u, t, k->of->parameters, k->arg_a, all, k);
    for (int i = 0; i < NX; i++) chain(i, &of_rates, S, dS + i * k->ns, k);
}

/* outputs at a point; with rates of the memories there, if it is where the next stage is */
static void observe(const double *X, const double *S, const double *u, double t, double *y, double *dy,
                    double *dX, double *dS, work *k) {
    const run *r = k->of;
    add_terms(X, S, u, t, dX, dS, k);
    k->is_known = dX != 0;
    double *values[8] = {y}, *all[8] = {y, k->fx, k->fp, k->fa};
    if (!S) { call(outputs_of, X, u, t, r->parameters, k->arg_a, values, k); return; }
    call(output_slopes_of, X, u, t, r->parameters, k->arg_a, all, k);
    for (int i = 0; i < r->measured; i++) chain(r->output[i], &of_outputs, S, dy + i * k->ns, k);
}

static void copy(double *to, const double *from, int count) {
    if (from) memcpy(to, from, count * sizeof(double));
    else memset(to, 0, count * sizeof(double));
}

/* memories without a rate follow their signal after each step: play, and a bristle that gives before it slides */
static void follow(double *X, double *S, const double *u, double t, const double *before, const double *dbefore, work *k) {
    const run *r = k->of;
    int ns = k->ns;
    for (int i = 0; i < r->terms; i++) {
        const term *q = r->term + i;
        if (!follows(q)) continue;
        int z = k->store[i], at = k->first[i] + coefficients(q), column = r->free + at;
        const double *ds;
        double w = q->scale * k->constant[at], s = signal(q->signal, X, S, u, t, k, k->ds, &ds);
        double *sz = S ? S + z * ns : 0;
        if (q->memory != DAHL) {
            double gap = s - X[z];
            if (fabs(gap) <= w) continue;
            double side = gap > 0.0 ? 1.0 : -1.0;
            X[z] = s - side * w;
            if (S) { copy(sz, ds, ns); sz[column] -= side * w; }
        } else {  /* dz = ds - |ds| z / w, exactly for a signal that moves one way within the step */
            double moved = s - before[i], side = moved < 0.0 ? -1.0 : 1.0, e = exp(-fabs(moved) / w), Z = X[z];
            X[z] = e * Z + side * w * (1.0 - e);
            if (S) {
                double by_moved = e * (1.0 - side * Z / w);
                for (int j = 0; j < ns; j++) sz[j] = e * sz[j] + by_moved * ((ds ? ds[j] : 0.0) - dbefore[i * ns + j]);
                sz[column] += e * Z * fabs(moved) / w + side * w * (1.0 - e) - side * e * fabs(moved);
            }
        }
    }
}

/* signals of bristles, from which they move within a step */
static void remember(const double *X, const double *S, double t, work *k) {
    const run *r = k->of;
    for (int i = 0; i < r->terms; i++)
        if (r->term[i].memory == DAHL) {
            const double *ds;
            k->before[i] = signal(r->term[i].signal, X, S, k->u, t, k, k->ds, &ds);
            if (S) copy(k->dbefore + i * k->ns, ds, k->ns);
        }
}

/* inputs at a share of the step after sample j */
static void set_inputs(int j, double share, work *k) {
    const run *r = k->of;
    const double *here = r->inputs + j * NU, *next = here + NU;
    for (int i = 0; i < NU; i++) {
        double change = next[i] - here[i];
        k->u[i] = r->smooth[i] ? here[i] + change * share : here[i];
        if (!r->bends || !r->smooth[i]) continue;
        double width = r->time[j + 1] - r->time[j];  /* Hermite's cubic, less the straight line */
        double first = width * r->bends[j * NU + i] - change, last = width * r->bends[(j + 1) * NU + i] - change;
        k->u[i] += share * (1.0 - share) * (first * (1.0 - share) - last * share);
    }
}

/* Go steps of length h from t0, which with its width is a part of the step after sample j. */
static void integrate(double *X, double *S, int j, double begin, double width, double t0, double h, int steps, work *k) {
    static const double part[4] = {0.0, 0.5, 0.5, 1.0};
    const run *r = k->of;
    int nX = NX + k->nz, m = nX * k->ns;
    double *K = k->K, *L = k->L;
    for (int sub = 0; sub < steps; sub++) {
        double t = t0 + sub * h;
        for (int stage = 0; stage < 4; stage++) {
            double step = part[stage] * h;
            set_inputs(j, begin + width * ((sub + part[stage]) / steps), k);
            const double *x = X, *s = S;
            if (stage) {
                const double *slope = K + (stage - 1) * nX, *dslope = L + (stage - 1) * m;
                for (int i = 0; i < nX; i++) k->Y[i] = X[i] + step * slope[i];
                if (S) for (int i = 0; i < m; i++) k->T[i] = S[i] + step * dslope[i];
                x = k->Y; s = S ? k->T : 0;
            }
            rates(x, s, k->u, t + step, K + stage * nX, S ? L + stage * m : 0, k);
            if (!stage) remember(X, S, t, k);
        }
        for (int i = 0; i < nX; i++) X[i] += h / 6.0 * (K[i] + 2.0 * K[nX + i] + 2.0 * K[2 * nX + i] + K[3 * nX + i]);
        if (S) for (int i = 0; i < m; i++) S[i] += h / 6.0 * (L[i] + 2.0 * L[m + i] + 2.0 * L[2 * m + i] + L[3 * m + i]);
        if (k->nz) {
            if (sub == steps - 1 && begin + width == 1.0) memcpy(k->u, r->inputs + (j + 1) * NU, NU * sizeof(double));
            see_laws(X, k->u, t + h, S != 0, k);
            follow(X, S, k->u, t + h, k->before, k->dbefore, k);
        }
    }
}

/* By how much the update of a clock changes with its instant, as inputs j go in straight lines. */
static void later(const double *X, double t, int j, int clock, double *by_time, work *k) {
    const run *r = k->of;
    const double *here = r->inputs + j * NU, width = r->time[j + 1] - r->time[j], d = LATER * width;
    double *values[8] = {by_time};
    for (int i = 0; i < NU; i++) if (r->smooth[i]) k->u[i] += LATER * (here[i + NU] - here[i]);
    add_terms(X, 0, k->u, t + d, 0, 0, k);
    call(updates_of[clock], X, k->u, t + d, r->parameters, k->arg_a, values, k);
    for (int i = 0; i < NU; i++) if (r->smooth[i]) k->u[i] -= LATER * (here[i + NU] - here[i]);
    for (int i = 0; i < NX; i++) by_time[i] = (by_time[i] - k->Y[i]) / d;
}

/* Add the rates of the states, times a sign, to their slopes by what shifts a clock. */
static void shift(const double *X, double *S, double t, int clock, double sign, work *k) {
    const run *r = k->of;
    const int *shifts = r->shifts + clock * r->free;
    k->is_known = 0;
    rates(X, 0, k->u, t, k->K, 0, k);
    for (int q = 0; q < r->free; q++)
        if (shifts[q]) for (int i = 0; i < NX + k->nz; i++) S[i * k->ns + q] += sign * k->K[i];
}

static int is_shifted(int clock, const work *k) {
    for (int q = 0; q < k->of->free; q++) if (k->of->shifts[clock * k->of->free + q]) return 1;
    return 0;
}

/* Update the discrete states of a clock, in the step after sample j. */
static void update(double *X, double *S, double t, int j, int clock, work *k) {
    int shifted = S && is_shifted(clock, k);
    if (shifted) shift(X, S, t, clock, 1.0, k);
    k->is_known = 0;
    add_terms(X, S, k->u, t, 0, 0, k);
    double *values[8] = {k->Y}, *all[8] = {k->Y, k->fx, k->fp, k->fa};
    call(updates_of[clock], X, k->u, t, k->of->parameters, k->arg_a, S ? all : values, k);
    if (k->nz) remember(X, S, t, k);
    if (S) {
        for (int i = 0; i < NX; i++) chain(i, of_updates + clock, S, k->T + i * k->ns, k);
        memcpy(S, k->T, NX * k->ns * sizeof(double));
    }
    if (shifted) {
        const int *shifts = k->of->shifts + clock * k->of->free;
        later(X, t, j, clock, k->L, k);
        for (int q = 0; q < k->of->free; q++)
            if (shifts[q]) for (int i = 0; i < NX; i++) S[i * k->ns + q] += k->L[i];
    }
    memcpy(X, k->Y, NX * sizeof(double));
    if (shifted) shift(X, S, t, clock, -1.0, k);
    if (k->nz) {
        see_laws(X, k->u, t, S != 0, k);
        follow(X, S, k->u, t, k->before, k->dbefore, k);
    }
}

/* Go from sample j to the next, with the ticks of the clocks before it. */
static void advance(double *X, double *S, int j, work *k) {
    const run *r = k->of;
    double first = r->time[j], last = r->time[j + 1], now = first, begin = 0.0;
    for (int i = r->tick[j]; i <= r->tick[j + 1]; i++) {
        int is_tick = i < r->tick[j + 1];
        double until = is_tick ? r->tick_time[i] : last, end = is_tick ? (until - first) / (last - first) : 1.0;
        if (until > now) {
            int steps = (int)ceil((end - begin) * r->substeps - 1e-9);
            steps = steps > 1 ? steps : 1;
            integrate(X, S, j, begin, end - begin, now, (until - now) / steps, steps, k);
        }
        if (is_tick) {
            set_inputs(j, end, k);
            update(X, S, until, j, r->tick_clock[i], k);
        }
        now = until;
        begin = end;
    }
}

/* Correct the states by what was measured at sample j. */
static void correct(double *X, double *S, int j, work *k) {
    const run *r = k->of;
    int ns = k->ns;
    k->is_known = 0;
    for (int m = 0; m < r->measured; m++) {
        int o = r->output[m];
        double error = r->observed[j * NY + o] - r->outputs[j * NY + o];
        const double *dy = S ? r->slopes + ((size_t)j * r->measured + m) * ns : 0;
        if (isnan(error)) continue;
        for (int i = 0; i < NX; i++) {
            double gain = r->gain[((size_t)j * NX + i) * NY + o];
            if (gain == 0.0) continue;
            X[i] += gain * error;
            if (S) for (int q = 0; q < ns; q++) S[i * ns + q] -= gain * dy[q];
        }
    }
}

static int simulate(work *k, double *X, double *S) {
    const run *r = k->of;
    int nX = NX + k->nz, ns = k->ns;
    double *own = r->sensitive ? S : 0;
    memcpy(X, r->start, NX * sizeof(double));
    for (int i = 0; i < r->starts; i++) S[r->state[i] * ns + ns - r->starts + i] = 1.0;
    see_laws(X, r->inputs, r->time[0], 1, k);
    for (int i = 0; i < r->terms; i++)  /* memories begin in equilibrium; bristles, heat and counts at rest */
        if (k->store[i] >= 0) {
            int rests = r->term[i].memory == DAHL || r->term[i].memory == HEAT || counts(r->term + i);
            const double *ds;
            double s = signal(r->term[i].signal, X, S, r->inputs, r->time[0], k, k->ds, &ds);
            X[k->store[i]] = rests ? 0.0 : s;
            if (!rests) copy(S + k->store[i] * ns, ds, ns);
        }
    for (int j = 0; j < r->n; j++) {
        observe(X, own, r->inputs + j * NU, r->time[j], r->outputs + j * NY, own ? r->slopes + (size_t)j * r->measured * ns : 0,
                k->K, own ? k->L : 0, k);
        if (r->states) memcpy(r->states + (size_t)j * nX, X, nX * sizeof(double));
        for (int i = 0; i < nX; i++) if (!(fabs(X[i]) < LARGEST)) return j + 1;
        for (int i = 0; i < NY; i++) if (!(fabs(r->outputs[j * NY + i]) < LARGEST)) return j + 1;
        if (r->gain) correct(X, own, j, k);
        if (j < r->n - 1 && nX) advance(X, own, j, k);
    }
    return 0;
}

enum columns { OF_STARTS, OF_STATES, OF_LAWS_AND_STATES };

/* Set up the work of a run, with columns for start states or, for a linearisation, all states, and
 * before them for additions to all laws. Returns a state and its slopes. */
static double *prepare(work *k, const run *r, enum columns which) {
    *k = (work){.of = r, .all_laws = which == OF_LAWS_AND_STATES};
    int *integers = calloc(4 * r->terms + 4 + NP + 2 * NL + LAWS_IW + 1, sizeof(int));
    if (!integers) return 0;
    k->first = integers;
    k->store = integers + r->terms + 1;
    k->row = integers + 2 * r->terms + 2;
    k->law = integers + 3 * r->terms + 3;
    k->place = k->law + r->terms + 1 + NL;
    k->column = k->place + NL;
    k->iw = k->column + NP;
    for (int i = 0; i < NP; i++) k->column[i] = -1;
    for (int i = 0; i < r->free; i++) k->column[r->position[i]] = i;
    if (k->all_laws) while (k->changed < NL) k->law[k->changed] = k->changed, k->changed++;
    for (int i = 0, at = 0; i < r->terms; i++) {
        const term *q = r->term + i;
        k->first[i] = at;
        k->store[i] = q->memory == NONE ? -1 : NX + k->nz++;
        at += coefficients(q) + of_memory(q) + has_width(q);
        while (k->row[i] < k->changed && k->law[k->row[i]] != q->law) k->row[i]++;
        if (k->row[i] == k->changed) k->law[k->changed++] = q->law;
        k->of_laws |= is_law(q->signal) || is_law(q->factor);
    }
    for (int i = 0; i < NL; i++) k->place[i] = -1;
    for (int i = 0; i < k->changed; i++) k->place[k->law[i]] = i;
    int nX = NX + k->nz, rows = NX > NY ? NX : NY;
    int ns = k->ns = r->free + r->constants + (k->all_laws ? NL : 0) + (which == OF_STARTS ? r->starts : nX);
    size_t own = r->constants + 2 * NL + k->changed * ns + NL * (1 + NX + NP) + rows * (NX + NP + NL) + 3 * ns + LAWS_W + 16;
    size_t spare = (size_t)nX * (6 + 6 * ns) + NU + NY + 2 + (r->terms + 1) * (1 + ns) + 16;
    double *at = calloc(own + spare, sizeof(double));
    if (!at) { free(integers); return 0; }
#define TAKE(name, count) k->name = at; at += (count)
    TAKE(constant, r->constants);
    for (int i = 0; i < r->constants; i++) k->constant[i] = exp(r->values[i]);
    TAKE(arg_a, NL + 1); TAKE(none, NL + 1); TAKE(da, k->changed * ns + 1); TAKE(g, NL + 1); TAKE(gx, NL * NX + 1); TAKE(gp, NL * NP + 1);
    TAKE(fx, rows * NX + 1); TAKE(fp, rows * NP + 1); TAKE(fa, rows * NL + 1);
    TAKE(ds, ns); TAKE(dv, ns); TAKE(dm, ns); TAKE(w, LAWS_W + 1);
    TAKE(Y, nX); TAKE(K, 4 * nX); TAKE(T, nX * ns); TAKE(L, 4 * nX * ns);
    TAKE(u, NU + 1); TAKE(before, r->terms + 1); TAKE(dbefore, r->terms * ns + 1);
    return at;
}

static void release(work *k) {
    free(k->constant);
    free(k->first);
}

/* Return 0, or the number of the sample, from 1, at which the run leaves its range; -1 without memory. */
EXPORT int free_run(const run *r) {
    work k;
    double *X = prepare(&k, r, OF_STARTS);
    if (!X) return -1;
    int failed = simulate(&k, X, X + NX + k.nz);
    release(&k);
    return failed;
}

/* Values of a term's shapes, (n, coefficients), at values of its signal. */
EXPORT void shapes(const term *q, int n, const double *v, double log_width, double *out) {
    int nc = coefficients(q);
    double w = has_width(q) ? exp(log_width) : 1.0, by_z, by_w;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < nc; j++) shape_at(q, j, (v[i] - q->middle) / q->scale, w, out + i * nc + j, &by_z, &by_w);
}

/* elements of a matrix, stored by columns */
static void scatter(const pattern *of, int rows, const double *values, double *matrix) {
    for (int i = 0; i < rows; i++)
        for (int e = of->start[i]; e < of->start[i + 1]; e++) matrix[of->column[e] * rows + i] = values[of->from[e]];
}

/* Derivatives of rates (n, NX + memories, ns) and outputs (n, NY, ns) along a course of all states,
 * memories included: by free parameters, values of terms, and states. Those by additions to laws,
 * (n, NX, NL) and (n, NY, NL), are stored by columns, zeros before; the laws are (n, NL). */
EXPORT int linearise(const run *r, const double *states, double *rate_slopes, double *output_slopes,
                     double *by_laws, double *output_by_laws, double *laws) {
    work k;
    double *S = prepare(&k, r, OF_STATES);
    if (!S) return -1;
    int nX = NX + k.nz, ns = k.ns;
    double *dX = S + nX * ns, *y = dX + nX;
    for (int i = 0; i < nX; i++) S[i * ns + ns - nX + i] = 1.0;
    for (int j = 0; j < r->n; j++) {
        const double *X = states + j * nX, *u = r->inputs + j * NU;
        rates(X, S, u, r->time[j], dX, rate_slopes + (size_t)j * nX * ns, &k);
        scatter(&of_rates.a, NX, k.fa, by_laws + (size_t)j * NX * NL);
        observe(X, S, u, r->time[j], y, output_slopes + (size_t)j * r->measured * ns, 0, 0, &k);
        scatter(&of_outputs.a, NY, k.fa, output_by_laws + (size_t)j * NY * NL);
        double *results[8] = {laws + j * NL};
        call(laws_of, X, u, r->time[j], r->parameters, k.none, results, &k);
    }
    release(&k);
    return 0;
}

/* Derivatives (n - 1, NX + memories, ns) of the states at the next sample along a course of all
 * states: by free parameters, values of terms, additions to laws that stay for the step, and states. */
EXPORT int steps(const run *r, const double *states, double *slopes) {
    work k;
    double *X = prepare(&k, r, OF_LAWS_AND_STATES);
    if (!X) return -1;
    int nX = NX + k.nz, ns = k.ns;
    for (int j = 0; j < r->n - 1; j++) {
        double *S = slopes + (size_t)j * nX * ns;
        memset(S, 0, nX * ns * sizeof(double));
        for (int i = 0; i < nX; i++) S[i * ns + ns - nX + i] = 1.0;
        memcpy(X, states + j * nX, nX * sizeof(double));
        advance(X, S, j, &k);
    }
    release(&k);
    return 0;
}

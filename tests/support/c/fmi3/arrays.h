/* dx/dt = A x + B u, y = C x: arrays in, arrays out, of any size. */
#ifndef N
#define N 3
#endif
#define TOKEN "arrays"
typedef struct Model {
    double time, x[N], rate[N], A[N][N], B[N][2], C[2][N], u[2], y[2];
    uint64_t n;
} Model;
enum { COUNT_OF_STATES = N, STATES_AT = offsetof(Model, x), RATES_AT = offsetof(Model, rate) };
static const Slot SLOTS[] = {
    {0, FLOAT64, 1, offsetof(Model, time), 0},      {1, UINT64, 1, offsetof(Model, n), 0},
    {2, FLOAT64, N * N, offsetof(Model, A), 1},     {3, FLOAT64, N * 2, offsetof(Model, B), 1},
    {4, FLOAT64, 2 * N, offsetof(Model, C), 1},     {5, FLOAT64, 2, offsetof(Model, u), 1},
    {6, FLOAT64, N, offsetof(Model, x), 1},         {7, FLOAT64, N, offsetof(Model, rate), 0},
    {8, FLOAT64, 2, offsetof(Model, y), 0},
};
static void start(Model *m) {
    m->n = N;
    for (int i = 0; i < N; i++) {
        m->A[i][i] = -1.0 - i;
        if (i + 1 < N) m->A[i][i + 1] = 0.5;
        m->B[i][i % 2] = 1.0;
        m->C[i % 2][i] = 1.0;
        m->x[i] = 0.1 * (i + 1);
    }
}
static void rates(const Model *m, const double x[N], double rate[N]) {
    for (int i = 0; i < N; i++) {
        rate[i] = m->B[i][0] * m->u[0] + m->B[i][1] * m->u[1];
        for (int k = 0; k < N; k++) rate[i] += m->A[i][k] * x[k];
    }
}
static void evaluate(Model *m) {
    rates(m, m->x, m->rate);
    for (int i = 0; i < 2; i++) {
        m->y[i] = 0.0;
        for (int k = 0; k < N; k++) m->y[i] += m->C[i][k] * m->x[k];
    }
}
/* The series of the matrix exponential: x + h x' + h^2/2 x'' + ... */
static void advance(Model *m, double h) {
    double term[N], next[N];
    rates(m, m->x, term);
    for (int order = 1; order < 60; order++) {
        for (int i = 0; i < N; i++) {
            term[i] *= h / order;
            m->x[i] += term[i];
        }
        for (int i = 0; i < N; i++) {
            next[i] = 0.0;
            for (int k = 0; k < N; k++) next[i] += m->A[i][k] * term[k];
        }
        memcpy(term, next, sizeof term);
    }
}
static double next_event(const Model *m) {
    (void)m;
    return INFINITY;
}
static void handle_event(Model *m) { (void)m; }
static void tangent(Model *m) {
    memset(m->x, 0, sizeof m->x);
    memset(m->u, 0, sizeof m->u);
}

/* y[k] = 2 u[k], of many elements. */
#ifndef N
#define N 1000
#endif
#define TOKEN "wide"
typedef struct Model {
    double time, u[N], y[N];
} Model;
enum { COUNT_OF_STATES = 0, STATES_AT = 0, RATES_AT = 0 };
static const Slot SLOTS[] = {
    {0, FLOAT64, 1, offsetof(Model, time), 0},
    {1, FLOAT64, N, offsetof(Model, u), 1},
    {2, FLOAT64, N, offsetof(Model, y), 0},
};
static void start(Model *m) { (void)m; }
static void evaluate(Model *m) {
    for (int k = 0; k < N; k++) m->y[k] = 2.0 * m->u[k];
}
static void advance(Model *m, double h) { (void)m, (void)h; }
static double next_event(const Model *m) {
    (void)m;
    return INFINITY;
}
static void handle_event(Model *m) { (void)m; }
static void tangent(Model *m) { memset(m->u, 0, sizeof m->u); }

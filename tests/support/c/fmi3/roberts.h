/* Robertson's problem, stiff over eleven decades of time (E. Hairer, G. Wanner, Solving Ordinary Differential Equations
 * II, 2nd ed., Springer 1996, eq. IV.1.4). */
#define TOKEN "roberts"
#define NOMINALS {1e-6, 1e-10, 1.0}
typedef struct Model {
    double time, y[3], rates[3];
} Model;
enum { COUNT_OF_STATES = 3, STATES_AT = offsetof(Model, y), RATES_AT = offsetof(Model, rates) };
static const Slot SLOTS[] = {
    {0, FLOAT64, 1, offsetof(Model, time), 0},
    {1, FLOAT64, 3, offsetof(Model, y), 1},
    {2, FLOAT64, 3, offsetof(Model, rates), 0},
};
static void start(Model *m) { m->y[0] = 1.0; }
static void evaluate(Model *m) {
    const double *y = m->y;
    double slow = 0.04 * y[0], fast = 1e4 * y[1] * y[2], middle = 3e7 * y[1] * y[1];
    m->rates[0] = fast - slow;
    m->rates[1] = slow - fast - middle;
    m->rates[2] = middle;
}
static void advance(Model *m, double h) { (void)m, (void)h; }
static double next_event(const Model *m) {
    (void)m;
    return INFINITY;
}
static void handle_event(Model *m) { (void)m; }
static void tangent(Model *m) { (void)m; }

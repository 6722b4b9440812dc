/* tau dx/dt = k u - x, y = x: a lag whose input is held through a step. */
#define TOKEN "lag"
typedef struct Model {
    double time, x, rate, u, y, k, tau;
} Model;
enum { COUNT_OF_STATES = 1, STATES_AT = offsetof(Model, x), RATES_AT = offsetof(Model, rate) };
static const Slot SLOTS[] = {
    {0, FLOAT64, 1, offsetof(Model, time), 0}, {10, FLOAT64, 1, offsetof(Model, u), 1},
    {11, FLOAT64, 1, offsetof(Model, y), 0},   {12, FLOAT64, 1, offsetof(Model, x), 1},
    {13, FLOAT64, 1, offsetof(Model, rate), 0}, {7, FLOAT64, 1, offsetof(Model, k), 1},
    {900, FLOAT64, 1, offsetof(Model, tau), 1},
};
static void start(Model *m) {
    m->k = 2.0;
    m->tau = 0.5;
    m->x = 0.25;
}
static void evaluate(Model *m) {
    m->rate = (m->k * m->u - m->x) / m->tau;
    m->y = m->x;
}
static void advance(Model *m, double h) {
    m->x = m->k * m->u + (m->x - m->k * m->u) * exp(-h / m->tau);
}
static double next_event(const Model *m) {
    (void)m;
    return INFINITY;
}
static void handle_event(Model *m) { (void)m; }
static void tangent(Model *m) { m->x = m->u = 0.0; }

/* dx/dt = slope; at every multiple of the period x falls to 0 and the count rises; `manner` breaks the rules. */
#define TOKEN "sawtooth"
typedef struct Model {
    double time, x, rate, slope, period;
    int32_t count, manner;
} Model;
enum { COUNT_OF_STATES = 1, STATES_AT = offsetof(Model, x), RATES_AT = offsetof(Model, rate) };
static const Slot SLOTS[] = {
    {0, FLOAT64, 1, offsetof(Model, time), 0},   {1, FLOAT64, 1, offsetof(Model, x), 1},
    {2, FLOAT64, 1, offsetof(Model, rate), 0},   {3, FLOAT64, 1, offsetof(Model, slope), 1},
    {4, FLOAT64, 1, offsetof(Model, period), 1}, {5, INT32, 1, offsetof(Model, count), 0},
    {6, INT32, 1, offsetof(Model, manner), 1},
};
static void start(Model *m) {
    m->slope = 1.0;
    m->period = 0.3;
}
static void evaluate(Model *m) { m->rate = m->slope; }
static void advance(Model *m, double h) { m->x += m->slope * h; }
static double next_event(const Model *m) { return m->period < 1e-3 ? INFINITY : (m->count + 1) * m->period; }
static void handle_event(Model *m) {
    m->x = 0.0;
    m->count++;
}
static void tangent(Model *m) { m->x = 0.0; }
static int misbehave(Model *m, fmi3Boolean *events, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    switch (m->manner) {
    case 1: /* returns early, which was not allowed */ *early = 1; return 1;
    case 2: /* asks for event mode, which is not used */ *events = 1; return 0;
    case 3: /* asks to end the simulation */ *terminate = 1; return 1;
    case 4: /* returns early and gets nowhere */
        *early = 1;
        *last = m->time = 0.0;
        m->count = -1;
        m->period = 1e-3;
        return 1;
    }
    return 0;
}
#define RUDE misbehave
#define ENDS(m) ((m)->manner == 3)

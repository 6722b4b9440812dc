/* Clocks: one every 0.1 s, or 0.05 s later if its description does not say so, which adds up the input; one once,
 * 0.05 s after the third tick of the first; and one whose intervals are 0.1, 0.2, 0.3, ... s. An output clock is active at
 * every second tick of the first, until it is asked. */
#define TOKEN "clocked"
#define CLOCKS
typedef struct Model {
    double time, fired;
    int32_t u, sum, count, changes, is_armed, is_told, is_even;
} Model;
enum { COUNT_OF_STATES = 0, STATES_AT = 0, RATES_AT = 0, EVERY = 10, ONCE = 11, SLOWER = 12, EVEN = 14 };
static const Slot SLOTS[] = {
    {0, FLOAT64, 1, offsetof(Model, time), 0},
    {1, INT32, 1, offsetof(Model, u), 1},
    {2, INT32, 1, offsetof(Model, sum), 0},
    {3, INT32, 1, offsetof(Model, count), 0},
    {4, FLOAT64, 1, offsetof(Model, fired), 0},
    {5, INT32, 1, offsetof(Model, changes), 0},
};
static void start(Model *m) { m->u = 1; }
static void evaluate(Model *m) { (void)m; }
static void advance(Model *m, double h) { (void)m, (void)h; }
static double next_event(const Model *m) {
    (void)m;
    return INFINITY;
}
static void handle_event(Model *m) { (void)m; }
static void tangent(Model *m) { (void)m; }
static void tick(Model *m, fmi3ValueReference clock) {
    if (clock == ONCE) m->fired = m->time;
    if (clock == SLOWER) {
        m->changes++;
        m->is_told = 0;
    }
    if (clock != EVERY) return;
    m->sum += m->u;
    m->is_armed = ++m->count == 3;
    m->is_even = m->count % 2 == 0;
}
static int take_activation(Model *m, fmi3ValueReference clock) {
    int active = clock == EVEN && m->is_even;
    m->is_even = 0;
    return active;
}
static double shift_of(fmi3ValueReference clock) { return clock == EVERY ? 0.05 : 0.0; }
static int tell_interval(Model *m, fmi3ValueReference clock, double *seconds) {
    *seconds = 0.1;
    if (clock == EVERY) return 1;
    int *is_told = clock == ONCE ? NULL : &m->is_told;
    *seconds = clock == ONCE ? 0.05 : 0.1 * (m->changes + 1);
    int changed = is_told ? !*is_told : m->is_armed;
    if (is_told) *is_told = 1;
    if (clock == ONCE) m->is_armed = 0;
    return changed;
}

/* The stepping kernel: carries out, communication point by communication point, the operations that a master has listed.
 *
 * The list is made in Python (`program.py`), which also says what a failure means. Here is only what is done at every
 * point: FMI 2.0 calls, values that are passed on, a row that is kept. Whatever is rare goes back to the caller, who
 * finds in the run where it stands, and may carry on from there.
 */
#ifdef _WIN32
#include <windows.h>
#else
#define _POSIX_C_SOURCE 199309L /* for clock_gettime in strict C99 */
#endif
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* Functions of FMI 2.0, as far as they are called here; of the same shape for integers and for booleans. */
typedef int do_step(void *component, double now, double size, int no_state_set_before);
typedef int set_real(void *component, const unsigned *references, size_t count, const double *values);
typedef int get_real(void *component, const unsigned *references, size_t count, double *values);
typedef int set_whole(void *component, const unsigned *references, size_t count, const int *values);
typedef int get_whole(void *component, const unsigned *references, size_t count, int *values);

enum { FMI_OK, FMI_WARNING };

typedef enum {
    STEP, /* from values[point] to ends[point] */
    SET_REAL,
    GET_REAL,
    SET_INTEGER,
    SET_BOOLEAN,
    GET_WHOLE, /* integers, booleans */
    PASS,  /* from an output to an input, unless it is no number */
    SCALE, /* the same with factor and offset */
    DRIVE, /* an input gets a value from outside */
    DISTURB, /* and here it is added */
    KEEP,    /* a row of the record */
    CALL,    /* the caller has to do something */
    BEGIN,   /* time of the owners is taken from here, ... */
    SPENT    /* ... and what passed since is this owner's */
} kind;

typedef struct {
    double *target;
    const double *source;
    size_t stride; /* of a source with a value for every point; else 0 */
    double factor, offset;
} link;

typedef struct {
    int kind, owner;
    void (*function)(void);
    void *component;
    const unsigned *references;
    size_t count;
    double *values; /* at point k: values + k * stride */
    size_t stride;
    const double *ends;
    int *integers;        /* room for whole numbers; of a step whether no state will be set again */
    const size_t *places; /* of whole numbers among the values */
    const link *links;
} operation;

typedef struct {
    const operation *program;
    size_t length;
    size_t point, position;   /* what is to be done next */
    size_t row;               /* kept next */
    int status, index;        /* answer of a call; which link or value is meant */
    volatile int interrupted; /* set from another thread: come back before the next point */
    double then;
    double *seconds;     /* by owner */
    long long *warnings; /* by owner */
} run;

/* Why the kernel came back. */
enum { DONE, PAUSED, FAILED, NO_NUMBER, NOT_OF_TYPE, CALLING };

static double seconds(void) {
#ifdef _WIN32
    LARGE_INTEGER now, frequency;
    QueryPerformanceCounter(&now);
    QueryPerformanceFrequency(&frequency);
    return (double)now.QuadPart / (double)frequency.QuadPart;
#else
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
#endif
}

/* Whether an integer or a boolean holds the value; a number that is none holds nothing. */
static int fits(kind k, double value) {
    if (k == SET_BOOLEAN) return value == 0.0 || value == 1.0;
    return value >= -2147483648.0 && value <= 2147483647.0 && value == (double)(int)value;
}

/* Pass values on; returns the number of the first that is no number, or the count. */
static size_t pass(const operation *o) {
    for (size_t i = 0; i < o->count; i++) {
        const link *l = &o->links[i];
        double value = o->kind == PASS ? *l->source : l->factor * *l->source + l->offset;
        if (value - value != 0.0) return i;
        *l->target = value;
    }
    return o->count;
}

/* A call that moves whole numbers; returns why to go back, DONE if there is no reason. */
static int move_whole(run *r, const operation *o, double *values, int *status) {
    if (o->kind == GET_WHOLE) {
        *status = ((get_whole *)o->function)(o->component, o->references, o->count, o->integers);
        for (size_t i = 0; i < o->count; i++) values[o->places[i]] = o->integers[i];
        return DONE;
    }
    for (size_t i = 0; i < o->count; i++) {
        double value = values[o->places[i]];
        if (!fits((kind)o->kind, value)) {
            r->index = (int)i;
            return NOT_OF_TYPE;
        }
        o->integers[i] = (int)value;
    }
    *status = ((set_whole *)o->function)(o->component, o->references, o->count, o->integers);
    return DONE;
}

static int carry_out(run *r, const operation *o) {
    size_t k = r->point;
    double *values = o->values + k * o->stride, now;
    int status = FMI_OK, reason;
    switch ((kind)o->kind) {
    case STEP:
        status = ((do_step *)o->function)(o->component, *values, o->ends[k] - *values, *o->integers);
        break;
    case SET_REAL:
        status = ((set_real *)o->function)(o->component, o->references, o->count, values);
        break;
    case GET_REAL:
        status = ((get_real *)o->function)(o->component, o->references, o->count, values);
        break;
    case SET_INTEGER:
    case SET_BOOLEAN:
    case GET_WHOLE:
        if ((reason = move_whole(r, o, values, &status)) != DONE) return reason;
        break;
    case PASS:
    case SCALE:
        if ((r->index = (int)pass(o)) < (int)o->count) return NO_NUMBER;
        return DONE;
    case DRIVE:
        for (size_t i = 0; i < o->count; i++) *o->links[i].target = o->links[i].source[k * o->links[i].stride];
        return DONE;
    case DISTURB:
        for (size_t i = 0; i < o->count; i++) *o->links[i].target += o->links[i].source[k * o->links[i].stride];
        return DONE;
    case KEEP:
        memcpy(o->values + r->row++ * o->count, o->ends, o->count * sizeof(double));
        return DONE;
    case CALL:
        r->position++; /* go on behind it */
        return CALLING;
    case BEGIN:
        r->then = seconds();
        return DONE;
    case SPENT:
        now = seconds();
        r->seconds[o->owner] += now - r->then;
        r->then = now;
        return DONE;
    }
    if (status == FMI_WARNING)
        r->warnings[o->owner]++;
    else if (status != FMI_OK) {
        r->status = status;
        return FAILED;
    }
    return DONE;
}

/* Carry on up to a point, which is left out. */
EXPORT int ppy_run(run *r, size_t until) {
    for (; r->point < until; r->point++, r->position = 0) {
        if (r->position == 0 && r->interrupted) return PAUSED;
        while (r->position < r->length) {
            int reason = carry_out(r, &r->program[r->position]);
            if (reason != DONE) return reason;
            r->position++;
        }
    }
    return DONE;
}

/* ---- the end of the process ---------------------------------------------------------------------- */

static const volatile int *open_fmus;
static const char *last_words;

/* Python ends a process only when none is open: so it was an FMU, which must not look like success. */
static void at_exit(void) {
    if (*open_fmus > 0) {
        fputs(last_words, stderr);
        fflush(stderr);
        _Exit(2);
    }
}

EXPORT void ppy_watch_exit(const volatile int *count, const char *words) {
    open_fmus = count;
    last_words = words;
    atexit(at_exit);
}

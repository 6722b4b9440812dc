/* FMI 3.0: arrays, whose value reference is that of their first element. */
#ifndef ARRAYS_H
#define ARRAYS_H

#include "instance.h"

/* Whether variables are scalars with a value each, as in most calls. */
static bool are_scalars(const Reference vr[], size_t n, size_t n_values);

/* References of all elements of some variables, in the order of their values. */
typedef struct {
    const Reference *vr;
    size_t n;
    Reference *allocated; /* NULL where all variables are scalars */
} Elements;

/* Finds the elements of variables, which have `n_values` values. False, with a report, if it is another number, or a
   reference is inside an array. To be released then as well. */
static bool find_elements(const Instance *instance, const char *function, const Reference vr[], size_t n,
                          size_t n_values, Elements *elements);

static void release(Elements *elements);

#endif

/* FMI 3.0: arrays, whose value reference is that of their first element. */
#include "arrays.h"

#include <stdlib.h>

typedef struct {
    const char *name;
    Reference first;
    size_t size;
} Array;

#define ARRAY(name, first, size) {name, first, size},
static const Array arrays[] = {MODEL_ARRAYS(ARRAY){"", 0, 0}};
#undef ARRAY

/* Written out, since hosts ask for single scalars at every step. */
static bool is_scalar(Reference vr) {
    (void)vr; /* where there are no arrays */
#define OUTSIDE(name, first, size) &&vr - (Reference)(first) >= (size)
    return true MODEL_ARRAYS(OUTSIDE);
#undef OUTSIDE
}

/* The array with an element of a reference; NULL for a scalar. */
static const Array *array_of(Reference vr) {
    const Array *array = arrays;
    if (is_scalar(vr))
        return NULL;
    while (vr - array->first >= array->size)
        array++;
    return array;
}

static bool miscounted(const Instance *instance, const char *function, size_t n, size_t n_values, size_t size,
                       const Array *array) {
    if (instance != NULL && array != NULL)
        report(instance, fmi3Error, "%s: %zu values for %zu variables, which have %zu; '%s' has %zu", function,
               n_values, n, size, array->name, array->size);
    else if (instance != NULL)
        report(instance, fmi3Error, "%s: %zu values for %zu variables, which are scalars", function, n_values, n);
    return false;
}

/* References of elements; NULL without memory. */
static Reference *listed(const Reference vr[], size_t n, size_t size) {
    Reference *elements = malloc(size * sizeof *elements), *next = elements;
    for (size_t i = 0; elements != NULL && i < n; i++) {
        const Array *array = array_of(vr[i]);
        for (size_t k = 0; k < (array == NULL ? 1 : array->size); k++)
            *next++ = vr[i] + (Reference)k;
    }
    return elements;
}

bool are_scalars(const Reference vr[], size_t n, size_t n_values) {
    bool all = n == n_values && vr != NULL;
    for (size_t i = 0; all && i < n; i++)
        all = is_scalar(vr[i]);
    return all;
}

bool find_elements(const Instance *instance, const char *function, const Reference vr[], size_t n, size_t n_values,
                   Elements *elements) {
    const Array *last = NULL;
    size_t size = n;
    *elements = (Elements){vr, n, NULL};
    for (size_t i = 0; vr != NULL && i < n; i++) {
        const Array *array = array_of(vr[i]);
        if (array == NULL)
            continue;
        if (array->first != vr[i]) {
            if (instance != NULL)
                report(instance, fmi3Error, "%s: value reference %u is inside of '%s', whose reference is %u", function,
                       vr[i], array->name, array->first);
            return false;
        }
        size += array->size - 1;
        last = array;
    }
    if (n_values != size)
        return miscounted(instance, function, n, n_values, size, last);
    if (last == NULL)
        return true;
    elements->allocated = listed(vr, n, size);
    if (elements->allocated == NULL) {
        if (instance != NULL)
            report(instance, fmi3Error, "%s: there is no memory for %zu value references", function, size);
        return false;
    }
    elements->vr = elements->allocated;
    elements->n = size;
    return true;
}

void release(Elements *elements) { free(elements->allocated); }

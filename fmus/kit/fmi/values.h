/* Reading and writing of variables, for the files of one version. */
#ifndef VALUES_H
#define VALUES_H

#include "instance.h"

/* Number `i` of an array of the host, whose elements have a type of its version. */
typedef double Number(const void *values, size_t i);

/* Whether the host passed arrays where there should be some; reports it if not. */
static inline bool given(const Instance *instance, const char *function, const Reference vr[], size_t n,
                         const void *values);

/* Whether the host passed usable arrays and references of the right type; reports it if not. */
static inline bool valid(const Instance *instance, const char *function, Type type, const Reference vr[], size_t n,
                         const void *values);

/* Brings up to date what these references read. */
static Status readable(Instance *instance, const char *function, Type type, const Reference vr[], size_t n,
                       const void *values);

static Status get_reals(Instance *instance, const char *function, const Reference vr[], size_t n, double value[]);
static Status get_integers(Instance *instance, const char *function, const Reference vr[], size_t n, int32_t value[]);
static Status get_texts(Instance *instance, const char *function, const Reference vr[], size_t n, const char *value[]);

/* All values are checked before the first is written. */
static Status set_numbers(Instance *instance, const char *function, Type type, const Reference vr[], size_t n,
                          const void *values, Number *number);
static Status set_texts(Instance *instance, const char *function, const Reference vr[], size_t n,
                        const char *const value[]);

#endif

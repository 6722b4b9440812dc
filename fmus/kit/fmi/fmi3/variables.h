/* FMI 3.0: what has a value reference in this version only. */
#ifndef VARIABLES_H
#define VARIABLES_H

#include "instance.h"

/* The references of all other variables come first (engine.h). */
enum { FIRST_INDICATOR = TIME + 1, FIRST_CLOCK = FIRST_INDICATOR + MODEL_INDICATORS };

/* Whether it is that of a number. */
static inline bool is_own(Reference vr) { return vr >= TIME && vr < FIRST_CLOCK; }

static inline bool is_clock(Reference vr) { return vr >= FIRST_CLOCK && vr < FIRST_CLOCK + MODEL_GROUPS; }

#endif

/* FMI 3.0: what has a value reference in this version only. */
#ifndef VARIABLES_H
#define VARIABLES_H

#include "instance.h"

/* The references of all other variables come first (engine.h). */
enum { FIRST_INDICATOR = TIME + 1 };

static inline bool is_own(Reference vr) { return vr >= TIME && vr < TIME + OWN_REFERENCES; }

#endif

/* A clock that never jumps. */
#ifndef CLOCK_H
#define CLOCK_H

#include "platform.h"

/* Seconds since some instant; never set, never going back. */
static double clock_now(void);

/* Waits until `clock_now()` is `until`; not at all if that has passed. */
static void clock_sleep(double until);

/* Asks the system for waits as fine as it has them, until the matching clock_coarse. */
static void clock_fine(void);
static void clock_coarse(void);

#endif

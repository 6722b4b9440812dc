/* A clock that never jumps. */
#ifndef CLOCK_H
#define CLOCK_H

#include "platform.h"

/* Seconds since some instant; never set, never going back. */
double clock_now(void);

/* Waits until `clock_now()` is `until`; not at all if that has passed. */
void clock_sleep(double until);

/* Asks the system for waits as fine as it has them, until the matching clock_coarse. */
void clock_fine(void);
void clock_coarse(void);

#endif

/* The monotonic clock and waiting on it. */
#include "clock.h"

#ifdef _WIN32
#include <winsock2.h>
#include <windows.h>
#include <mmsystem.h>
#include <timeapi.h>

double clock_now(void) {
    LARGE_INTEGER ticks, frequency;
    QueryPerformanceFrequency(&frequency);
    QueryPerformanceCounter(&ticks);
    return (double)ticks.QuadPart / (double)frequency.QuadPart;
}

static void clock_pause(double seconds) { Sleep((DWORD)(1e3 * seconds) + 1); }

/* Without it waits end on the tick of the system, every 15.6 ms. */
void clock_fine(void) { timeBeginPeriod(1); }
void clock_coarse(void) { timeEndPeriod(1); }

#else
#include <errno.h>
#include <time.h>

double clock_now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void clock_pause(double seconds) {
    struct timespec t;
    t.tv_sec = (time_t)seconds;
    t.tv_nsec = (long)(1e9 * (seconds - (double)t.tv_sec));
    nanosleep(&t, NULL); /* a signal ends it early; the caller looks at the clock again */
}

void clock_fine(void) {}
void clock_coarse(void) {}
#endif

void clock_sleep(double until) {
    double left;
    while ((left = until - clock_now()) > 0.0)
        clock_pause(left < 3600.0 ? left : 3600.0);
}

/* What has to be said before any header of the system is read; every file of the proxy begins with it. */
#ifndef PLATFORM_H
#define PLATFORM_H

#ifdef _WIN32
#define _CRT_RAND_S /* rand_s, which has its numbers from the system */
#ifndef WIN32_LEAN_AND_MEAN
#define WIN32_LEAN_AND_MEAN
#endif
#ifndef NOMINMAX
#define NOMINMAX
#endif
#else
/* Sockets and the monotonic clock also with -std=c99; the second is for what macOS hides behind the first. */
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif
#ifndef _DARWIN_C_SOURCE
#define _DARWIN_C_SOURCE 1
#endif
#endif

#endif

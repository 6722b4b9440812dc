/* TCP sockets that never block: POSIX and Winsock behind one face. */
#ifndef SOCKETS_H
#define SOCKETS_H

#include "platform.h"

#include <stdbool.h>
#include <stddef.h>

#ifdef _WIN32
#include <winsock2.h>
#include <ws2tcpip.h>
typedef SOCKET Socket;
#define NO_SOCKET INVALID_SOCKET
#else
typedef int Socket;
#define NO_SOCKET (-1)
#endif

/* An address of this machine: ::1, or one of 127.0.0.0/8. */
typedef struct {
    bool version_6;
    unsigned char host[4]; /* of version 4 */
    unsigned short port;
} Address;

/* Once per instance, before and after everything else. */
static bool sockets_start(void);
static void sockets_stop(void);

/* Begins to connect; NO_SOCKET if that is impossible or refused at once. */
static Socket socket_connect(const Address *address);

/* Whether the connection stands, once socket_wait has said that it can be written to. */
static bool socket_is_connected(Socket handle);

/* Waits until there is something to read, or room to write; false after `seconds`. A broken connection is both. */
static bool socket_wait(Socket handle, bool writing, double seconds);

/* Bytes that went through; 0 if none can at present; -1 if the connection is gone. */
static long socket_send(Socket handle, const void *data, size_t size);
static long socket_receive(Socket handle, void *data, size_t size);

static void socket_close(Socket handle);

#endif

/* TCP sockets that never block. */
#include "sockets.h"

#include <string.h>

#ifdef _WIN32

typedef int Length;
static bool again(void) {
    int error = WSAGetLastError();
    return error == WSAEWOULDBLOCK || error == WSAEINPROGRESS || error == WSAEINTR;
}
bool sockets_start(void) {
    WSADATA data;
    return WSAStartup(MAKEWORD(2, 2), &data) == 0;
}
void sockets_stop(void) { WSACleanup(); }
static bool prepare(Socket handle) {
    u_long on = 1;
    return ioctlsocket(handle, FIONBIO, &on) == 0;
}
static void close_handle(Socket handle) { closesocket(handle); }
enum { SEND_FLAGS = 0, BOTH_WAYS = SD_BOTH };

#else

#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <unistd.h>

typedef socklen_t Length;
static bool again(void) {
    return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINPROGRESS || errno == EINTR;
}
bool sockets_start(void) { return true; }
void sockets_stop(void) {}
static bool prepare(Socket handle) {
#ifdef SO_NOSIGPIPE
    int on = 1;
    if (setsockopt(handle, SOL_SOCKET, SO_NOSIGPIPE, &on, sizeof on) != 0)
        return false;
#endif
    return fcntl(handle, F_SETFL, O_NONBLOCK) == 0 && fcntl(handle, F_SETFD, FD_CLOEXEC) == 0;
}
static void close_handle(Socket handle) { close(handle); }
#ifdef MSG_NOSIGNAL
enum { SEND_FLAGS = MSG_NOSIGNAL, BOTH_WAYS = SHUT_RDWR };
#else
enum { SEND_FLAGS = 0, BOTH_WAYS = SHUT_RDWR };
#endif

#endif

/* connect() on the loopback interface */
static int begin(Socket handle, const Address *address) {
    if (address->version_6) {
        struct sockaddr_in6 to;
        memset(&to, 0, sizeof to);
        to.sin6_family = AF_INET6;
        to.sin6_port = htons(address->port);
        to.sin6_addr.s6_addr[15] = 1;
        return connect(handle, (struct sockaddr *)&to, sizeof to);
    } else {
        struct sockaddr_in to;
        memset(&to, 0, sizeof to);
        to.sin_family = AF_INET;
        to.sin_port = htons(address->port);
        memcpy(&to.sin_addr, address->host, sizeof address->host);
        return connect(handle, (struct sockaddr *)&to, sizeof to);
    }
}

Socket socket_connect(const Address *address) {
    Socket handle = socket(address->version_6 ? AF_INET6 : AF_INET, SOCK_STREAM, IPPROTO_TCP);
    int on = 1;
    if (handle == NO_SOCKET)
        return NO_SOCKET;
    /* A command is small and must not wait for the acknowledgement of the one before. */
    if (!prepare(handle) || setsockopt(handle, IPPROTO_TCP, TCP_NODELAY, (const char *)&on, sizeof on) != 0 ||
        (begin(handle, address) != 0 && !again())) {
        close_handle(handle);
        return NO_SOCKET;
    }
    return handle;
}

bool socket_is_connected(Socket handle) {
    int error = 0;
    Length size = sizeof error;
    return getsockopt(handle, SOL_SOCKET, SO_ERROR, (char *)&error, &size) == 0 && error == 0;
}

bool socket_wait(Socket handle, bool writing, double seconds) {
    fd_set wanted, failed;
    struct timeval timeout;
    seconds = seconds < 0.0 ? 0.0 : seconds > 3600.0 ? 3600.0 : seconds;
#ifndef _WIN32
    if (handle >= FD_SETSIZE) { /* a host with a thousand files open: poll takes any handle, but whole milliseconds */
        struct pollfd one;
        one.fd = handle;
        one.events = writing ? POLLOUT : POLLIN;
        one.revents = 0;
        return poll(&one, 1, (int)(1e3 * seconds) + (seconds > 0.0)) > 0;
    }
#endif
    FD_ZERO(&wanted);
    FD_ZERO(&failed);
    FD_SET(handle, &wanted);
    FD_SET(handle, &failed); /* where Windows tells that a connection was refused */
    timeout.tv_sec = (long)seconds;
    timeout.tv_usec = (long)(1e6 * (seconds - (double)timeout.tv_sec));
    return select((int)handle + 1, writing ? NULL : &wanted, writing ? &wanted : NULL, &failed, &timeout) > 0;
}

long socket_send(Socket handle, const void *data, size_t size) {
    long done = (long)send(handle, data, (int)size, SEND_FLAGS);
    return done >= 0 ? done : again() ? 0 : -1;
}

long socket_receive(Socket handle, void *data, size_t size) {
    long done = (long)recv(handle, data, (int)size, 0);
    return done > 0 ? done : done < 0 && again() ? 0 : -1; /* no byte at all means that the other end has closed */
}

void socket_close(Socket handle) {
    shutdown(handle, BOTH_WAYS);
    close_handle(handle);
}

/* Endpoints: tcp://HOST:PORT, the host being this machine. */
#ifndef ENDPOINT_H
#define ENDPOINT_H

#include "engine.h"
#include "sockets.h"

/* False, with a message, unless `endpoint` is 127.0.0.0/8, ::1 or localhost with a port. Nothing is looked up. */
static bool endpoint_read(const char *endpoint, Address *address, Message message);

#endif

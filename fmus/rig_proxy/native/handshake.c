/* ZMTP: the way to an open connection. Greetings of 64 bytes, then a READY from both sides. */
#include "clock.h"
#include "zmtp.h"

#include <stdio.h>
#include <string.h>

enum { GREETING = 64, VERSION = 10, MECHANISM = 12, MECHANISM_SIZE = 20, FIRST_PART = 12 };

static Opening unfit(Wire *wire) {
    wire_close(wire);
    return WIRE_UNFIT;
}

static Opening missing_peer(Wire *wire) {
    wire_close(wire);
    return WIRE_ABSENT;
}

/* Signature, version 3.1, mechanism, and "no server", which is 0. */
static void write_greeting(unsigned char greeting[GREETING]) {
    memset(greeting, 0, GREETING);
    greeting[0] = 0xff;
    greeting[9] = 0x7f;
    greeting[VERSION] = 3;
    greeting[VERSION + 1] = 1;
    memcpy(greeting + MECHANISM, "NULL", 4);
}

/* Whether the first bytes of the other end are those of ZMTP 3 or newer. */
static Opening check_version(Wire *wire, double until, Message message) {
    const unsigned char *theirs;
    if (wire_fill(wire, 1, until) != WIRE_FRAME)
        return missing_peer(wire);
    if (wire->input[0] == 0xff && wire_fill(wire, VERSION + 1, until) != WIRE_FRAME)
        return missing_peer(wire);
    theirs = wire->input;
    if (theirs[0] == 0xff && (theirs[9] & 1) != 0 && theirs[VERSION] >= 3)
        return WIRE_OPEN;
    snprintf(message, MESSAGE_SIZE, "who answers there does not speak ZeroMQ's ZMTP 3: it is no `ppy rig serve`");
    return unfit(wire);
}

static Opening check_mechanism(Wire *wire, double until, Message message) {
    char theirs[MECHANISM_SIZE + 1] = "";
    if (wire_fill(wire, GREETING, until) != WIRE_FRAME)
        return missing_peer(wire);
    memcpy(theirs, wire->input + MECHANISM, MECHANISM_SIZE);
    wire->taken = GREETING;
    if (strcmp(theirs, "NULL") == 0)
        return WIRE_OPEN;
    if (strcmp(theirs, "CURVE") == 0)
        snprintf(message, MESSAGE_SIZE,
                 "the rig asks for keys (CURVE), and this build has no encryption: `ppy rig bridge` carries the proxy on "
                 "encrypted");
    else
        snprintf(message, MESSAGE_SIZE, "the rig wants an authentication that the proxy does not have; it has NULL");
    return unfit(wire);
}

/* The value of a property in the metadata of READY: pairs of name (1 byte of length) and value (4 bytes). */
static bool find_property(Frame data, const char *name, char *value, size_t capacity) {
    const unsigned char *p = data.body, *end = data.body + data.size;
    while (end - p > 0) {
        size_t name_size = *p++, value_size;
        const unsigned char *at = p;
        if ((size_t)(end - p) < name_size + 4)
            return false;
        p += name_size;
        value_size = (size_t)p[0] << 24 | (size_t)p[1] << 16 | (size_t)p[2] << 8 | p[3];
        p += 4;
        if ((size_t)(end - p) < value_size)
            return false;
        if (name_size == strlen(name) && memcmp(at, name, name_size) == 0 && value_size < capacity) {
            memcpy(value, p, value_size);
            value[value_size] = '\0';
            return true;
        }
        p += value_size;
    }
    return false;
}

/* Waits for the READY of the other end. */
static Opening await_ready(Wire *wire, double until, Message message) {
    for (int commands = 0; commands < 16; commands++) {
        Frame frame, data;
        char type[16];
        if (wire_frame(wire, until, &frame) != WIRE_FRAME || (frame.flags & FLAG_COMMAND) == 0)
            return missing_peer(wire);
        if (command_is(&frame, "READY", &data)) {
            if (!find_property(data, "Socket-Type", type, sizeof type) || strcmp(type, "ROUTER") == 0)
                return WIRE_OPEN;
            snprintf(message, MESSAGE_SIZE,
                     "who answers there is no ROUTER, which takes commands; is it the port of the rig's telemetry?");
            return unfit(wire);
        }
        if (command_is(&frame, "ERROR", &data)) {
            snprintf(message, MESSAGE_SIZE, "the rig refuses the connection (ERROR of ZMTP)");
            return unfit(wire);
        }
    }
    return missing_peer(wire);
}

static bool put_ready(Wire *wire, const char *name) {
    static const char begin[] = "\5READY\13Socket-Type\0\0\0\6DEALER\10Identity\0\0";
    enum { BEGIN = sizeof begin }; /* its last 0 is the third of the four bytes of a length */
    unsigned char ready[BEGIN + 1 + NAME_SIZE];
    size_t size = strlen(name);
    memcpy(ready, begin, BEGIN);
    ready[BEGIN] = (unsigned char)size;
    memcpy(ready + BEGIN + 1, name, size);
    return wire_put_frame(wire, FLAG_COMMAND, ready, BEGIN + 1 + size);
}

Opening wire_open(Wire *wire, const Address *address, const char *name, double until, Message message) {
    unsigned char ours[GREETING];
    Opening opening;
    wire_close(wire);
    wire->socket = socket_connect(address);
    if (!wire_is_open(wire))
        return WIRE_ABSENT;
    if (!socket_wait(wire->socket, true, until - clock_now()) || !socket_is_connected(wire->socket))
        return missing_peer(wire);
    write_greeting(ours);
    /* Our mechanism goes out when theirs is there: libzmq hangs up on one that does not suit it, before it has told
       its own, and nobody would learn that keys are missing. */
    if (!wire_put(wire, ours, FIRST_PART))
        return missing_peer(wire);
    if ((opening = check_version(wire, until, message)) != WIRE_OPEN ||
        (opening = check_mechanism(wire, until, message)) != WIRE_OPEN)
        return opening;
    if (!wire_put(wire, ours + FIRST_PART, GREETING - FIRST_PART) || !put_ready(wire, name))
        return missing_peer(wire);
    return await_ready(wire, until, message);
}

/* ZMTP: frames over a socket. */
#include "zmtp.h"
#include "clock.h"

#include <string.h>

enum { PASSED_MOST = 64 }; /* frames of no use in a row, before the clock is looked at */

bool wire_is_open(const Wire *wire) { return wire->socket != NO_SOCKET; }

void wire_close(Wire *wire) {
    if (wire_is_open(wire))
        socket_close(wire->socket);
    wire->socket = NO_SOCKET;
    wire->received = wire->taken = wire->queued = wire->sent = 0;
    wire->skipping = 0;
    wire->in_parts = false;
}

static Arrival broken(Wire *wire) {
    wire_close(wire);
    return WIRE_BROKEN;
}

/* ---- sending ------------------------------------------------------------------------------------ */

static bool flush(Wire *wire) {
    while (wire->sent < wire->queued) {
        long done = socket_send(wire->socket, wire->output + wire->sent, wire->queued - wire->sent);
        if (done < 0) {
            wire_close(wire);
            return false;
        }
        if (done == 0)
            return true;
        wire->sent += (size_t)done;
    }
    wire->sent = wire->queued = 0;
    return true;
}

bool wire_put(Wire *wire, const void *data, size_t size) {
    if (!wire_is_open(wire) || size > sizeof wire->output - wire->queued)
        return false;
    memcpy(wire->output + wire->queued, data, size);
    wire->queued += size;
    return flush(wire);
}

bool wire_put_frame(Wire *wire, int flags, const void *data, size_t size) {
    unsigned char header[HEADER_MOST];
    size_t length = size > 255 ? 9 : 2;
    if (!wire_is_open(wire) || length + size > sizeof wire->output - wire->queued)
        return false; /* all of it or nothing */
    header[0] = (unsigned char)(flags | (size > 255 ? FLAG_LONG : 0));
    for (size_t i = length - 1, rest = size; i > 0; i--, rest >>= 8)
        header[i] = (unsigned char)rest;
    return wire_put(wire, header, length) && wire_put(wire, data, size);
}

bool wire_send(Wire *wire, const void *data, size_t size) {
    return wire_is_open(wire) && flush(wire) && wire->queued == 0 && size <= FRAME_MOST &&
           wire_put_frame(wire, 0, data, size);
}

/* ---- receiving ---------------------------------------------------------------------------------- */

/* One attempt to read; waits for something to come, but not beyond `until`. */
static Arrival receive_some(Wire *wire, double until) {
    long done;
    if (wire->taken > 0) {
        memmove(wire->input, wire->input + wire->taken, wire->received - wire->taken);
        wire->received -= wire->taken;
        wire->taken = 0;
    }
    done = socket_receive(wire->socket, wire->input + wire->received, sizeof wire->input - wire->received);
    if (done < 0 || !flush(wire))
        return broken(wire);
    wire->received += (size_t)done;
    if (done > 0)
        return WIRE_FRAME;
    if (clock_now() >= until)
        return WIRE_SILENT;
    socket_wait(wire->socket, false, until - clock_now());
    return WIRE_FRAME;
}

Arrival wire_fill(Wire *wire, size_t size, double until) {
    while (wire->received - wire->taken < size) {
        Arrival arrival = receive_some(wire, until);
        if (arrival != WIRE_FRAME)
            return arrival;
    }
    return WIRE_FRAME;
}

/* Passes over the bytes of a frame that nobody wants. They may be as many as the other end likes to send, so the clock
   is looked at. */
static Arrival skip(Wire *wire, double until) {
    while (wire->skipping > 0) {
        size_t there = wire->received - wire->taken;
        size_t some = wire->skipping < there ? (size_t)wire->skipping : there;
        wire->taken += some;
        wire->skipping -= some;
        if (some == 0) {
            Arrival arrival = receive_some(wire, until);
            if (arrival != WIRE_FRAME)
                return arrival;
            if (clock_now() >= until)
                return WIRE_SILENT;
        }
    }
    return WIRE_FRAME;
}

Arrival wire_frame(Wire *wire, double until, Frame *frame) {
    const unsigned char *header;
    uint64_t size = 0;
    size_t length;
    Arrival arrival = skip(wire, until);
    if (arrival != WIRE_FRAME || (arrival = wire_fill(wire, 2, until)) != WIRE_FRAME)
        return arrival;
    frame->flags = wire->input[wire->taken];
    if ((frame->flags & ~(FLAG_MORE | FLAG_LONG | FLAG_COMMAND)) != 0)
        return broken(wire);
    length = (frame->flags & FLAG_LONG) != 0 ? 9 : 2;
    if ((arrival = wire_fill(wire, length, until)) != WIRE_FRAME)
        return arrival;
    header = wire->input + wire->taken;
    for (size_t i = 1; i < length; i++)
        size = size << 8 | header[i];
    if (size > FRAME_MOST) {
        if ((frame->flags & FLAG_COMMAND) != 0 || size >> 63 != 0)
            return broken(wire);
        frame->body = NULL;
        frame->size = 0;
        wire->skipping = size;
        wire->taken += length;
        return WIRE_FRAME;
    }
    if ((arrival = wire_fill(wire, length + (size_t)size, until)) != WIRE_FRAME)
        return arrival;
    frame->body = wire->input + wire->taken + length;
    frame->size = (size_t)size;
    wire->taken += length + (size_t)size;
    return WIRE_FRAME;
}

bool command_is(const Frame *frame, const char *name, Frame *data) {
    size_t size = strlen(name);
    if (frame->size < size + 1 || frame->body[0] != size || memcmp(frame->body + 1, name, size) != 0)
        return false;
    data->body = frame->body + 1 + size;
    data->size = frame->size - 1 - size;
    return true;
}

/* A PING has a time to live of two bytes and up to 16 bytes that the PONG brings back (RFC 37). */
static void answer(Wire *wire, const Frame *command) {
    unsigned char pong[21] = "\4PONG";
    Frame data;
    if (command_is(command, "PING", &data) && data.size >= 2 && data.size <= 2 + 16) {
        memcpy(pong + 5, data.body + 2, data.size - 2);
        wire_put_frame(wire, FLAG_COMMAND, pong, 5 + data.size - 2);
    }
}

Arrival wire_receive(Wire *wire, double until, const char **frame, size_t *size) {
    Frame next;
    /* It ends also when nothing but commands comes, and that without end. */
    for (int passed = 0; passed < PASSED_MOST || clock_now() < until; passed++) {
        bool in_parts = wire->in_parts;
        Arrival arrival;
        if (!wire_is_open(wire))
            return WIRE_BROKEN;
        if ((arrival = wire_frame(wire, until, &next)) != WIRE_FRAME)
            return arrival;
        if ((next.flags & FLAG_COMMAND) != 0) {
            answer(wire, &next);
            continue;
        }
        wire->in_parts = (next.flags & FLAG_MORE) != 0;
        if (next.body != NULL && !in_parts && !wire->in_parts) {
            *frame = (const char *)next.body;
            *size = next.size;
            return WIRE_FRAME;
        }
    }
    return WIRE_SILENT;
}

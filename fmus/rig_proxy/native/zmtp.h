/* ZMTP 3 (ZeroMQ RFC 23 and 37): a DEALER that talks with one ROUTER, with the NULL mechanism, in frames of one part. */
#ifndef ZMTP_H
#define ZMTP_H

#include "engine.h"
#include "sockets.h"

enum {
    FRAME_MOST = 65536,  /* bytes of a frame that is taken; a longer one is passed over */
    HEADER_MOST = 9,     /* flags and length */
    NAME_SIZE = 48,      /* with the terminating zero */
    COMMAND_MOST = 512   /* READY needs some 90 bytes; a longer command is nothing we have to know */
};
enum { FLAG_MORE = 1, FLAG_LONG = 2, FLAG_COMMAND = 4 };

/* One connection. All zero but for `socket`, which is NO_SOCKET, before its first use. */
typedef struct {
    Socket socket;
    size_t received, taken;  /* bytes in `input`, and how many of them have been dealt with */
    size_t queued, sent;     /* bytes in `output`, and how many of them are under way */
    uint64_t skipping;       /* bytes still to come of a frame that is passed over */
    bool in_parts;           /* within a message of several frames, which the rig protocol does not have */
    unsigned char input[FRAME_MOST + HEADER_MOST];
    unsigned char output[FRAME_MOST + HEADER_MOST + COMMAND_MOST];
} Wire;

typedef enum {
    WIRE_OPEN,   /* connected, and the handshake is done */
    WIRE_ABSENT, /* nobody there, or gone, or silent: it may be worth another attempt */
    WIRE_UNFIT   /* somebody is there with whom it will never work; the message says why */
} Opening;

typedef enum { WIRE_FRAME, WIRE_SILENT, WIRE_BROKEN } Arrival;

static bool wire_is_open(const Wire *wire);
static void wire_close(Wire *wire);

/* Connects and shakes hands by `until` (clock_now); `name` is what the connection calls itself (its routing id). */
static Opening wire_open(Wire *wire, const Address *address, const char *name, double until, Message message);

/* Gives a frame to the system, or keeps what does not go through for later. False if the connection is broken (and then
   closed), or so congested that an older frame is not through yet: a newer one must not queue up behind it. */
static bool wire_send(Wire *wire, const void *data, size_t size);

/* The next frame, which is good until the next call. SILENT if there is none by `until`; what is there already is
   given out even then. A broken connection is closed. */
static Arrival wire_receive(Wire *wire, double until, const char **frame, size_t *size);

/* ---- what the handshake and the frames share -------------------------------------------------------- */

typedef struct {
    int flags;
    const unsigned char *body;
    size_t size;
} Frame;

/* Reads until `size` bytes are there that have not been dealt with. */
static Arrival wire_fill(Wire *wire, size_t size, double until);

/* The next frame or command, whichever it is. */
static Arrival wire_frame(Wire *wire, double until, Frame *frame);

/* Queues bytes and tries to send. False if they do not fit, or the connection is broken. */
static bool wire_put(Wire *wire, const void *data, size_t size);
static bool wire_put_frame(Wire *wire, int flags, const void *data, size_t size);

/* Whether a command has that name; `data` is what follows the name. */
static bool command_is(const Frame *frame, const char *name, Frame *data);

#endif

/* The messages of the rig protocol (docs/reference/protocol.md) that a client writes and reads. */
#ifndef MESSAGES_H
#define MESSAGES_H

#include "engine.h"
#include "json_writer.h"

/* Outputs of the proxy: the measured values, as many ages, and round_trip_time, missed_deadlines and link_state. */
enum { MEASURED = (MODEL_OUTPUTS - 3) / 2, PROTOCOL_VERSION = 2, SESSION_SIZE = 128, SENTENCE_SIZE = 512 };

typedef enum { REPLY_NONE, REPLY_ACCEPTED, REPLY_REFUSED, REPLY_SAMPLE, REPLY_DISCONNECTED, REPLY_FOREIGN } ReplyKind;

/* Of a rig in session; but for RUNNING, which stands for idle too, a latch holds it. */
typedef enum { RIG_RUNNING, RIG_STOPPING, RIG_SAFE, RIG_NOT_REACHED } RigState;

typedef struct {
    ReplyKind kind;  /* NONE is what is no reply, or malformed; FOREIGN one of another version */
    double version;  /* of a FOREIGN one */
    char session[SESSION_SIZE];
    uint64_t sequence;
    double sent, clock, period, watchdog;
    bool lockstep;
    RigState state;
    char reason[SENTENCE_SIZE];
    int refusals;
    char refusal[SENTENCE_SIZE];                   /* the first */
    double values[MEASURED + 1], ages[MEASURED + 1]; /* NaN for null */
} Reply;

/* What a frame says; every field that the protocol has for its kind must be there and of the right type. */
static void reply_read(const char *frame, size_t size, Reply *reply);

/* `instance` names who connects, `key` is the server's or empty, `measured` are the indices of the measured values,
   `inputs` the commands, in the order of the model. A writer that is full after this must not be sent. */
static void write_connect(Writer *writer, const char *instance, const char *key, double time,
                          const int measured[MEASURED + 1]);
static void write_exchange(Writer *writer, const Reply *session, uint64_t sequence, double sent, double seen, double time,
                           double step, const double *inputs);
static void write_disconnect(Writer *writer, const char *session);

#endif

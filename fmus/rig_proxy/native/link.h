/* A session with the rig: what is sent, which replies count, and how old every value is. */
#ifndef LINK_H
#define LINK_H

#include "messages.h"
#include "zmtp.h"

typedef struct {
    Wire wire;
    Address address;
    const char *endpoint;       /* the same for people */
    int measured[MEASURED + 1]; /* indices of the outputs that the rig measures */
    bool in_session;
    Reply session; /* how the rig accepted; but for `kind`, it holds while in_session is set */
    Reply reply;   /* the newest, whatever it was */
    char request[FRAME_MOST];

    uint64_t sequence; /* of the newest exchange that was sent */
    uint64_t taken;    /* of the newest reply whose values were taken */
    double seen;       /* the rig's clock in it */
    double answered;   /* our clock when it came */
    double round_trip; /* s, of that reply */

    double values[MEASURED + 1]; /* the newest finite ones */
    double born[MEASURED + 1];   /* when each was measured, at the earliest; our clock */

    bool safe;                     /* the rig went to its safe state */
    char reason[SENTENCE_SIZE];    /* why it did, or why it ended the session */
    bool refusing;                 /* the newest reply refused a command */
    char refusal[SENTENCE_SIZE];   /* the first refusal since it was last emptied */
} Link;

/* Connects and begins a session by `until`; with `patient`, somebody who is not there yet is tried again. On failure
   the message says why, and is empty if nobody answered in time. */
static bool link_open(Link *link, double time, double until, bool patient, Message message);

/* Sends an exchange. False if that is impossible at present. */
static bool link_exchange(Link *link, double time, double step, const double *inputs);

/* Takes what comes, up to `until`. True as soon as a reply to the exchange `first` or a later one has come; false when
   none can come any more. With `first` = 0 it always goes on to `until`. */
static bool link_listen(Link *link, double until, uint64_t first);

/* Ends the session, if there is one, waits for the rig's word at most `seconds`, and closes. */
static void link_close(Link *link, double seconds);

#endif

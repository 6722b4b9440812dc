/* A session with the rig: what is sent, which replies count, and how old every value is. */
#ifndef LINK_H
#define LINK_H

#include "messages.h"
#include "zmtp.h"

enum { INSTANCE_SIZE = 17 };

typedef struct {
    Wire wire;
    Address address;
    const char *endpoint;         /* the same for people */
    char instance[INSTANCE_SIZE]; /* 16 hexadecimal digits that no other instance has */
    unsigned connections;         /* that were tried, each under a name of its own */
    int measured[MEASURED + 1];   /* indices of the outputs that the rig measures */
    bool in_session; /* from its acceptance until either side ends it */
    Reply session; /* how the rig accepted; but for `kind`, it holds while in_session is set */
    Reply reply;   /* the newest, whatever it was */
    char request[FRAME_MOST];

    uint64_t sequence; /* of the newest exchange that was sent */
    uint64_t taken;    /* of the newest reply whose values were taken */
    double seen;       /* the rig's clock in it */
    double answered;   /* our clock when it came */
    double asked;      /* our clock when the oldest exchange without an answer was sent; infinite if all have one */
    double round_trip; /* s, of that reply */

    double values[MEASURED + 1]; /* the newest finite ones */
    double born[MEASURED + 1];   /* when each was measured, at the earliest; our clock */

    RigState state;                /* in that reply */
    char reason[SENTENCE_SIZE];    /* why it did, or why it ended the session */
    bool refusing;                 /* the newest reply refused a command */
    char refusal[SENTENCE_SIZE];   /* the first refusal since it was last emptied */
} Link;

/* Before anything was ever measured: ages are then finite as FMI wants them, and of no use to anybody. */
static void link_forget(Link *link);

/* Makes up the name of this instance. False if the system gives no random numbers. */
static bool link_name(Link *link);

/* Connects and begins a session by `until`; somebody who is not there yet is tried again. On failure the message says
   why, and is empty if nobody answered in time. */
static bool link_open(Link *link, double time, double until, Message message);

/* Sends an exchange. False if that is impossible at present. */
static bool link_exchange(Link *link, double time, double step, const double *inputs);

/* Takes what comes, up to `until`. True as soon as a reply to the exchange `first` or a later one has come, or one that
   says that the rig is latched; false when none can come any more. With `first` = 0 it goes on to `until` in any case
   but that of a latch. */
static bool link_listen(Link *link, double until, uint64_t first);

/* Goes on with a session over a new connection where the old one broke; the message says why that fails. A session that
   is over stays over: only link_open begins one. */
static void link_mend(Link *link, double until, Message message);

/* Ends the session, if there is one, waits for the rig's word at most `seconds`, and closes. */
static void link_close(Link *link, double seconds);

#endif

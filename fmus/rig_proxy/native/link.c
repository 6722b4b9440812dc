/* A session with the rig. */
#include "link.h"
#include "clock.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { AT_ONCE = 1000 }; /* replies taken in a row after the time is up: those that are there, but no flood */

static const double BETWEEN_ATTEMPTS = 0.05; /* s */

/* ---- replies ------------------------------------------------------------------------------------ */

/* The values of a reply that has just come. A null keeps the value there was, which grows older. */
static void take_values(Link *link, const Reply *reply, double round_trip) {
    double now = clock_now();
    for (int i = 0; i < MEASURED; i++)
        if (isfinite(reply->values[i]) && isfinite(reply->ages[i])) {
            link->values[i] = reply->values[i];
            link->born[i] = now - round_trip - fmax(reply->ages[i], 0.0); /* it cannot be older than that */
        }
    link->round_trip = round_trip;
    link->answered = now;
    link->seen = reply->clock;
}

/* Whether a sample is one of this session, newer than all before, and echoes what can have been sent. */
static bool is_newer(const Link *link, const Reply *reply) {
    return link->in_session && strcmp(reply->session, link->session.session) == 0 && reply->sequence > link->taken &&
           reply->sequence <= link->sequence && reply->sent <= clock_now();
}

static void take_sample(Link *link, const Reply *reply) {
    link->taken = reply->sequence;
    take_values(link, reply, clock_now() - reply->sent);
    link->safe = reply->safe;
    if (reply->safe)
        memcpy(link->reason, reply->reason, sizeof link->reason);
    link->refusing = reply->refusals > 0;
    if (link->refusing && link->refusal[0] == '\0')
        memcpy(link->refusal, reply->refusal, sizeof link->refusal);
}

/* Waits for any frame, and reads it into `reply`. */
static Arrival receive(Link *link, double until) {
    const char *frame;
    size_t size;
    Arrival arrival = wire_receive(&link->wire, until, &frame, &size);
    if (arrival == WIRE_FRAME)
        reply_read(frame, size, &link->reply);
    return arrival;
}

bool link_listen(Link *link, double until, uint64_t first) {
    for (int taken = 0; taken < AT_ONCE || clock_now() < until; taken++) {
        if (!link->in_session || receive(link, until) != WIRE_FRAME)
            break;
        if (link->reply.kind == REPLY_REFUSED) { /* the server knows the session no more, as after a restart */
            link->in_session = false;
            memcpy(link->reason, link->reply.reason, sizeof link->reason);
        }
        if (link->reply.kind != REPLY_SAMPLE || !is_newer(link, &link->reply))
            continue;
        take_sample(link, &link->reply);
        if (first > 0 && link->taken >= first)
            return true;
    }
    if (first == 0)
        clock_sleep(until); /* there may be nothing to listen to */
    return false;
}

/* ---- requests ----------------------------------------------------------------------------------- */

static Writer writer(Link *link) {
    Writer made = {link->request, 0, sizeof link->request, false};
    return made;
}

static bool post(Link *link, const Writer *message) {
    return !message->full && wire_send(&link->wire, message->text, message->size);
}

bool link_exchange(Link *link, double time, double step, const double *inputs) {
    Writer message = writer(link);
    if (!link->in_session)
        return false;
    write_exchange(&message, &link->session, link->sequence + 1, clock_now(), link->seen, time, step, inputs);
    if (!post(link, &message))
        return false;
    link->sequence++;
    return true;
}

/* ---- opening and closing ------------------------------------------------------------------------ */

static void begin_session(Link *link, double sent) {
    link->session = link->reply;
    link->in_session = true;
    link->sequence = link->taken = 0;
    link->safe = link->refusing = false;
    link->reason[0] = '\0';
    take_values(link, &link->reply, clock_now() - sent);
}

/* Sends `connect` and waits for the answer. */
static Opening negotiate(Link *link, double time, double until, Message message) {
    Writer request = writer(link);
    double sent = clock_now();
    write_connect(&request, time, link->measured);
    if (request.full) {
        snprintf(message, MESSAGE_SIZE, "the names of all signals need more than the %d bytes of a message", FRAME_MOST);
        return WIRE_UNFIT;
    }
    if (!post(link, &request))
        return WIRE_ABSENT;
    while (receive(link, until) == WIRE_FRAME && clock_now() < until) {
        switch (link->reply.kind) {
        case REPLY_ACCEPTED: begin_session(link, sent); return WIRE_OPEN;
        case REPLY_REFUSED:
            snprintf(message, MESSAGE_SIZE, "the rig at %s refuses: %s", link->endpoint, link->reply.reason);
            return WIRE_UNFIT;
        case REPLY_FOREIGN:
            snprintf(message, MESSAGE_SIZE, "the rig speaks version %.10g of the protocol, the proxy version %d",
                     link->reply.version, PROTOCOL_VERSION);
            return WIRE_UNFIT;
        default: break; /* not meant for us */
        }
    }
    return WIRE_ABSENT;
}

/* One attempt. A session that has not been ended goes on over a new connection; the rig says if it knows it no more. */
static Opening attempt(Link *link, double time, double until, Message message) {
    Opening opening = wire_is_open(&link->wire) ? WIRE_OPEN : wire_open(&link->wire, &link->address, until, message);
    if (opening == WIRE_OPEN && !link->in_session)
        opening = negotiate(link, time, until, message);
    if (opening != WIRE_OPEN)
        wire_close(&link->wire);
    return opening;
}

bool link_open(Link *link, double time, double until, bool patient, Message message) {
    Opening opening;
    message[0] = '\0';
    while ((opening = attempt(link, time, until, message)) == WIRE_ABSENT && patient &&
           clock_now() + BETWEEN_ATTEMPTS < until)
        clock_sleep(clock_now() + BETWEEN_ATTEMPTS);
    return opening == WIRE_OPEN;
}

void link_close(Link *link, double seconds) {
    if (link->in_session && wire_is_open(&link->wire)) {
        Writer message = writer(link);
        double until = clock_now() + seconds;
        write_disconnect(&message, link->session.session);
        if (post(link, &message))
            while (receive(link, until) == WIRE_FRAME && link->reply.kind != REPLY_DISCONNECTED && clock_now() < until)
                continue;
    }
    link->in_session = false;
    wire_close(&link->wire);
}

/* A session with the rig. */
#include "link.h"
#include "clock.h"
#include "local_key.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { AT_ONCE = 1000 }; /* replies taken in a row after the time is up: those that are there, but no flood */

static const double BETWEEN_ATTEMPTS = 0.05; /* s */
static const double NEVER = -1e9;            /* our clock: some thirty years before the computer was switched on */

/* ---- names -------------------------------------------------------------------------------------- */

#ifdef _WIN32
static bool draw(unsigned *number) { return rand_s(number) == 0; }
#else
static bool draw(unsigned *number) {
    FILE *source = fopen("/dev/urandom", "rb");
    bool is_drawn = source != NULL && fread(number, sizeof *number, 1, source) == 1;
    if (source != NULL)
        fclose(source);
    return is_drawn;
}
#endif

bool link_name(Link *link) {
    unsigned first, second;
    if (!draw(&first) || !draw(&second))
        return false;
    snprintf(link->instance, INSTANCE_SIZE, "%08x%08x", first & 0xffffffffu, second & 0xffffffffu);
    return true;
}

void link_forget(Link *link) {
    link->state = RIG_RUNNING;
    link->refusing = false;
    link->refusal[0] = link->reason[0] = '\0';
    link->round_trip = 0.0;
    link->answered = link->asked = NEVER;
    for (int i = 0; i < MEASURED; i++) {
        link->values[i] = 0.0;
        link->born[i] = NEVER;
    }
}

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
    link->asked = link->taken == link->sequence ? INFINITY : fmax(link->asked, reply->sent);
    take_values(link, reply, clock_now() - reply->sent);
    link->state = reply->state;
    if (reply->state != RIG_RUNNING)
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

/* No answer can come from now on, and none that came is the newest for long. */
static void leave_session(Link *link) {
    link->in_session = false;
    link->asked = fmin(link->asked, link->answered);
}

bool link_listen(Link *link, double until, uint64_t first) {
    for (int taken = 0; taken < AT_ONCE || clock_now() < until; taken++) {
        if (!link->in_session || receive(link, until) != WIRE_FRAME)
            break;
        if (link->reply.kind == REPLY_REFUSED) { /* the server knows the session no more, as after a restart */
            leave_session(link);
            memcpy(link->reason, link->reply.reason, sizeof link->reason);
        }
        if (link->reply.kind != REPLY_SAMPLE || !is_newer(link, &link->reply))
            continue;
        take_sample(link, &link->reply);
        if (link->state != RIG_RUNNING || (first > 0 && link->taken >= first))
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
    link->asked = fmin(link->asked, clock_now()); /* also where it does not get through */
    write_exchange(&message, &link->session, ++link->sequence, clock_now(), link->seen, time, step, inputs);
    return post(link, &message);
}

/* ---- opening and closing ------------------------------------------------------------------------ */

static void begin_session(Link *link, double sent) {
    link->session = link->reply;
    link->in_session = true;
    link->sequence = link->taken = 0;
    link->asked = INFINITY;
    take_values(link, &link->reply, clock_now() - sent);
}

/* Sends `connect` and waits for the answer. */
static Opening negotiate(Link *link, double time, double until, Message message) {
    Writer request = writer(link);
    double sent = clock_now();
    char key[KEY_SIZE];
    local_key(&link->address, key);
    write_connect(&request, link->instance, key, time, link->measured);
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

/* A server may keep the name of a connection that broke for a while, so that every connection has a name of its own. */
static Opening open_wire(Link *link, double until, Message message) {
    char name[NAME_SIZE];
    snprintf(name, sizeof name, "ppy-%s-%u", link->instance, ++link->connections);
    return wire_open(&link->wire, &link->address, name, until, message);
}

static Opening attempt(Link *link, double time, double until, Message message) {
    Opening opening = open_wire(link, until, message);
    if (opening == WIRE_OPEN)
        opening = negotiate(link, time, until, message);
    if (opening != WIRE_OPEN)
        wire_close(&link->wire);
    return opening;
}

bool link_open(Link *link, double time, double until, Message message) {
    Opening opening;
    message[0] = '\0';
    while ((opening = attempt(link, time, until, message)) == WIRE_ABSENT && clock_now() + BETWEEN_ATTEMPTS < until)
        clock_sleep(clock_now() + BETWEEN_ATTEMPTS);
    return opening == WIRE_OPEN;
}

void link_mend(Link *link, double until, Message message) {
    if (link->in_session && !wire_is_open(&link->wire) && open_wire(link, until, message) != WIRE_OPEN &&
        message[0] == '\0')
        snprintf(message, MESSAGE_SIZE, "no answer from %s", link->endpoint);
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
    if (link->in_session)
        leave_session(link);
    wire_close(&link->wire);
}

/* The messages of the rig protocol. */
#include "platform.h"

#include "json_reader.h"
#include "messages.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* ---- writing ------------------------------------------------------------------------------------ */

static void begin_message(Writer *writer, const char *kind) {
    char text[64];
    writer->size = 0;
    writer->full = false;
    snprintf(text, sizeof text, "{\"ppy\":%d,\"type\":\"%s\"", PROTOCOL_VERSION, kind);
    write_plain(writer, text);
}

static void write_named(Writer *writer, const char *name, double number) {
    write_plain(writer, ",\"");
    write_plain(writer, name);
    write_plain(writer, "\":");
    write_number(writer, number);
}

static void write_unit(Writer *writer, int variable, bool is_first) {
    write_plain(writer, is_first ? "" : ",");
    write_text(writer, model_variables[variable].name);
    write_plain(writer, ":");
    write_text(writer, model_variables[variable].unit);
}

static void write_session(Writer *writer, const char *session) {
    write_plain(writer, ",\"session\":");
    write_text(writer, session);
}

void write_connect(Writer *writer, const char *instance, const char *key, double time,
                   const int measured[MEASURED + 1]) {
    begin_message(writer, "connect");
    write_plain(writer, ",\"client\":");
    write_text(writer, model_name);
    write_plain(writer, ",\"instance\":");
    write_text(writer, instance);
    write_plain(writer, ",\"key\":");
    write_text(writer, key);
    write_plain(writer, ",\"inputs\":{");
    for (int i = 0; i < MODEL_INPUTS; i++)
        write_unit(writer, FIRST_INPUT + i, i == 0);
    write_plain(writer, "},\"outputs\":{");
    for (int i = 0; i < MEASURED; i++)
        write_unit(writer, measured[i], i == 0);
    write_plain(writer, "}");
    write_named(writer, "time", time);
    write_plain(writer, "}");
}

void write_exchange(Writer *writer, const Reply *session, uint64_t sequence, double sent, double seen, double time,
                    double step, const double *inputs) {
    char text[64];
    begin_message(writer, "exchange");
    write_session(writer, session->session);
    snprintf(text, sizeof text, ",\"sequence\":%llu", (unsigned long long)sequence);
    write_plain(writer, text);
    write_named(writer, "sent", sent);
    write_named(writer, "seen", seen);
    write_named(writer, "time", time);
    write_named(writer, "step", step);
    write_plain(writer, ",\"values\":[");
    for (int i = 0; i < MODEL_INPUTS; i++) {
        write_plain(writer, i > 0 ? "," : "");
        write_number(writer, inputs[i]);
    }
    write_plain(writer, "]}");
}

void write_disconnect(Writer *writer, const char *session) {
    begin_message(writer, "disconnect");
    write_session(writer, session);
    write_plain(writer, "}");
}

/* ---- reading ------------------------------------------------------------------------------------ */

static bool read_number(Json message, const char *name, double *number) {
    Json value;
    return json_find(message, name, &value) && json_number(value, number);
}

static bool read_count(Json message, const char *name, uint64_t *count) {
    Json value;
    return json_find(message, name, &value) && json_count(value, count);
}

/* A text that may be cut off: a sentence for people. */
static bool read_sentence(Json message, const char *name, char sentence[SENTENCE_SIZE]) {
    Json value;
    bool whole;
    return json_find(message, name, &value) && json_text(value, sentence, SENTENCE_SIZE, &whole);
}

/* A text that has to be whole. */
static bool read_word(Json message, const char *name, char *word, size_t size) {
    Json value;
    bool whole;
    return json_find(message, name, &value) && json_text(value, word, size, &whole) && whole;
}

/* As many finite numbers or nulls as there are measured values. */
static bool read_values(Json message, const char *name, double *values) {
    Json array, item, *after = NULL;
    int count = 0;
    if (!json_find(message, name, &array) || !json_is_array(array))
        return false;
    for (; json_element(array, after, &item); after = &item, count++) {
        if (count == MEASURED)
            return false;
        if (json_is_null(item))
            values[count] = NAN;
        else if (!json_number(item, &values[count]))
            return false;
    }
    return count == MEASURED;
}

static bool read_refusals(Json message, Reply *reply) {
    Json array, item, *after = NULL;
    bool whole;
    reply->refusals = 0;
    if (!json_find(message, "refused", &array) || !json_is_array(array))
        return false;
    for (; json_element(array, after, &item); after = &item)
        if (!json_is_text(item))
            return false;
        else if (reply->refusals++ == 0)
            json_text(item, reply->refusal, sizeof reply->refusal, &whole);
    return true;
}

static bool check_limits(Json message) {
    static const char *const names[] = {"min", "max", "rate"};
    Json limits, key, limit, value, *after = NULL;
    double number;
    if (!json_find(message, "limits", &limits) || !json_is_object(limits))
        return false;
    for (; json_member(limits, after, &key, &limit); after = &limit) {
        if (!json_is_object(limit))
            return false;
        for (int i = 0; i < 3; i++)
            if (json_find(limit, names[i], &value) && !json_is_null(value) && !json_number(value, &number))
                return false;
    }
    return true;
}

static bool read_accepted(Json message, Reply *reply) {
    char mode[32];
    reply->kind = REPLY_ACCEPTED;
    if (!read_word(message, "mode", mode, sizeof mode))
        return false;
    reply->lockstep = strcmp(mode, "lockstep") == 0;
    return (reply->lockstep || strcmp(mode, "real-time") == 0) &&
           read_word(message, "session", reply->session, sizeof reply->session) &&
           read_number(message, "clock", &reply->clock) && read_number(message, "period", &reply->period) &&
           read_number(message, "watchdog", &reply->watchdog) && check_limits(message) &&
           read_values(message, "values", reply->values) && read_values(message, "ages", reply->ages);
}

static bool read_state(Json message, Reply *reply) {
    char state[32];
    if (!read_word(message, "state", state, sizeof state))
        return false;
    reply->state = strcmp(state, "stopping") == 0      ? RIG_STOPPING
                   : strcmp(state, "safe") == 0        ? RIG_SAFE
                   : strcmp(state, "not reached") == 0 ? RIG_NOT_REACHED
                                                       : RIG_RUNNING;
    return true;
}

static bool read_sample(Json message, Reply *reply) {
    reply->kind = REPLY_SAMPLE;
    return read_state(message, reply) && read_word(message, "session", reply->session, sizeof reply->session) &&
           read_count(message, "sequence", &reply->sequence) && read_number(message, "sent", &reply->sent) &&
           read_number(message, "clock", &reply->clock) && read_sentence(message, "reason", reply->reason) &&
           read_refusals(message, reply) && read_values(message, "values", reply->values) &&
           read_values(message, "ages", reply->ages);
}

static bool read_message(Json message, Reply *reply) {
    char kind[32];
    if (!read_number(message, "ppy", &reply->version))
        return false;
    if (reply->version != PROTOCOL_VERSION) {
        reply->kind = REPLY_FOREIGN;
        return true;
    }
    if (!read_word(message, "type", kind, sizeof kind))
        return false;
    if (strcmp(kind, "accepted") == 0)
        return read_accepted(message, reply);
    if (strcmp(kind, "sample") == 0)
        return read_sample(message, reply);
    if (strcmp(kind, "disconnected") == 0)
        reply->kind = REPLY_DISCONNECTED;
    else if (strcmp(kind, "refused") == 0) {
        reply->kind = REPLY_REFUSED;
        return read_sentence(message, "reason", reply->reason);
    }
    return true;
}

void reply_read(const char *frame, size_t size, Reply *reply) {
    Json message;
    reply->kind = REPLY_NONE;
    if (!json_read(frame, size, &message) || !read_message(message, reply))
        reply->kind = REPLY_NONE;
}

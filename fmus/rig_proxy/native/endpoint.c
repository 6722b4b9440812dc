/* Endpoints. Names are not looked up: a resolver may block, and may take a name off this machine. */
#include "endpoint.h"

#include <stdio.h>
#include <string.h>

/* Decimal digits at `*text`, at most `most`; moves on behind them. */
static bool digits(const char **text, unsigned most, unsigned *number) {
    const char *begin = *text;
    for (*number = 0; **text >= '0' && **text <= '9'; (*text)++)
        if ((*number = 10 * *number + (unsigned)(**text - '0')) > most)
            return false;
    return *text > begin;
}

/* A host that is written as four numbers up to `end`. */
static bool four_numbers(const char *text, const char *end, unsigned char host[4]) {
    for (int i = 0; i < 4; i++) {
        unsigned number;
        if (i > 0 && *text++ != '.')
            return false;
        if (!digits(&text, 255, &number))
            return false;
        host[i] = (unsigned char)number;
    }
    return text == end;
}

static bool is_text(const char *begin, const char *end, const char *text) {
    return (size_t)(end - begin) == strlen(text) && memcmp(begin, text, strlen(text)) == 0;
}

bool endpoint_read(const char *endpoint, Address *address, Message message) {
    static const char scheme[] = "tcp://";
    const char *host = endpoint + strlen(scheme), *end = strrchr(endpoint, ':'), *rest = end + 1;
    unsigned port = 0;
    memset(address, 0, sizeof *address);
    if (strncmp(endpoint, scheme, strlen(scheme)) != 0 || end <= host || !digits(&rest, 65535, &port) || *rest != '\0' ||
        port == 0) {
        snprintf(message, MESSAGE_SIZE, "endpoint '%s' must be tcp://HOST:PORT, as tcp://127.0.0.1:5570", endpoint);
        return false;
    }
    address->port = (unsigned short)port;
    if (is_text(host, end, "localhost"))
        memcpy(address->host, "\x7f\0\0\1", 4);
    else if (is_text(host, end, "[::1]") || is_text(host, end, "::1"))
        address->version_6 = true;
    else if (!four_numbers(host, end, address->host) || address->host[0] != 127) {
        snprintf(message, MESSAGE_SIZE,
                 "endpoint '%s' is not on this machine, and this build has no encryption: let it be 127.0.0.1, ::1 or "
                 "localhost, and `ppy rig bridge` carry it on encrypted",
                 endpoint);
        return false;
    }
    return true;
}

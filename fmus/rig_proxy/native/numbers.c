/* Numbers as JSON has them. C reads and writes them with the separator of the host's locale, so it is exchanged. */
#include "platform.h"

#include "numbers.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST = 400 }; /* characters of a number that is read; repr of a double has 24 at most */

/* What stands between 1 and 5 in 1.5 here. Asked for like this, it is also that of a thread's own locale. */
static size_t separator(char text[NUMBER_SIZE]) {
    char sample[NUMBER_SIZE];
    size_t size = (size_t)snprintf(sample, sizeof sample, "%.1f", 1.5) - 2;
    memcpy(text, sample + 1, size);
    return size;
}

size_t number_write(double number, char text[NUMBER_SIZE]) {
    char local[NUMBER_SIZE];
    size_t size = 0;
    bool separated = false;
    snprintf(local, sizeof local, "%.17g", number);
    for (const char *c = local; *c != '\0'; c++) {
        bool plain = (*c >= '0' && *c <= '9') || *c == '-' || *c == '+' || *c == 'e';
        if (plain)
            text[size++] = *c;
        else if (!separated) { /* a separator may be several bytes */
            text[size++] = '.';
            separated = true;
        }
    }
    text[size] = '\0';
    return size;
}

bool number_read(const char *begin, const char *end, double *number) {
    char local[LONGEST + NUMBER_SIZE], *to = local;
    if (end - begin > LONGEST)
        return false;
    for (const char *c = begin; c < end; c++)
        if (*c == '.')
            to += separator(to);
        else
            *to++ = *c;
    *to = '\0';
    *number = strtod(local, NULL);
    return isfinite(*number);
}

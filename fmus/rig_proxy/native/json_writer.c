/* Writing JSON. */
#include "platform.h"

#include "json_writer.h"
#include "numbers.h"

#include <stdio.h>
#include <string.h>

static void append(Writer *writer, const char *text, size_t size) {
    if (size > writer->capacity - writer->size)
        writer->full = true;
    else {
        memcpy(writer->text + writer->size, text, size);
        writer->size += size;
    }
}

void write_plain(Writer *writer, const char *text) { append(writer, text, strlen(text)); }

void write_text(Writer *writer, const char *text) {
    append(writer, "\"", 1);
    for (; *text != '\0'; text++) {
        unsigned char c = (unsigned char)*text;
        char escape[8];
        if (c < ' ' || c == '"' || c == '\\') {
            snprintf(escape, sizeof escape, "\\u%04x", c);
            append(writer, escape, 6);
        } else
            append(writer, text, 1);
    }
    append(writer, "\"", 1);
}

void write_number(Writer *writer, double number) {
    char text[NUMBER_SIZE];
    append(writer, text, number_write(number, text));
}

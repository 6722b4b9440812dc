/* Writing JSON into a buffer of fixed size. */
#ifndef JSON_WRITER_H
#define JSON_WRITER_H

#include <stdbool.h>
#include <stddef.h>

typedef struct {
    char *text;
    size_t size, capacity;
    bool full; /* something did not fit: the text is of no use */
} Writer;

/* Punctuation and the like, as it stands. */
static void write_plain(Writer *writer, const char *text);

/* A text in quotes, with escapes. */
static void write_text(Writer *writer, const char *text);

/* A finite number. */
static void write_number(Writer *writer, double number);

#endif

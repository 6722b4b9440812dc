/* Numbers as JSON has them, whatever decimal separator the host has set. */
#ifndef NUMBERS_H
#define NUMBERS_H

#include <stdbool.h>
#include <stddef.h>

enum { NUMBER_SIZE = 64 };

/* Writes a finite number so that reading it gives the same bits; returns the length. */
static size_t number_write(double number, char text[NUMBER_SIZE]);

/* Reads a number that is known to follow the grammar of JSON; false if it is very long, or not finite. */
static bool number_read(const char *begin, const char *end, double *number);

#endif

/* Reading JSON (RFC 8259), strictly, without memory of its own: a value is where it stands in the text. */
#ifndef JSON_READER_H
#define JSON_READER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* One value, known to be valid. */
typedef struct {
    const char *begin, *end;
} Json;

/* False unless the whole text is one value in valid UTF-8, nested no deeper than 32. Nothing else is safe to call
   with a value that does not come from here. */
static bool json_read(const char *text, size_t size, Json *value);

/* Elements of an array, or members of an object, one by one: the first if `after` is NULL, else the one behind it. */
static bool json_element(Json array, const Json *after, Json *element);
static bool json_member(Json object, const Json *after, Json *key, Json *value);

/* The member of that name; the last one if there are several. */
static bool json_find(Json object, const char *key, Json *value);

static bool json_is_null(Json value);
static bool json_is_object(Json value);
static bool json_is_array(Json value);
static bool json_is_text(Json value);

/* False if it is not finite, or no number. */
static bool json_number(Json value, double *number);

/* False unless it is a whole number from 0 to 2^53 - 1, written without a point or an exponent. */
static bool json_count(Json value, uint64_t *count);

/* Decodes a text for people, on one line, and ends it with 0: a space stands for a control character, U+FFFD for half a
   surrogate pair. False if it is none; `whole` says whether nothing was replaced, or left out for lack of room. */
static bool json_text(Json value, char *text, size_t size, bool *whole);

#endif

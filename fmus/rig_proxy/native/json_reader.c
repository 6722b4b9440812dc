/* Reading JSON. The text is checked once by walking over it; later walks may then trust it. */
#include "platform.h"

#include "json_reader.h"
#include "numbers.h"

#include <string.h>

enum { DEEPEST = 32 };

static const char *value_end(const char *p, const char *end, int depth);

static const char *space_end(const char *p, const char *end) {
    while (p < end && (*p == ' ' || *p == '\t' || *p == '\n' || *p == '\r'))
        p++;
    return p;
}

static bool is_digit(char c) { return c >= '0' && c <= '9'; }

static int hexadecimal(char c) {
    return is_digit(c) ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* The functions below return where a thing ends that begins at `p`, or NULL if there is none. */

static const char *word_end(const char *p, const char *end, const char *word) {
    size_t size = strlen(word);
    return (size_t)(end - p) >= size && memcmp(p, word, size) == 0 ? p + size : NULL;
}

static const char *digits_end(const char *p, const char *end) {
    const char *begin = p;
    while (p < end && is_digit(*p))
        p++;
    return p > begin ? p : NULL;
}

static const char *number_end(const char *p, const char *end) {
    if (p < end && *p == '-')
        p++;
    if (p < end && *p == '0')
        p++;
    else if ((p = digits_end(p, end)) == NULL)
        return NULL;
    if (p < end && *p == '.' && (p = digits_end(p + 1, end)) == NULL)
        return NULL;
    if (p < end && (*p == 'e' || *p == 'E')) {
        p++;
        if (p < end && (*p == '+' || *p == '-'))
            p++;
        p = digits_end(p, end);
    }
    return p;
}

static const char *escape_end(const char *p, const char *end) {
    if (end - p < 2)
        return NULL;
    if (p[1] != 'u')
        return p[1] != '\0' && strchr("\"\\/bfnrt", p[1]) != NULL ? p + 2 : NULL;
    if (end - p < 6)
        return NULL;
    for (int i = 2; i < 6; i++)
        if (hexadecimal(p[i]) < 0)
            return NULL;
    return p + 6;
}

/* One character of UTF-8, in the shortest form, no surrogate, at most U+10FFFF. */
static const char *character_end(const char *p, const char *end) {
    static const unsigned long least[] = {0, 0, 0x80, 0x800, 0x10000};
    unsigned char first = (unsigned char)*p;
    int length = first < 0x80 ? 1 : first < 0xc2 ? 0 : first < 0xe0 ? 2 : first < 0xf0 ? 3 : first < 0xf5 ? 4 : 0;
    unsigned long code = first;
    if (length == 0 || end - p < length)
        return NULL;
    if (length > 1)
        code = first & (0x7fu >> length);
    for (int i = 1; i < length; i++) {
        if (((unsigned char)p[i] & 0xc0) != 0x80)
            return NULL;
        code = code << 6 | ((unsigned char)p[i] & 0x3fu);
    }
    if (code < least[length] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000))
        return NULL;
    return p + length;
}

static const char *text_end(const char *p, const char *end) {
    if (p == end || *p != '"')
        return NULL;
    for (p++; p != NULL && p < end;)
        if (*p == '"')
            return p + 1;
        else if ((unsigned char)*p < ' ')
            return NULL;
        else
            p = *p == '\\' ? escape_end(p, end) : character_end(p, end);
    return NULL;
}

/* Key and colon of a member of an object. */
static const char *key_end(const char *p, const char *end) {
    if ((p = text_end(p, end)) == NULL)
        return NULL;
    p = space_end(p, end);
    return p < end && *p == ':' ? space_end(p + 1, end) : NULL;
}

static const char *container_end(const char *p, const char *end, int depth) {
    char close = *p == '{' ? '}' : ']';
    p = space_end(p + 1, end);
    if (p < end && *p == close)
        return p + 1;
    for (;;) {
        if (close == '}' && (p = key_end(p, end)) == NULL)
            return NULL;
        if ((p = value_end(p, end, depth + 1)) == NULL)
            return NULL;
        p = space_end(p, end);
        if (p == end)
            return NULL;
        if (*p == close)
            return p + 1;
        if (*p != ',')
            return NULL;
        p = space_end(p + 1, end);
    }
}

static const char *value_end(const char *p, const char *end, int depth) {
    if (p == end)
        return NULL;
    switch (*p) {
    case '{':
    case '[': return depth < DEEPEST ? container_end(p, end, depth) : NULL;
    case '"': return text_end(p, end);
    case 't': return word_end(p, end, "true");
    case 'f': return word_end(p, end, "false");
    case 'n': return word_end(p, end, "null");
    default: return number_end(p, end);
    }
}

bool json_read(const char *text, size_t size, Json *value) {
    const char *end = text + size;
    value->begin = space_end(text, end);
    value->end = value_end(value->begin, end, 0);
    return value->end != NULL && space_end(value->end, end) == end;
}

/* Where the next element or member begins, or NULL behind the last. */
static const char *next_begin(Json container, const Json *after) {
    const char *p = space_end(after == NULL ? container.begin + 1 : after->end, container.end);
    if (*p == ',')
        p = space_end(p + 1, container.end);
    return p < container.end - 1 ? p : NULL;
}

bool json_element(Json array, const Json *after, Json *element) {
    const char *begin = next_begin(array, after);
    if (begin == NULL)
        return false;
    element->end = value_end(begin, array.end, 0);
    element->begin = begin;
    return true;
}

bool json_member(Json object, const Json *after, Json *key, Json *value) {
    const char *begin = next_begin(object, after);
    if (begin == NULL)
        return false;
    key->begin = begin;
    key->end = text_end(begin, object.end);
    value->begin = key_end(begin, object.end);
    value->end = value_end(value->begin, object.end, 0);
    return true;
}

bool json_find(Json object, const char *key, Json *value) {
    Json name, member, *after = NULL;
    bool found = false;
    if (!json_is_object(object))
        return false;
    for (; json_member(object, after, &name, &member); after = &member) {
        char text[32];
        bool whole;
        if (json_text(name, text, sizeof text, &whole) && whole && strcmp(text, key) == 0) {
            *value = member;
            found = true;
        }
    }
    return found;
}

bool json_is_null(Json value) { return *value.begin == 'n'; }
bool json_is_object(Json value) { return *value.begin == '{'; }
bool json_is_array(Json value) { return *value.begin == '['; }
bool json_is_text(Json value) { return *value.begin == '"'; }

bool json_number(Json value, double *number) {
    return (*value.begin == '-' || is_digit(*value.begin)) && number_read(value.begin, value.end, number);
}

bool json_count(Json value, uint64_t *count) {
    *count = 0;
    for (const char *p = value.begin; p < value.end; p++) {
        if (!is_digit(*p))
            return false;
        *count = 10 * *count + (uint64_t)(*p - '0');
        if (*count >= UINT64_C(1) << 53)
            return false;
    }
    return true;
}

static unsigned long escaped(const char *p) {
    unsigned long code = 0;
    for (int i = 2; i < 6; i++)
        code = code << 4 | (unsigned long)hexadecimal(p[i]);
    return code;
}

enum { REPLACEMENT = 0xfffd };

/* The character that is escaped at `*p`, which moves on. */
static unsigned long decoded(const char **p, const char *end) {
    static const char names[] = "\"\\/bfnrt", meanings[] = "\"\\/\b\f\n\r\t";
    const char *begin = *p;
    unsigned long code;
    if (begin[1] != 'u') {
        *p += 2;
        return (unsigned char)meanings[strchr(names, begin[1]) - names];
    }
    *p += 6;
    code = escaped(begin);
    if (code >= 0xd800 && code < 0xdc00 && end - *p >= 6 && (*p)[0] == '\\' && (*p)[1] == 'u') {
        unsigned long low = escaped(*p);
        if (low >= 0xdc00 && low < 0xe000) {
            *p += 6;
            return 0x10000 + ((code - 0xd800) << 10) + (low - 0xdc00);
        }
    }
    return code;
}

/* What stands for a character in a line of text. */
static unsigned long shown(unsigned long code) {
    return code < ' ' ? ' ' : code >= 0xd800 && code < 0xe000 ? REPLACEMENT : code;
}

static size_t encoded(unsigned long code, char to[4]) {
    size_t length = code < 0x80 ? 1 : code < 0x800 ? 2 : code < 0x10000 ? 3 : 4;
    static const unsigned char mark[] = {0, 0, 0xc0, 0xe0, 0xf0};
    for (size_t i = length; i-- > 1; code >>= 6)
        to[i] = (char)(0x80 | (code & 0x3f));
    to[0] = (char)(mark[length] | code);
    return length;
}

bool json_text(Json value, char *text, size_t size, bool *whole) {
    const char *p = value.begin + 1, *end = value.end - 1; /* between the quotes */
    size_t used = 0;
    *whole = true;
    if (!json_is_text(value))
        return false;
    while (p < end) {
        char bytes[4];
        const char *from = p;
        size_t length;
        if (*p == '\\') {
            unsigned long code = decoded(&p, end);
            length = encoded(shown(code), bytes);
            *whole &= shown(code) == code;
            from = bytes;
        } else {
            p = character_end(p, value.end);
            length = (size_t)(p - from);
        }
        if (used + length >= size) {
            *whole = false;
            break;
        }
        memcpy(text + used, from, length);
        used += length;
    }
    text[used] = '\0';
    return true;
}

/* The path in a resource location. */
#include "resources.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

static int hexadecimal(char c) {
    static const char digits[] = "0123456789abcdefABCDEF";
    const char *digit = c == '\0' ? NULL : strchr(digits, c);
    return digit == NULL ? -1 : (int)(digit - digits) - (digit - digits > 15 ? 6 : 0);
}

static bool is_drive(const char *path) {
    return path[0] == '/' && ((path[1] | 32) >= 'a' && (path[1] | 32) <= 'z') && path[2] == ':';
}

/* Undoes the percent encoding in place; what is not a valid code stays as it is. */
static void decode(char *text) {
    char *to = text;
    for (; *text != '\0'; text++) {
        int high = *text == '%' ? hexadecimal(text[1]) : -1, low = high < 0 ? -1 : hexadecimal(text[2]);
        bool code = low >= 0 && (high | low) != 0;
        *to++ = code ? (char)(16 * high + low) : *text;
        text += code ? 2 : 0;
    }
    *to = '\0';
}

char *resource_path(const char *location) {
    char *path;
    size_t length;
    bool uri;
    if (location == NULL || *location == '\0')
        return NULL;
    uri = strncmp(location, "file:", 5) == 0 || strncmp(location, "FILE:", 5) == 0;
    if (uri)
        location += 5;
    if (uri && strncmp(location, "//localhost/", 12) == 0)
        location += 11;
    else if (uri && strncmp(location, "///", 3) == 0)
        location += 2;
    path = *location == '\0' ? NULL : malloc(strlen(location) + 1);
    if (path == NULL)
        return NULL;
    strcpy(path, location);
    if (uri)
        decode(path);
    if (uri && is_drive(path))
        memmove(path, path + 1, strlen(path));
    length = strlen(path);
    if (length > 1 && path[length - 1] == '/')
        path[length - 1] = '\0';
    return path;
}

/* A log of the calls of an FMU: this library is in its place, calls it, and writes a line for each call.
 *
 * Beside it lies its table, a text file that `calls.py` writes: the library of the FMU, the file of the log, and how
 * many lines it may have. `calls2.c` and `calls3.c` list the functions of FMI 2.0 and 3.0. A call is in the file before the
 * FMU works, so that the last line of one that crashes names what it was asked.
 */
#include "platform.c"

#include <stdarg.h>

enum { MOST_ELEMENTS = 20, MOST_CHARACTERS = 200, LINE = 8192 };

static FILE *log_file;
static void *library;
static int instances;
static unsigned long lines, most_lines;
static char line[LINE];
static size_t length;
static int is_first; /* of the arguments */

static void add(const char *format, ...) {
    va_list arguments;
    if (!log_file || lines > most_lines) return;
    va_start(arguments, format);
    int count = vsnprintf(line + length, LINE - length, format, arguments);
    va_end(arguments);
    if (count > 0) length = length + (size_t)count < LINE ? length + (size_t)count : LINE - 1;
}

static void write_line(void) {
    if (length) fwrite(line, 1, length, log_file);
    length = 0;
}

/* Have all in the file that is known before the FMU works. */
static void let_go(void) {
    write_line();
    if (log_file && lines <= most_lines) fflush(log_file);
}

static void begin(const char *function) {
    if (lines <= most_lines) lines++;
    add("%s(", function);
    is_first = 1;
}

static void end(int status) {
    static const char *const names[] = {"OK", "Warning", "Discard", "Error", "Fatal", "Pending"};
    add(") -> %s\n", status >= 0 && status < 6 ? names[status] : "an unknown status");
    if (lines == most_lines) add("(no more than %lu calls are logged)\n", most_lines);
    write_line();
}

static void name_argument(const char *name) {
    add("%s%s=", is_first ? "" : ", ", name);
    is_first = 0;
}

/* The shortest decimal number that is read as the same. */
static void add_real(double value) {
    char text[32];
    for (int digits = 15; digits <= 17; digits++) {
        snprintf(text, sizeof text, "%.*g", digits, value);
        if (strtod(text, NULL) == value) break;
    }
    add("%s", text);
}

static void add_text(const char *value) {
    add(value ? "\"" : "NULL");
    for (size_t i = 0; value && value[i] && i < MOST_CHARACTERS; i++)
        add("%c", (unsigned char)value[i] < ' ' ? ' ' : value[i]);
    if (value) add("\"");
}

static void real(const char *name, double value) {
    name_argument(name);
    add_real(value);
}

static void text(const char *name, const char *value) {
    name_argument(name);
    add_text(value);
}

static void whole(const char *name, long long value) {
    name_argument(name);
    add("%lld", value);
}

static void truth(const char *name, int value) {
    name_argument(name);
    add(value ? "true" : "false");
}

static void address(const char *name, const void *value) {
    name_argument(name);
    add("%p", value);
}

/* Arrays, of which the first elements are written. */
#define ARRAY(function, type, add_element)                                                                             \
    static void function(const char *name, const type *values, size_t n) {                                            \
        name_argument(name);                                                                                           \
        add("[");                                                                                                      \
        for (size_t i = 0; values && i < n && i < MOST_ELEMENTS; i++) {                                               \
            if (i) add(", ");                                                                                          \
            add_element;                                                                                               \
        }                                                                                                              \
        if (n > MOST_ELEMENTS) add(", ... %lu of them", (unsigned long)n);                                             \
        add("]");                                                                                                      \
    }
ARRAY(references, unsigned, add("%u", values[i]))
ARRAY(reals, double, add_real(values[i]))
ARRAY(integers, int, add("%d", values[i]))
ARRAY(texts, char *const, add_text(values[i]))

/* Load the library of the FMU, and open the log, for the first of its instances; returns whether that has succeeded. */
static int load_own(void) {
    char reason[MOST_PATH] = "";
    FILE *table = instances++ ? NULL : open_table();
    char *path = table ? read_line(table) : NULL, *log_path = path ? read_line(table) : NULL;
    int is_bounded = log_path && fscanf(table, "%lu", &most_lines) == 1;
    if (table) fclose(table);
    if (is_bounded) {
        library = open_library(path, reason, sizeof reason);
        log_file = open_file(log_path, 1);
    }
    free(path);
    free(log_path);
    return library != NULL;
}

/* Unload it with the last of its instances; returns NULL. */
static void *unload_own(void) {
    if (--instances) return NULL;
    if (log_file) fclose(log_file);
    if (library) close_library(library);
    log_file = NULL;
    library = NULL;
    return NULL;
}

/* A call of the FMU, with its arguments before and its results after it. */
#define LOGGED(version, name, parameters, arguments, before, after)                                                     \
    FMI##version##_Export fmi##version##Status fmi##version##name parameters {                                           \
        int status = 3; /* Error, of a function that the FMU lacks */                                                  \
        begin("fmi" #version #name);                                                                                   \
        before;                                                                                                        \
        let_go();                                                                                                      \
        if (own.name) status = (int)own.name arguments;                                                                \
        if (status <= 1) {                                                                                             \
            after;                                                                                                     \
        }                                                                                                              \
        end(status);                                                                                                   \
        return (fmi##version##Status)status;                                                                           \
    }

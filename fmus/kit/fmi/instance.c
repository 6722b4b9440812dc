/* The instance: its modes, its memory, and the reporting of errors. */
#include "instance.h"

#include <stdarg.h>
#include <stdio.h>

static const char *const categories[] = {"logStatusOK", "logStatusWarning", "logStatusDiscard", "logStatusError",
                                         "logStatusFatal"};

static const char *mode_name(int mode) {
    switch (mode) {
    case INSTANTIATED: return "before initialization";
    case INITIALIZATION: return "during initialization";
    case STEP_COMPLETE: return "between steps";
    case EVENT: return "in event mode";
    case CONTINUOUS: return "in continuous-time mode";
    case FAILED: return "after an error";
    default: return "after termination";
    }
}

/* Bytes of the UTF-8 character that `text` begins with; 0 if it is broken, as at the end of a truncated message. */
static int character_length(const char *text) {
    unsigned char first = (unsigned char)*text;
    int length = first < 0x80 ? 1 : first < 0xc0 ? 0 : first < 0xe0 ? 2 : first < 0xf0 ? 3 : first < 0xf8 ? 4 : 0;
    for (int i = 1; i < length; i++)
        if (((unsigned char)text[i] & 0xc0) != 0x80)
            return 0;
    return length;
}

void deliver(const Host *host, const char *name, Status status, const char *text) {
    char line[2 * MESSAGE_SIZE], *end = line;
    if (!host_listens(host))
        return;
    while (*text != '\0') {
        int length = character_length(text);
        if (*text == '%' && host_reads_formats)
            *end++ = '%';
        *end = length == 0 ? '?' : (unsigned char)*text < ' ' ? ' ' : *text;
        for (int i = 1; i < length; i++)
            end[i] = text[i];
        end += length == 0 ? 1 : length;
        text += length == 0 ? 1 : length;
    }
    *end = '\0';
    host_log(host, name, status, categories[status], line);
}

Status report(const Instance *instance, Status status, const char *format, ...) {
    Message text;
    va_list arguments;
    if (status < FMI(Discard) && !instance->logging)
        return status;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    deliver(&instance->host, instance->name, status, text);
    return status;
}

bool allowed(const Instance *instance, int modes, const char *function) {
    if (instance == NULL)
        return false;
    if (((int)instance->now.mode & modes) != 0)
        return true;
    report(instance, FMI(Error), "%s is not allowed %s", function, mode_name((int)instance->now.mode));
    return false;
}

void touch(Instance *instance, bool parameters) {
    double *memory = instance->now.memory;
    instance->now.outputs_outdated = instance->now.derivatives_outdated = 1.0;
    if (!parameters)
        return;
    memory[MEMORY_PARAMETERS_CHANGED] = 1.0;
    if (((int)instance->now.mode & BEFORE_START) != 0)
        for (int i = 0; i < MODEL_STATES + MODEL_DISCRETES; i++)
            memory[FIRST_STATE + i] = memory[model_start_of[i]];
}

Status fail(Instance *instance) {
    instance->now = instance->before;
    instance->now.mode = FAILED;
    instance->now.memory[MEMORY_PARAMETERS_CHANGED] = 1.0;
    return FMI(Error);
}

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

/* Loggers read the message as a printf format, some without arguments: doubling each % suits both kinds. */
void deliver(const fmi2CallbackFunctions *host, const char *name, fmi2Status status, const char *text) {
    char line[2 * MESSAGE_SIZE], *end = line;
    if (host->logger == NULL)
        return;
    while (*text != '\0') {
        int length = character_length(text);
        if (*text == '%')
            *end++ = '%';
        *end = length == 0 ? '?' : (unsigned char)*text < ' ' ? ' ' : *text;
        for (int i = 1; i < length; i++)
            end[i] = text[i];
        end += length == 0 ? 1 : length;
        text += length == 0 ? 1 : length;
    }
    *end = '\0';
    host->logger(host->componentEnvironment, name, status, categories[status], line);
}

fmi2Status report(const Instance *instance, fmi2Status status, const char *format, ...) {
    Message text;
    va_list arguments;
    if (status < fmi2Discard && !instance->logging)
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
    report(instance, fmi2Error, "%s is not allowed %s", function, mode_name((int)instance->now.mode));
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

fmi2Status fail(Instance *instance) {
    instance->now = instance->before;
    instance->now.mode = FAILED;
    instance->now.memory[MEMORY_PARAMETERS_CHANGED] = 1.0;
    return fmi2Error;
}

/* Calls the external functions of a wrapper as a compiled model does; errors come back as texts. */
#include "ppy_rig_fmu.h"

#include <setjmp.h>

#ifdef _WIN32
#define SHOWN __declspec(dllexport)
#else
#define SHOWN __attribute__((visibility("default")))
#endif

static jmp_buf model;
static char error[1024];

void ModelicaFormatError(const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(error, sizeof error, format, arguments);
    va_end(arguments);
    longjmp(model, 1);
}

SHOWN const char *last_error(void) { return error; }

SHOWN void *open_fmu(const char *name, const char *guid, const char *types, int inputs, const double *parameters,
                     size_t count) {
    return setjmp(model) ? NULL : ppy_rig_open(name, guid, types, inputs, parameters, count);
}

SHOWN int communicate(void *fmu, double time, const double *inputs, size_t count, const int *outputs, size_t shown,
                      double *values) {
    if (setjmp(model))
        return 0;
    ppy_rig_communicate(fmu, time, inputs, count, outputs, shown, values);
    return 1;
}

SHOWN void close_fmu(void *fmu) { ppy_rig_close(fmu); }

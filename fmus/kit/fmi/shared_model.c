/* A library of a model, for an engine in a library of its own (record.c). */
#include "export.h"
#include "this_model.h"

EXPORT const Model *ppy_model(void) { return &this_model; }

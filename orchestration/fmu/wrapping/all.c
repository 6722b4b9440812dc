#include "table.c" /* first: it needs features of the system's headers */
#include "values.c"
#include "events.c"
#include "wrapper.c"

/* The table beside the wrapper's library, and the library of the FMU that it names. */
#include "platform.c"

#include "wrapper.h"

enum { MOST_VARIABLES = 10000000 };

static void bind_functions(component *c) {
    void *address;
#define BIND(name)                                                                                                     \
    address = find(c->library, "fmi3" #name);                                                                          \
    memcpy(&c->call.name, &address, sizeof address);
    FUNCTIONS(BIND)
#undef BIND
}

static int read_variables(component *c, FILE *table) {
    unsigned long count;
    if (fscanf(table, "%lu", &count) != 1 || count > MOST_VARIABLES) return 0;
    c->variables = calloc(count + 1, sizeof *c->variables);
    if (!c->variables) return 0;
    for (; c->variable_count < count; c->variable_count++) {
        unsigned kind;
        unsigned long reference, elements;
        if (fscanf(table, "%u %lu %lu", &kind, &reference, &elements) != 3 || kind >= TYPES) return 0;
        if (elements > MOST_VARIABLES - c->element_count) return 0;
        variable *v = &c->variables[c->variable_count];
        v->type = (type)kind;
        v->reference = (fmi3ValueReference)reference;
        v->first = c->element_count;
        v->count = elements;
        c->element_count += elements;
    }
    return 1;
}

static int read_clocks(component *c, FILE *table) {
    unsigned long count;
    int kind;
    if (fscanf(table, "%d %lu", &kind, &count) != 2 || count > MOST_VARIABLES) return 0;
    c->kind = (interface_type)kind;
    c->clocks = calloc(count + 1, sizeof *c->clocks);
    if (!c->clocks) return 0;
    for (; c->clock_count < count; c->clock_count++) {
        ticking *k = &c->clocks[c->clock_count];
        unsigned long reference;
        if (fscanf(table, "%d %lu %lf %lf", &kind, &reference, &k->interval, &k->shift) != 4) return 0;
        k->kind = kind;
        k->reference = (fmi3ValueReference)reference;
    }
    return 1;
}

/* Room for the values of any selection; of no type are they wider than a pointer or a double. */
static int make_room(component *c) {
    size_t elements = c->element_count + 1;
    c->owners = calloc(elements, sizeof *c->owners);
    c->references = calloc(c->variable_count + 1, sizeof *c->references);
    c->values = calloc(elements, sizeof(double));
    c->derivatives = calloc(elements, sizeof(double));
    if (!c->owners || !c->references || !c->values || !c->derivatives) return 0;
    c->counted = calloc(c->variable_count + 1, sizeof *c->counted);
    if (!c->counted) return 0;
    for (size_t k = 0; k < c->variable_count; k++) {
        if (c->variables[k].type == TYPE_Clock) c->counted[c->counted_count++] = &c->variables[k];
        for (size_t i = 0; i < c->variables[k].count; i++) c->owners[c->variables[k].first + i] = k;
    }
    return 1;
}

int load(component *c) {
    char reason[MOST_PATH] = "";
    FILE *table = open_table();
    char *library = table ? read_line(table) : NULL;
    c->resources = library ? read_line(table) : NULL;
    int complete = c->resources && read_variables(c, table) && read_clocks(c, table) && make_room(c);
    if (table) fclose(table);
    if (!complete)
        tell(c, fmi2Error, "the table of its variables, or the memory for them, is missing");
    else if (!(c->library = open_library(library, reason, sizeof reason)))
        tell(c, fmi2Error, "its library cannot be loaded (%s)", reason);
    else
        bind_functions(c);
    free(library);
    return c->library != NULL;
}

void unload(component *c) {
    if (c->library) close_library(c->library);
    free(c->resources);
    free(c->variables);
    free(c->owners);
    free(c->references);
    free(c->places);
    free(c->values);
    free(c->derivatives);
    free(c->digits);
    free(c->clocks);
    free(c->counted);
    free(c->row);
    free(c->late_elements);
    free(c->late_row);
    free(c->reading.elements);
    free(c->reading.references);
    free(c->writing.elements);
    free(c->writing.references);
    free(c->name);
    free(c);
}

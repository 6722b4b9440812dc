/* Values of variables: elements that FMI 2.0 names one by one, and FMI 3.0 moves with their whole variables.
 *
 * All variables of one type are moved by one call. The time is linear in the number of elements, whatever their order.
 */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "wrapper.h"

#define MOST_EXACT 9007199254740992.0 /* 2^53 */

/* Variables of one type among the references of a call, each once. */
typedef struct {
    size_t variables; /* their number; their references are in c->references */
    size_t values;    /* number of their elements */
    size_t given;     /* number of elements in the call */
    int in_order;     /* whether these are all elements, in their order */
} selection;

static variable *owner(const component *c, fmi2ValueReference element) { return &c->variables[c->owners[element]]; }

/* Make room for one more number for each element of a call; returns a status. */
static fmi2Status reserve(component *c, size_t count) {
    if (count <= c->place_room) return fmi2OK;
    size_t *places = realloc(c->places, count * sizeof *places);
    if (places) c->places = places;
    double *row = realloc(c->row, count * sizeof *row);
    if (row) c->row = row;
    if (!places || !row) {
        tell(c, fmi2Error, "there is no memory for %lu values", (unsigned long)count);
        return fmi2Error;
    }
    c->place_room = count;
    return fmi2OK;
}

/* Note the types of the elements of a call, as bits; returns a status. */
static fmi2Status find_types(component *c, const fmi2ValueReference elements[], size_t count, unsigned *types) {
    *types = 0;
    for (size_t i = 0; i < count; i++) {
        if (elements[i] >= c->element_count) {
            tell(c, fmi2Error, "there is no value reference %u", elements[i]);
            return fmi2Error;
        }
        *types |= 1u << owner(c, elements[i])->type;
    }
    return reserve(c, count);
}

/* Select the variables of a type; the place of the i-th element among their values is c->places[i]. */
static selection select_type(component *c, type wanted, const fmi2ValueReference elements[], size_t count) {
    selection s = {0, 0, 0, 1};
    c->selection++;
    for (size_t i = 0; i < count; i++) {
        variable *v = owner(c, elements[i]);
        if (v->type != wanted) continue;
        if (v->selected != c->selection) {
            v->selected = c->selection;
            v->place = s.values;
            s.values += v->count;
            c->references[s.variables++] = v->reference;
        }
        c->places[i] = v->place + (elements[i] - v->first);
        s.in_order &= c->places[i] == s.given;
        s.given++;
    }
    s.in_order &= s.given == s.values;
    return s;
}

static fmi2Status get(component *c, type t, const selection *s, void *values) {
    switch (t) {
#define GET(name)                                                                                                      \
    case TYPE_##name:                                                                                                  \
        return CALL(c, Get##name, c->references, s->variables, (fmi3##name *)values, s->values);
        NUMBERS(GET)
        GET(String)
#undef GET
    case TYPE_Clock:
        for (size_t k = 0; k < c->counted_count; k++)
            if (c->counted[k]->selected == c->selection) ((double *)values)[c->counted[k]->place] = c->counted[k]->ticks;
        return fmi2OK;
    default: return fmi2Error;
    }
}

static fmi2Status set(component *c, type t, const selection *s, const void *values) {
    switch (t) {
#define SET(name)                                                                                                      \
    case TYPE_##name:                                                                                                  \
        return CALL(c, Set##name, c->references, s->variables, (const fmi3##name *)values, s->values);
        NUMBERS(SET)
        SET(String)
#undef SET
    default: return fmi2Error;
    }
}

static double number(type t, const void *values, size_t place) {
    switch (t) {
#define READ(name)                                                                                                     \
    case TYPE_##name: return (double)((const fmi3##name *)values)[place];
        NUMBERS(READ)
#undef READ
    case TYPE_Clock: return ((const double *)values)[place];
    default: return 0.0;
    }
}

static void put(type t, void *values, size_t place, double number) {
    switch (t) {
#define WRITE(name)                                                                                                    \
    case TYPE_##name: ((fmi3##name *)values)[place] = (fmi3##name)number; break;
        NUMBERS(WRITE)
#undef WRITE
    default: break;
    }
}

/* Whether a type holds a number; what is read as an FMI 2.0 integer has no more than 32 bits. */
static int holds(type t, double number) {
    static const struct {
        double low, high;
    } ranges[TYPES] = {[TYPE_Int8] = {-128.0, 127.0},
                       [TYPE_UInt8] = {0.0, 255.0},
                       [TYPE_Int16] = {-32768.0, 32767.0},
                       [TYPE_UInt16] = {0.0, 65535.0},
                       [TYPE_Int32] = {-2147483648.0, 2147483647.0},
                       [TYPE_UInt32] = {0.0, 4294967295.0},
                       [TYPE_Int64] = {-MOST_EXACT, MOST_EXACT},
                       [TYPE_UInt64] = {0.0, MOST_EXACT},
                       [TYPE_Boolean] = {0.0, 1.0}};
    if (t == TYPE_Float32) return !isfinite(number) || fabs(number) <= FLT_MAX;
    if (t == TYPE_Float64) return 1;
    return number >= ranges[t].low && number <= ranges[t].high && number == (double)(long long)number;
}

static int is_same(const direct_call *d, const fmi2ValueReference elements[], size_t count) {
    return count > 0 && d->count == count && !memcmp(d->elements, elements, count * sizeof *elements);
}

static void remember(component *c, direct_call *d, const fmi2ValueReference elements[], const selection *s) {
    fmi2ValueReference *own = realloc(d->elements, s->given * sizeof *own);
    if (own) d->elements = own;
    fmi3ValueReference *references = realloc(d->references, s->variables * sizeof *references);
    if (references) d->references = references;
    d->count = own && references ? s->given : 0;
    d->variables = s->variables;
    if (!d->count) return;
    memcpy(own, elements, s->given * sizeof *own);
    memcpy(references, c->references, s->variables * sizeof *references);
}

fmi2Status worse(fmi2Status a, fmi2Status b) { return a > b ? a : b; }

/* Read numbers of any types. */
static fmi2Status read_row(component *c, const fmi2ValueReference elements[], size_t count, double row[]) {
    unsigned types;
    fmi2Status status = settle(c);
    if (status <= fmi2Warning && is_same(&c->reading, elements, count))
        return worse(status, CALL(c, GetFloat64, c->reading.references, c->reading.variables, row, count));
    if (status <= fmi2Warning) status = worse(status, find_types(c, elements, count, &types));
    for (type t = 0; t < TYPE_String && status <= fmi2Warning; t++) {
        if (!(types & 1u << t)) continue;
        selection s = select_type(c, t, elements, count);
        int direct = t == TYPE_Float64 && s.in_order && s.given == count;
        if (direct) remember(c, &c->reading, elements, &s);
        status = worse(status, get(c, t, &s, direct ? row : c->values));
        if (direct || status > fmi2Warning) continue;
        for (size_t i = 0; i < count; i++) {
            if (owner(c, elements[i])->type != t) continue;
            row[i] = number(t, c->values, c->places[i]);
            if ((t == TYPE_Int64 || t == TYPE_UInt64) && !holds(t, row[i])) {
                tell(c, fmi2Warning, "%.17g is beyond 2^53 and rounded", row[i]);
                status = fmi2Warning;
            }
        }
    }
    return status;
}

/* Keep elements of a type for initialization mode. */
static fmi2Status postpone(component *c, type t, const fmi2ValueReference elements[], size_t count,
                           const double row[]) {
    size_t needed = c->late_count + count;
    if (needed > c->late_room) {
        size_t room = 2 * needed;
        fmi2ValueReference *late = realloc(c->late_elements, room * sizeof *late);
        if (late) c->late_elements = late;
        double *values = realloc(c->late_row, room * sizeof *values);
        if (values) c->late_row = values;
        if (!late || !values) {
            tell(c, fmi2Error, "there is no memory for %lu values", (unsigned long)needed);
            return fmi2Error;
        }
        c->late_room = room;
    }
    for (size_t i = 0; i < count; i++) {
        if (owner(c, elements[i])->type != t) continue;
        c->late_elements[c->late_count] = elements[i];
        c->late_row[c->late_count++] = row[i];
    }
    return fmi2OK;
}

static int all_hold(component *c, type t, const fmi2ValueReference elements[], size_t count, const double row[]) {
    for (size_t i = 0; i < count; i++) {
        const variable *v = owner(c, elements[i]);
        if (v->type == t && !holds(t, row[i])) {
            if ((t == TYPE_Int64 || t == TYPE_UInt64) && fabs(row[i]) > MOST_EXACT)
                tell(c, fmi2Error, "%.17g is beyond 2^53, up to which integers of 64 bits are exact here", row[i]);
            else
                tell(c, fmi2Error, "%.17g is no value of the type of value reference %lu", row[i],
                     (unsigned long)v->reference);
            return 0;
        }
    }
    return 1;
}

/* Write numbers of any types; elements of a variable that are not given keep their values. */
static fmi2Status write_row(component *c, const fmi2ValueReference elements[], size_t count, const double row[]) {
    unsigned types;
    fmi2Status status = enter_events(c);
    if (status <= fmi2Warning && !c->late_count && is_same(&c->writing, elements, count))
        return worse(status, CALL(c, SetFloat64, c->writing.references, c->writing.variables, row, count));
    if (status <= fmi2Warning) status = worse(status, find_types(c, elements, count, &types));
    for (type t = 0; t < TYPE_String && status <= fmi2Warning; t++) {
        if (!(types & 1u << t)) continue;
        selection s = select_type(c, t, elements, count);
        int direct = t == TYPE_Float64 && s.in_order && s.given == count;
        if (direct) remember(c, &c->writing, elements, &s);
        if (!all_hold(c, t, elements, count, row)) return fmi2Error;
        if (!c->entered && (!s.in_order || c->late_count)) { /* in the order in which they were given */
            status = worse(status, postpone(c, t, elements, count, row));
            continue;
        }
        if (!s.in_order) status = worse(status, get(c, t, &s, c->values));
        for (size_t i = 0; i < count && !direct && status <= fmi2Warning; i++)
            if (owner(c, elements[i])->type == t) put(t, c->values, c->places[i], row[i]);
        if (status <= fmi2Warning) status = worse(status, set(c, t, &s, direct ? row : c->values));
    }
    return status;
}

fmi2Status write_late(component *c) {
    size_t count = c->late_count;
    c->entered = 1;
    c->late_count = 0;
    return count ? write_row(c, c->late_elements, count, c->late_row) : fmi2OK;
}

static fmi2Status read_whole(component *c, const fmi2ValueReference elements[], size_t count, int values[]) {
    fmi2Status status = reserve(c, count);
    if (status == fmi2OK) status = read_row(c, elements, count, c->row);
    for (size_t i = 0; i < count && status <= fmi2Warning; i++) {
        if (!holds(TYPE_Int32, c->row[i])) {
            tell(c, fmi2Error, "%.17g is beyond the integers of FMI 2.0", c->row[i]);
            return fmi2Error;
        }
        values[i] = (int)c->row[i];
    }
    return status;
}

static fmi2Status write_whole(component *c, const fmi2ValueReference elements[], size_t count, const int values[]) {
    fmi2Status status = reserve(c, count);
    if (status != fmi2OK) return status;
    for (size_t i = 0; i < count; i++) c->row[i] = values[i];
    return write_row(c, elements, count, c->row);
}

FMI2_Export fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real values[]) {
    return read_row(c, r, n, values);
}

FMI2_Export fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Integer values[]) {
    return read_whole(c, r, n, values);
}

FMI2_Export fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Boolean values[]) {
    return read_whole(c, r, n, values);
}

FMI2_Export fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real values[]) {
    return write_row(c, r, n, values);
}

FMI2_Export fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                      const fmi2Integer values[]) {
    return write_whole(c, r, n, values);
}

FMI2_Export fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                      const fmi2Boolean values[]) {
    return write_whole(c, r, n, values);
}

/* ---- texts, and binary values as hexadecimal ones ------------------------------------------------- */

static fmi2Status no_memory(const component *c, size_t count) {
    tell(c, fmi2Error, "there is no memory for %lu characters", (unsigned long)count);
    return fmi2Error;
}

/* Read binary values as texts, which stay until the next call. */
static fmi2Status get_digits(component *c, const selection *s, char **texts) {
    size_t needed = 1;
    size_t *sizes = calloc(s->values + 1, sizeof *sizes);
    fmi3Binary *bytes = calloc(s->values + 1, sizeof *bytes);
    fmi2Status status = sizes && bytes ? fmi2OK : no_memory(c, s->values);
    if (status == fmi2OK) status = CALL(c, GetBinary, c->references, s->variables, sizes, bytes, s->values);
    for (size_t k = 0; k < s->values && status <= fmi2Warning; k++) needed += 2 * sizes[k] + 1;
    char *digits = status <= fmi2Warning ? realloc(c->digits, needed) : NULL;
    if (digits) c->digits = digits;
    if (!digits && status <= fmi2Warning) status = no_memory(c, needed);
    for (size_t k = 0; k < s->values && status <= fmi2Warning; k++) {
        texts[k] = digits;
        for (size_t i = 0; i < sizes[k]; i++) digits += sprintf(digits, "%02x", bytes[k][i]);
        *digits++ = 0;
    }
    free(sizes);
    free(bytes);
    return status;
}

static int hexadecimal(char digit) {
    static const char digits[] = "0123456789abcdef0123456789ABCDEF";
    const char *found = digit ? strchr(digits, digit) : NULL;
    return found ? (int)((found - digits) % 16) : -1;
}

/* Set binary values to hexadecimal texts. */
static fmi2Status set_digits(component *c, const selection *s, const fmi3String *texts) {
    size_t needed = 1;
    for (size_t k = 0; k < s->values; k++) needed += strlen(texts[k]) / 2;
    size_t *sizes = calloc(s->values + 1, sizeof *sizes);
    fmi3Binary *bytes = calloc(s->values + 1, sizeof *bytes);
    unsigned char *memory = malloc(needed), *end = memory;
    fmi2Status status = sizes && bytes && memory ? fmi2OK : no_memory(c, needed);
    for (size_t k = 0; k < s->values && status == fmi2OK; k++) {
        const char *digit = texts[k];
        bytes[k] = end;
        for (; *digit && hexadecimal(digit[0]) >= 0 && hexadecimal(digit[1]) >= 0; digit += 2)
            *end++ = (unsigned char)(16 * hexadecimal(digit[0]) + hexadecimal(digit[1]));
        sizes[k] = (size_t)(end - bytes[k]);
        if (!*digit) continue;
        tell(c, fmi2Error, "%.40s is no binary value: two hexadecimal digits for each byte, such as 00ff", texts[k]);
        status = fmi2Error;
    }
    if (status == fmi2OK) status = CALL(c, SetBinary, c->references, s->variables, sizes, bytes, s->values);
    free(sizes);
    free(bytes);
    free(memory);
    return status;
}

/* Note the types of texts, as bits; returns a status. */
static fmi2Status find_text_types(component *c, const fmi2ValueReference elements[], size_t count, unsigned *types) {
    fmi2Status status = find_types(c, elements, count, types);
    if (status != fmi2OK || !(*types & ~(1u << TYPE_String | 1u << TYPE_Binary))) return status;
    tell(c, fmi2Error, "a variable among them is no text");
    return fmi2Error;
}

static fmi2Status get_texts(component *c, type t, const selection *s) {
    return t == TYPE_Binary ? get_digits(c, s, c->values) : get(c, t, s, c->values);
}

/* Binary values come first: of texts, the FMU's memory counts until it is called again. */
FMI2_Export fmi2Status fmi2GetString(fmi2Component p, const fmi2ValueReference r[], size_t n, fmi2String values[]) {
    component *c = p;
    const fmi3String *texts = c->values;
    unsigned types = 0;
    fmi2Status status = settle(c);
    if (status <= fmi2Warning) status = worse(status, find_text_types(c, r, n, &types));
    for (type t = TYPE_Binary; t >= TYPE_String && status <= fmi2Warning; t--) {
        if (!(types & 1u << t)) continue;
        selection s = select_type(c, t, r, n);
        status = worse(status, get_texts(c, t, &s));
        for (size_t i = 0; i < n && status <= fmi2Warning; i++)
            if (owner(c, r[i])->type == t) values[i] = texts[c->places[i]];
    }
    return status;
}

/* Texts that are not given are copied first: those of the FMU are gone as soon as it is called again. */
static fmi2Status set_texts(component *c, type t, const fmi2ValueReference r[], size_t n, const fmi2String values[]) {
    fmi3String *texts = c->values;
    char **copies = NULL;
    selection s = select_type(c, t, r, n);
    fmi2Status status = fmi2OK;
    if (!s.in_order) {
        status = get_texts(c, t, &s);
        copies = calloc(s.values + 1, sizeof *copies);
        for (size_t k = 0; k < s.values && copies && status <= fmi2Warning; k++) {
            size_t room = texts[k] ? strlen(texts[k]) + 1 : 1;
            copies[k] = calloc(room, 1);
            if (copies[k] && texts[k]) memcpy(copies[k], texts[k], room);
            texts[k] = copies[k] ? copies[k] : "";
        }
        if (!copies) status = fmi2Error;
    }
    for (size_t i = 0; i < n && status <= fmi2Warning; i++)
        if (owner(c, r[i])->type == t) texts[c->places[i]] = values[i];
    if (status <= fmi2Warning)
        status = worse(status, t == TYPE_Binary ? set_digits(c, &s, texts) : set(c, t, &s, texts));
    for (size_t k = 0; k < s.values && copies; k++) free(copies[k]);
    free(copies);
    return status;
}

FMI2_Export fmi2Status fmi2SetString(fmi2Component p, const fmi2ValueReference r[], size_t n,
                                     const fmi2String values[]) {
    component *c = p;
    unsigned types = 0;
    fmi2Status status = enter_events(c);
    if (status <= fmi2Warning) status = worse(status, find_text_types(c, r, n, &types));
    for (type t = TYPE_String; t <= TYPE_Binary && status <= fmi2Warning; t++)
        if (types & 1u << t) status = worse(status, set_texts(c, t, r, n, values));
    return status;
}

/* Seeds of elements that are not among the knowns are 0. */
FMI2_Export fmi2Status fmi2GetDirectionalDerivative(fmi2Component p, const fmi2ValueReference unknowns[],
                                                    size_t unknown_count, const fmi2ValueReference knowns[],
                                                    size_t known_count, const fmi2Real seeds[],
                                                    fmi2Real sensitivities[]) {
    component *c = p;
    double *values = c->values, *derivatives = c->derivatives;
    unsigned types, own;
    fmi2Status status = find_types(c, knowns, known_count, &types);
    if (status == fmi2OK) status = find_types(c, unknowns, unknown_count, &own);
    if (status != fmi2OK) return status;
    types |= own;
    type t = types == 1u << TYPE_Float32 ? TYPE_Float32 : TYPE_Float64;
    if (types & ~(1u << t)) {
        tell(c, fmi2Error, "derivatives are of Float64 by Float64");
        return fmi2Error;
    }
    selection s = select_type(c, t, knowns, known_count);
    memset(values, 0, s.values * sizeof *values);
    for (size_t i = 0; i < known_count; i++) values[c->places[i]] += seeds[i];
    fmi3ValueReference *known_references = malloc((s.variables + 1) * sizeof *known_references);
    if (!known_references) return fmi2Error;
    memcpy(known_references, c->references, s.variables * sizeof *known_references);
    selection u = select_type(c, t, unknowns, unknown_count);
    status = CALL(c, GetDirectionalDerivative, c->references, u.variables, known_references, s.variables, values,
                  s.values, derivatives, u.values);
    free(known_references);
    for (size_t i = 0; i < unknown_count && status <= fmi2Warning; i++) sensitivities[i] = derivatives[c->places[i]];
    return status;
}

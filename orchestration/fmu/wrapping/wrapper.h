/* An FMU of FMI 3.0 behind the functions of FMI 2.0.
 *
 * Beside the library of the wrapper lies its table, a text file that `wrapping.py` writes: the library of the FMU, its
 * resources, and its variables, whose elements have the value references 0, 1, 2, ... of FMI 2.0 in this order.
 */
#ifndef WRAPPER_H
#define WRAPPER_H

#include "fmi2Functions.h"
#include "fmi3FunctionTypes.h"

/* Types of variables, in the order of the numbers in the table; an enumeration is an Int64. A clock is none that the
 * wrapper ticks; its value is how often it was active. */
#define NUMBERS(X)                                                                                                     \
    X(Float32) X(Float64) X(Int8) X(UInt8) X(Int16) X(UInt16) X(Int32) X(UInt32) X(Int64) X(UInt64) X(Boolean)

#define AS_CONSTANT(name) TYPE_##name,
typedef enum { NUMBERS(AS_CONSTANT) TYPE_Clock, TYPE_String, TYPE_Binary, TYPES } type;

/* Interfaces, in the order of the numbers in the table; one with events has clocks. */
typedef enum { PLAIN, WITH_EVENTS, SCHEDULED } interface_type; /* Windows has a macro of the shorter name */

/* Functions of FMI 3.0 that are called. */
#define FUNCTIONS(X)                                                                                                   \
    X(InstantiateCoSimulation) X(InstantiateModelExchange) X(FreeInstance) X(SetDebugLogging)                          \
    X(EnterInitializationMode) X(ExitInitializationMode) X(Terminate) X(Reset)                                         \
    X(GetFloat32) X(GetFloat64) X(GetInt8) X(GetUInt8) X(GetInt16) X(GetUInt16) X(GetInt32) X(GetUInt32)               \
    X(GetInt64) X(GetUInt64) X(GetBoolean) X(GetString) X(GetBinary)                                                   \
    X(SetFloat32) X(SetFloat64) X(SetInt8) X(SetUInt8) X(SetInt16) X(SetUInt16) X(SetInt32) X(SetUInt32)               \
    X(SetInt64) X(SetUInt64) X(SetBoolean) X(SetString) X(SetBinary)                                                   \
    X(GetFMUState) X(SetFMUState) X(FreeFMUState) X(SerializedFMUStateSize) X(SerializeFMUState)                       \
    X(DeserializeFMUState) X(GetDirectionalDerivative) X(GetOutputDerivatives) X(DoStep)                               \
    X(EnterEventMode) X(UpdateDiscreteStates) X(EnterContinuousTimeMode) X(CompletedIntegratorStep) X(SetTime)         \
    X(SetContinuousStates) X(GetContinuousStateDerivatives) X(GetEventIndicators) X(GetContinuousStates)               \
    X(GetNominalsOfContinuousStates) X(InstantiateScheduledExecution) X(ActivateModelPartition) X(EnterStepMode)       \
    X(GetClock) X(SetClock) X(GetIntervalDecimal) X(GetShiftDecimal)

#define AS_POINTER(name) fmi3##name##TYPE *name;
typedef struct {
    FUNCTIONS(AS_POINTER)
} functions;

typedef struct {
    type type;
    fmi3ValueReference reference;
    size_t first, count;    /* its elements among those of all variables */
    size_t place;           /* of its first element among the selected values, ... */
    unsigned long selected; /* ... if this is the present selection */
    double ticks;           /* of a clock */
} variable;

/* An input clock that ticks by time: kinds in the order of the numbers in the table. The interval of the first is in the
 * description, that of the second computed at the start, those of the others are told from tick to tick. */
typedef struct {
    enum { CLOCK_CONSTANT, CLOCK_FIXED, CLOCK_CHANGING, CLOCK_COUNTDOWN } kind;
    fmi3ValueReference reference;
    double interval, shift, next; /* seconds; time of the next tick */
    double ticks;
} ticking;

/* The last call that moved Float64 variables, whole and in their order, as most calls do: it is made again unseen. */
typedef struct {
    size_t count, variables; /* elements, 0 without such a call; variables */
    fmi2ValueReference *elements;
    fmi3ValueReference *references;
} direct_call;

typedef struct {
    functions call;
    fmi3Instance instance;
    void *library;
    char *resources; /* their folder; empty if there is none */
    variable *variables;
    size_t variable_count, element_count;
    size_t *owners; /* of elements: their variables */
    /* the present selection of variables, and room for its values */
    unsigned long selection;
    fmi3ValueReference *references;
    size_t *places, place_room;
    void *values, *derivatives;
    char *digits; /* of binary values that were read */
    double *row;
    direct_call reading, writing;
    /* elements of arrays that were set before initialization mode, in which the others of their arrays can be read */
    int entered; /* whether it was entered */
    size_t late_count, late_room;
    fmi2ValueReference *late_elements;
    double *late_row;
    /* what FMI 2.0 tells at one time and FMI 3.0 at another */
    const fmi2CallbackFunctions *callbacks;
    char *name;
    fmi2Boolean tolerance_defined, stop_defined;
    double tolerance, start, stop;
    double reached; /* time at the end of the last step */
    int terminated; /* whether the FMU asked to end the simulation */
    interface_type kind;
    ticking *clocks;
    size_t clock_count;
    variable **counted; /* those that are clocks */
    size_t counted_count;
    int initialized, in_events; /* whether it is past initialization, and in Event Mode */
    double next_event;          /* of those that have a time */
    int asks;                   /* a partition has changed an interval, or activated a clock */
} component;

/* Call a function of the FMU; one that its library lacks is an error. */
#define CALL(c, name, ...)                                                                                             \
    ((c)->call.name ? (fmi2Status)(c)->call.name((c)->instance, __VA_ARGS__) : lacking((c), "fmi3" #name))
#define CALL_PLAIN(c, name)                                                                                            \
    ((c)->call.name ? (fmi2Status)(c)->call.name((c)->instance) : lacking((c), "fmi3" #name))

fmi2Status lacking(const component *c, const char *function);
void tell(const component *c, fmi2Status status, const char *format, ...);
int load(component *c); /* read the table and load the library of the FMU; tells why not */
void unload(component *c);
fmi2Status worse(fmi2Status a, fmi2Status b);
fmi2Status enter_events(component *c); /* before values are set, ... */
fmi2Status settle(component *c);       /* ... and before they are read */
fmi2Status write_late(component *c); /* set what had to wait for initialization mode */

#endif

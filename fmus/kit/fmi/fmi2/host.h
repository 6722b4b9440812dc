/* FMI 2.0 to the files of the front-end that serve every version. */
#ifndef HOST_H
#define HOST_H

#include "fmi2Functions.h"

/* The name in this version: FMI(Reset) is fmi2Reset. */
#define FMI(name) fmi2##name
#define EXPORT FMI2_Export

/* Names that version 3.0 spells otherwise. */
#define fmi2FMUState fmi2FMUstate
#define fmi2GetFMUState fmi2GetFMUstate
#define fmi2SetFMUState fmi2SetFMUstate
#define fmi2FreeFMUState fmi2FreeFMUstate
#define fmi2SerializedFMUStateSize fmi2SerializedFMUstateSize
#define fmi2SerializeFMUState fmi2SerializeFMUstate
#define fmi2DeserializeFMUState fmi2DeSerializeFMUstate
#define fmi2GetContinuousStateDerivatives fmi2GetDerivatives

/* Value references beyond those of engine.h. */
enum { OWN_REFERENCES = 0 };

/* The time is no variable. */
static inline bool is_time(fmi2ValueReference vr) {
    (void)vr;
    return false;
}

/* by Type */
static const char *const type_names[] = {"Real", "Integer", "Boolean"};

/* added to a complaint that there is no event mode */
#define WITHOUT_EVENTS ""

#define GUID_NAME "GUID" /* the attribute of modelDescription.xml, for people */

typedef fmi2Status Status;
typedef fmi2ValueReference Reference;

/* Whoever made the instance. */
typedef fmi2CallbackFunctions Host;

/* Loggers of this version read the message as a printf format, some without arguments: doubling each % suits both. */
static const bool host_reads_formats = true;

/* Before initialization nothing can be read. */
static const bool host_reads_starts = false;

/* In co-simulation. */
static inline bool host_handles_events(const Host *host) {
    (void)host;
    return false;
}

static inline bool host_listens(const Host *host) { return host->logger != NULL; }

static inline void host_log(const Host *host, const char *name, Status status, const char *category, const char *line) {
    host->logger(host->componentEnvironment, name, status, category, line);
}

#endif

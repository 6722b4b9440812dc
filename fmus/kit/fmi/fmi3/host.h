/* FMI 3.0 to the files of the front-end that serve every version. */
#ifndef HOST_H
#define HOST_H

#include "fmi3Functions.h"

/* The name in this version: FMI(Reset) is fmi3Reset. */
#define FMI(name) fmi3##name
#define EXPORT FMI3_Export

/* Value references beyond those of engine.h: of the time, of the event indicators, and of the clocks. */
enum { TIME = MODEL_VARIABLES + MODEL_TEXTS, OWN_REFERENCES = 1 + MODEL_INDICATORS + MODEL_GROUPS };

static inline bool is_time(fmi3ValueReference vr) { return vr == TIME; }

/* by Type */
static const char *const type_names[] = {"Float64", "Int32", "Boolean"};

/* added to a complaint that there is no event mode */
#define WITHOUT_EVENTS " without event mode"

#define GUID_NAME "instantiation token" /* the attribute of modelDescription.xml, for people */

typedef fmi3Status Status;
typedef fmi3ValueReference Reference;

/* Whoever made the instance, and what it takes part in. */
typedef struct {
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    bool event_mode;   /* whether it handles the events of a co-simulation */
    bool early_return; /* whether a step may end at such an event */
} Host;

static const bool host_reads_formats = false;

/* Before initialization, what has a start value can be read. */
static const bool host_reads_starts = true;

/* In co-simulation. */
static inline bool host_handles_events(const Host *host) { return host->event_mode; }

static inline bool host_listens(const Host *host) { return host->log != NULL; }

static inline void host_log(const Host *host, const char *name, Status status, const char *category, const char *line) {
    (void)name; /* the environment tells the host which instance it is */
    host->log(host->environment, status, category, line);
}

#endif

/* FMI 2.0: saving, restoring and serializing the complete state of an instance. */
#include "instance.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Serialized as it is in memory: made for the same FMU on the same kind of machine, which the header verifies. */
typedef struct {
    /* Always zero: fmusim frees, after it has written --final-fmu-state-file, the pointer that a state begins with. */
    uint64_t nothing;
    uint64_t magic;
    uint64_t model;    /* hash of the GUID */
    uint64_t size;     /* of the whole snapshot in bytes */
    uint64_t checksum; /* hash of the state */
    State state;
} Snapshot;

static const uint64_t snapshot_magic = UINT64_C(0x5050592d464d5532);

static Snapshot header(const State *state) {
    Snapshot snapshot;
    snapshot.nothing = 0;
    snapshot.magic = snapshot_magic;
    snapshot.model = hash(HASH_START, model_guid, strlen(model_guid));
    snapshot.size = sizeof snapshot;
    snapshot.state = *state;
    /* Whatever the engine remembers of the parameters must be renewed after a restore. */
    snapshot.state.memory[MEMORY_PARAMETERS_CHANGED] = 1.0;
    snapshot.checksum = hash(HASH_START, &snapshot.state, sizeof snapshot.state);
    return snapshot;
}

/* Puts a copy where the host wants it, in the snapshot it already has if it has one. */
static fmi2Status store(const Instance *instance, const char *function, fmi2FMUstate *target,
                        const Snapshot *snapshot) {
    if (*target == NULL)
        *target = malloc(sizeof *snapshot);
    if (*target == NULL)
        return report(instance, fmi2Error, "%s: out of memory", function);
    memcpy(*target, snapshot, sizeof *snapshot);
    return fmi2OK;
}

/* Whether the state can be saved, and `function` may be called now; reports it if not. */
static bool possible(const Instance *instance, const char *function) {
    if (!allowed(instance, ANY_MODE, function))
        return false;
    if (!model_restorable)
        report(instance, fmi2Error, "%s is not supported by %s: not all of its state is its own", function, model_name);
    return model_restorable;
}

static fmi2Status missing(const Instance *instance, const char *function) {
    return report(instance, fmi2Error, "%s: a pointer is NULL", function);
}

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    Instance *instance = c;
    Snapshot snapshot;
    if (!possible(instance, "fmi2GetFMUstate"))
        return fmi2Error;
    if (state == NULL)
        return missing(instance, "fmi2GetFMUstate");
    snapshot = header(&instance->now);
    return store(instance, "fmi2GetFMUstate", state, &snapshot);
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    Instance *instance = c;
    const Snapshot *snapshot = state;
    int other;
    if (!possible(instance, "fmi2SetFMUstate"))
        return fmi2Error;
    if (state == NULL)
        return missing(instance, "fmi2SetFMUstate");
    if (snapshot->magic != snapshot_magic || snapshot->model != hash(HASH_START, model_guid, strlen(model_guid)))
        return report(instance, fmi2Error, "fmi2SetFMUstate: the state does not belong to this build of %s",
                      model_name);
    other = instance->type == fmi2ModelExchange ? STEP_COMPLETE : EVENT | CONTINUOUS;
    if (((int)snapshot->state.mode & other) != 0)
        return report(instance, fmi2Error, "fmi2SetFMUstate: the state is of an instance of %s",
                      instance->type == fmi2ModelExchange ? "co-simulation" : "model exchange");
    instance->now = snapshot->state;
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    Instance *instance = c;
    if (!allowed(instance, ANY_MODE, "fmi2FreeFMUstate"))
        return fmi2Error;
    if (state == NULL)
        return fmi2OK;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    Instance *instance = c;
    if (!possible(instance, "fmi2SerializedFMUstateSize"))
        return fmi2Error;
    if (state == NULL || size == NULL)
        return missing(instance, "fmi2SerializedFMUstateSize");
    *size = sizeof(Snapshot);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    Instance *instance = c;
    if (!possible(instance, "fmi2SerializeFMUstate"))
        return fmi2Error;
    if (state == NULL || bytes == NULL)
        return missing(instance, "fmi2SerializeFMUstate");
    if (size < sizeof(Snapshot))
        return report(instance, fmi2Error, "fmi2SerializeFMUstate: %zu bytes are not enough, it takes %zu", size,
                      sizeof(Snapshot));
    memcpy(bytes, state, sizeof(Snapshot));
    return fmi2OK;
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    Instance *instance = c;
    Snapshot snapshot, expected;
    if (!possible(instance, "fmi2DeSerializeFMUstate"))
        return fmi2Error;
    if (bytes == NULL || state == NULL)
        return missing(instance, "fmi2DeSerializeFMUstate");
    if (size != sizeof snapshot)
        return report(instance, fmi2Error, "fmi2DeSerializeFMUstate: %zu bytes are not a state of %s, which has %zu",
                      size, model_name, sizeof snapshot);
    memcpy(&snapshot, bytes, sizeof snapshot);
    expected = header(&snapshot.state);
    if (snapshot.nothing != expected.nothing || snapshot.magic != expected.magic || snapshot.model != expected.model ||
        snapshot.size != expected.size)
        return report(instance, fmi2Error, "fmi2DeSerializeFMUstate: the bytes are not a state of this build of %s",
                      model_name);
    if (snapshot.checksum != expected.checksum)
        return report(instance, fmi2Error, "fmi2DeSerializeFMUstate: the bytes were altered since they were written");
    return store(instance, "fmi2DeSerializeFMUstate", state, &snapshot);
}

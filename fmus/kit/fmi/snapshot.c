/* Saving, restoring and serializing the complete state of an instance. */
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
static Status store(const Instance *instance, const char *function, FMI(FMUState) *target,
                        const Snapshot *snapshot) {
    if (*target == NULL)
        *target = malloc(sizeof *snapshot);
    if (*target == NULL)
        return report(instance, FMI(Error), "%s: out of memory", function);
    memcpy(*target, snapshot, sizeof *snapshot);
    return FMI(OK);
}

/* Whether the state can be saved, and `function` may be called now; reports it if not. */
static bool possible(const Instance *instance, const char *function) {
    if (!allowed(instance, ANY_MODE, function))
        return false;
    if (!model_restorable)
        report(instance, FMI(Error), "%s is not supported by %s: not all of its state is its own", function, model_name);
    return model_restorable;
}

static Status missing(const Instance *instance, const char *function) {
    return report(instance, FMI(Error), "%s: a pointer is NULL", function);
}

EXPORT Status FMI(GetFMUState)(void *c, FMI(FMUState) *state) {
    Instance *instance = c;
    Snapshot snapshot;
    if (!possible(instance, __func__))
        return FMI(Error);
    if (state == NULL)
        return missing(instance, __func__);
    snapshot = header(&instance->now);
    return store(instance, __func__, state, &snapshot);
}

EXPORT Status FMI(SetFMUState)(void *c, FMI(FMUState) state) {
    Instance *instance = c;
    const Snapshot *snapshot = state;
    int other;
    if (!possible(instance, __func__))
        return FMI(Error);
    if (state == NULL)
        return missing(instance, __func__);
    if (snapshot->magic != snapshot_magic || snapshot->model != hash(HASH_START, model_guid, strlen(model_guid)))
        return report(instance, FMI(Error), "%s: the state does not belong to this build of %s", __func__,
                      model_name);
    other = instance->integrator == HOST_INTEGRATES ? STEP_COMPLETE : CONTINUOUS | (handles_events(instance) ? 0 : EVENT);
    if (((int)snapshot->state.mode & other) != 0)
        return report(instance, FMI(Error), "%s: the state is of an instance of %s", __func__,
                      instance->integrator == HOST_INTEGRATES ? "co-simulation" : "model exchange");
    instance->now = snapshot->state;
    return FMI(OK);
}

EXPORT Status FMI(FreeFMUState)(void *c, FMI(FMUState) *state) {
    Instance *instance = c;
    if (!allowed(instance, ANY_MODE, __func__))
        return FMI(Error);
    if (state == NULL)
        return FMI(OK);
    free(*state);
    *state = NULL;
    return FMI(OK);
}

EXPORT Status FMI(SerializedFMUStateSize)(void *c, FMI(FMUState) state, size_t *size) {
    Instance *instance = c;
    if (!possible(instance, __func__))
        return FMI(Error);
    if (state == NULL || size == NULL)
        return missing(instance, __func__);
    *size = sizeof(Snapshot);
    return FMI(OK);
}

EXPORT Status FMI(SerializeFMUState)(void *c, FMI(FMUState) state, FMI(Byte) bytes[], size_t size) {
    Instance *instance = c;
    if (!possible(instance, __func__))
        return FMI(Error);
    if (state == NULL || bytes == NULL)
        return missing(instance, __func__);
    if (size < sizeof(Snapshot))
        return report(instance, FMI(Error), "%s: %zu bytes are not enough, it takes %zu", __func__, size,
                      sizeof(Snapshot));
    memcpy(bytes, state, sizeof(Snapshot));
    return FMI(OK);
}

EXPORT Status FMI(DeserializeFMUState)(void *c, const FMI(Byte) bytes[], size_t size, FMI(FMUState) *state) {
    Instance *instance = c;
    Snapshot snapshot, expected;
    if (!possible(instance, __func__))
        return FMI(Error);
    if (bytes == NULL || state == NULL)
        return missing(instance, __func__);
    if (size != sizeof snapshot)
        return report(instance, FMI(Error), "%s: %zu bytes are not a state of %s, which has %zu", __func__,
                      size, model_name, sizeof snapshot);
    memcpy(&snapshot, bytes, sizeof snapshot);
    expected = header(&snapshot.state);
    if (snapshot.nothing != expected.nothing || snapshot.magic != expected.magic || snapshot.model != expected.model ||
        snapshot.size != expected.size)
        return report(instance, FMI(Error), "%s: the bytes are not a state of this build of %s", __func__,
                      model_name);
    if (snapshot.checksum != expected.checksum)
        return report(instance, FMI(Error), "%s: the bytes were altered since they were written", __func__);
    return store(instance, __func__, state, &snapshot);
}

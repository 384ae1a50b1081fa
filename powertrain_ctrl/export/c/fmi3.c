/* ---- FMI 3.0, co-simulation; its types written out -------------------------------------------------------------- */

#include <stdbool.h>

typedef void (*logger3)(void *, int, const char *, const char *);

/* A pointer to a function is kept in one to an object of its own. */
typedef struct {
    logger3 log;
} callback3;

static void log3_(void *at, const char *message)
{
    instance *i = at;
    const callback3 *callback = i->logger;
    if (callback && callback->log) callback->log(i->environment, FMU_ERROR, "logStatusError", message);
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                         bool by_events, bool early, const unsigned int required[], size_t n_required,
                                         void *environment, logger3 log, void *update)
{
    (void)resources, (void)visible, (void)logging, (void)by_events, (void)early, (void)required, (void)n_required, (void)update;
    instance *i = instantiate(name, token, environment);
    callback3 *callback = i ? calloc(1, sizeof *callback) : 0;
    if (callback) {
        callback->log = log;
        i->logger = callback;
        i->log = log3_;
    }
    return i;
}

EXPORT void *fmi3InstantiateModelExchange(void) { return 0; }
EXPORT void *fmi3InstantiateScheduledExecution(void) { return 0; }

EXPORT void fmi3FreeInstance(void *c)
{
    instance *i = c;
    if (i) free(i->logger);
    discard(i);
}

EXPORT int fmi3EnterInitializationMode(void *c, bool has_tolerance, double tolerance, double start, bool has_stop, double stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    instance *i = c;
    i->s.now.time = i->plant.now.time = start;
    return reported(i, prepare(i));
}

EXPORT int fmi3ExitInitializationMode(void *c) { return begin(c); }
EXPORT int fmi3Terminate(void *c) { return (void)c, FMU_OK; }
EXPORT int fmi3Reset(void *c) { return restart(c), FMU_OK; }

EXPORT int fmi3GetFloat64(void *c, const unsigned int r[], size_t n, double v[], size_t n_values)
{
    return n_values < n ? refused(c, "less room than values") : get(c, r, n, v);
}

EXPORT int fmi3SetFloat64(void *c, const unsigned int r[], size_t n, const double v[], size_t n_values)
{
    return n_values < n ? refused(c, "fewer values than variables") : set(c, r, n, v);
}

EXPORT int fmi3DoStep(void *c, double time, double length, bool stays, bool *happened, bool *terminate, bool *early, double *last)
{
    (void)stays;
    int status = go(c, time, length);
    *happened = *terminate = *early = false;
    *last = status == FMU_OK ? time + length : time;
    return status;
}

EXPORT int fmi3GetFMUState(void *c, void **to) { return save(c, to); }
EXPORT int fmi3SetFMUState(void *c, void *from) { return restore(c, from); }
EXPORT int fmi3FreeFMUState(void *c, void **of)
{
    (void)c;
    if (of) {
        free(*of);
        *of = 0;
    }
    return FMU_OK;
}
EXPORT int fmi3SerializedFMUStateSize(void *c, void *of, size_t *size) { return (void)c, (void)of, *size = sizeof(saved), FMU_OK; }
EXPORT int fmi3SerializeFMUState(void *c, void *from, unsigned char to[], size_t size) { return pack(c, from, (char *)to, size); }
EXPORT int fmi3DeserializeFMUState(void *c, const unsigned char from[], size_t size, void **to)
{
    return unpack(c, (const char *)from, size, to);
}

EXPORT int fmi3SetDebugLogging(void *c, bool on, size_t n, const char *const categories[])
{
    return (void)c, (void)on, (void)n, (void)categories, FMU_OK;
}
EXPORT int fmi3EnterStepMode(void *c) { return (void)c, FMU_OK; }
EXPORT int fmi3EnterEventMode(void *c) { return refused(c, "events are met within steps"); }
EXPORT int fmi3EnterConfigurationMode(void *c) { return (void)c, FMU_OK; }
EXPORT int fmi3ExitConfigurationMode(void *c) { return (void)c, FMU_OK; }

/* no variables of other types */
#define NONE(name) \
    EXPORT int name(void *c, const unsigned int r[], size_t n, void *v, size_t n_values) \
    { \
        return (void)r, (void)v, (void)n_values, n ? refused(c, #name) : FMU_OK; \
    }
NONE(fmi3GetFloat32)
NONE(fmi3GetInt8)
NONE(fmi3GetUInt8)
NONE(fmi3GetInt16)
NONE(fmi3GetUInt16)
NONE(fmi3GetInt32)
NONE(fmi3GetUInt32)
NONE(fmi3GetInt64)
NONE(fmi3GetUInt64)
NONE(fmi3GetBoolean)
NONE(fmi3GetString)
NONE(fmi3SetFloat32)
NONE(fmi3SetInt8)
NONE(fmi3SetUInt8)
NONE(fmi3SetInt16)
NONE(fmi3SetUInt16)
NONE(fmi3SetInt32)
NONE(fmi3SetUInt32)
NONE(fmi3SetInt64)
NONE(fmi3SetUInt64)
NONE(fmi3SetBoolean)
NONE(fmi3SetString)
/* nothing of model exchange, of scheduled execution, of clocks */
#define NOT_HERE(name) \
    EXPORT int name(void *c) { return refused(c, #name); }
NOT_HERE(fmi3GetBinary)
NOT_HERE(fmi3SetBinary)
NOT_HERE(fmi3GetClock)
NOT_HERE(fmi3SetClock)
NOT_HERE(fmi3GetNumberOfVariableDependencies)
NOT_HERE(fmi3GetVariableDependencies)
NOT_HERE(fmi3GetDirectionalDerivative)
NOT_HERE(fmi3GetAdjointDerivative)
NOT_HERE(fmi3GetIntervalDecimal)
NOT_HERE(fmi3GetIntervalFraction)
NOT_HERE(fmi3GetShiftDecimal)
NOT_HERE(fmi3GetShiftFraction)
NOT_HERE(fmi3SetIntervalDecimal)
NOT_HERE(fmi3SetIntervalFraction)
NOT_HERE(fmi3SetShiftDecimal)
NOT_HERE(fmi3SetShiftFraction)
NOT_HERE(fmi3EvaluateDiscreteStates)
NOT_HERE(fmi3UpdateDiscreteStates)
NOT_HERE(fmi3EnterContinuousTimeMode)
NOT_HERE(fmi3CompletedIntegratorStep)
NOT_HERE(fmi3SetTime)
NOT_HERE(fmi3SetContinuousStates)
NOT_HERE(fmi3GetContinuousStateDerivatives)
NOT_HERE(fmi3GetEventIndicators)
NOT_HERE(fmi3GetContinuousStates)
NOT_HERE(fmi3GetNominalsOfContinuousStates)
NOT_HERE(fmi3GetNumberOfEventIndicators)
NOT_HERE(fmi3GetNumberOfContinuousStates)
NOT_HERE(fmi3GetOutputDerivatives)
NOT_HERE(fmi3ActivateModelPartition)

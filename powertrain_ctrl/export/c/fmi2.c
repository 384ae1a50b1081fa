/* ---- FMI 2.0, co-simulation; its types written out -------------------------------------------------------------- */

typedef void (*logger2)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    logger2 logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} callbacks2;

static void log2_(void *at, const char *message)
{
    instance *i = at;
    const callbacks2 *callbacks = i->logger;
    if (callbacks && callbacks->logger) callbacks->logger(i->environment, i->name, FMU_ERROR, "logStatusError", "%s", message);
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT void *fmi2Instantiate(const char *name, int type, const char *token, const char *resources, const void *callbacks,
                             int visible, int logging)
{
    (void)resources, (void)visible, (void)logging;
    instance *i = type == 1 ? instantiate(name, token, callbacks ? ((const callbacks2 *)callbacks)->environment : 0) : 0;
    if (i) {
        union {
            const void *given;
            void *kept;
        } both = {callbacks};
        i->logger = both.kept;
        i->log = log2_;
    }
    return i;
}

EXPORT void fmi2FreeInstance(void *c) { discard(c); }

EXPORT int fmi2SetupExperiment(void *c, int has_tolerance, double tolerance, double start, int has_stop, double stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    instance *i = c;
    i->s.now.time = i->plant.now.time = start;
    return FMU_OK;
}

EXPORT int fmi2EnterInitializationMode(void *c) { return reported(c, prepare(c)); }
EXPORT int fmi2ExitInitializationMode(void *c) { return begin(c); }
EXPORT int fmi2Terminate(void *c) { return (void)c, FMU_OK; }
EXPORT int fmi2Reset(void *c) { return restart(c), FMU_OK; }
EXPORT int fmi2GetReal(void *c, const unsigned int r[], size_t n, double v[]) { return get(c, r, n, v); }
EXPORT int fmi2SetReal(void *c, const unsigned int r[], size_t n, const double v[]) { return set(c, r, n, v); }

EXPORT int fmi2SetRealInputDerivatives(void *c, const unsigned int r[], size_t n, const int order[], const double v[])
{
    instance *i = c;
    for (size_t k = 0; k < n; ++k) {
        if (r[k] >= OUTPUTS || order[k] != 1) return refused(i, "only inputs have derivatives, of order 1");
        i->s.slope[r[k]] = v[k];
    }
    return FMU_OK;
}

EXPORT int fmi2GetRealOutputDerivatives(void *c, const unsigned int r[], size_t n, const int order[], double v[])
{
    (void)r, (void)order, (void)v;
    return n ? refused(c, "outputs give no derivatives") : FMU_OK;
}

EXPORT int fmi2DoStep(void *c, double time, double length, int stays) { return (void)stays, go(c, time, length); }
EXPORT int fmi2CancelStep(void *c) { return refused(c, "no step is under way"); }

EXPORT int fmi2GetFMUstate(void *c, void **to) { return save(c, to); }
EXPORT int fmi2SetFMUstate(void *c, void *from) { return restore(c, from); }
EXPORT int fmi2FreeFMUstate(void *c, void **of)
{
    (void)c;
    if (of) {
        free(*of);
        *of = 0;
    }
    return FMU_OK;
}
EXPORT int fmi2SerializedFMUstateSize(void *c, void *of, size_t *size) { return (void)c, (void)of, *size = sizeof(saved), FMU_OK; }
EXPORT int fmi2SerializeFMUstate(void *c, void *from, char to[], size_t size) { return pack(c, from, to, size); }
EXPORT int fmi2DeSerializeFMUstate(void *c, const char from[], size_t size, void **to) { return unpack(c, from, size, to); }

EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const categories[])
{
    return (void)c, (void)on, (void)n, (void)categories, FMU_OK;
}

/* no variables of other types, no derivatives, no steps that are still running */
#define NONE(name) \
    EXPORT int name(void *c, const unsigned int r[], size_t n, void *v) { return (void)r, (void)v, n ? refused(c, #name) : FMU_OK; }
NONE(fmi2GetInteger)
NONE(fmi2GetBoolean)
NONE(fmi2GetString)
NONE(fmi2SetInteger)
NONE(fmi2SetBoolean)
NONE(fmi2SetString)
#define STATUS(name) \
    EXPORT int name(void *c, int kind, void *v) { return (void)kind, (void)v, refused(c, #name); }
STATUS(fmi2GetStatus)
STATUS(fmi2GetRealStatus)
STATUS(fmi2GetIntegerStatus)
STATUS(fmi2GetBooleanStatus)
STATUS(fmi2GetStringStatus)
EXPORT int fmi2GetDirectionalDerivative(void *c, const unsigned int u[], size_t nu, const unsigned int k[], size_t nk,
                                        const double dk[], double du[])
{
    return (void)u, (void)nu, (void)k, (void)nk, (void)dk, (void)du, refused(c, "no directional derivatives");
}

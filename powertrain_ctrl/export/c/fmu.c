/* ---- one instance of an FMU, whatever the version --------------------------------------------------------------- */

#include <stdlib.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* Variables by reference: inputs, outputs, times of events, parameters, time. */
enum { OUTPUTS = NV, TIMES = OUTPUTS + NY, FIRST_PARAMETER = TIMES + NL, TIME = FIRST_PARAMETER + NP, ZV = NV > 0 ? NV : 1 };
enum { FMU_OK = 0, FMU_ERROR = 3 };
/* Steps of dt that differ from it by this part are steps of dt. */
static const double SAME_STEP = 1e-9;

/* What is saved and restored of it. */
typedef struct {
    state now;
    double u[ZV], last[ZV], slope[ZV], p[NP + 1];
    int running;
} saved;

typedef struct {
    plant plant;
    saved s;
    double y[NY], built[NP + 1];
    int fresh, ready;
    void *environment;
    void (*log)(void *environment, const char *message);
    void *logger;
    char *name;
} instance;

/* Logs a status and gives that of the standard. */
static int reported(instance *i, int status)
{
    if (status == OK) return FMU_OK;
    if (i->log) i->log(i, @NAME@_message(status));
    return FMU_ERROR;
}

static int refused(instance *i, const char *message)
{
    if (i->log) i->log(i, message);
    return FMU_ERROR;
}

static void restart(instance *i)
{
    memset(&i->s, 0, sizeof i->s);
    for (int k = 0; k < NV; ++k) i->s.u[k] = i->s.last[k] = INPUTS[k];
#if NP > 0
    memcpy(i->s.p, PARAMETERS, sizeof PARAMETERS);
#endif
    i->ready = i->fresh = 0;
}

/* The plant with the parameters that are set; at its start unless it is running. */
static int prepare(instance *i)
{
    if (i->ready) return OK;
    int same = i->s.running;
    for (int k = 0; k < NP && same; ++k) same = i->built[k] == i->s.p[k];
    if (!same || !i->plant.m) {
        double time = i->s.now.time;
        int status = @NAME@_init(&i->plant, i->s.p);
        if (status) return status;
        memcpy(i->built, i->s.p, sizeof i->built);
        if (!i->s.running) {
            i->s.now = i->plant.now;
            i->s.now.time = time;
        }
    }
    i->plant.now = i->s.now;
    i->ready = 1;
    return OK;
}

static int get(instance *i, const unsigned int references[], size_t count, double values[])
{
    int status = prepare(i);
    for (size_t k = 0; k < count; ++k) {
        unsigned int r = references[k];
        if (r >= OUTPUTS && r < TIMES && !i->fresh && !status) {
            status = @NAME@_outputs(&i->plant, i->s.u, i->y);
            i->fresh = !status;
        }
        if (status) return reported(i, status);
        if (r < OUTPUTS) values[k] = i->s.u[r];
        else if (r < TIMES) values[k] = i->y[r - OUTPUTS];
        else if (r < FIRST_PARAMETER) values[k] = i->plant.now.event_time[r - TIMES];
        else if (r < TIME) values[k] = i->s.p[r - FIRST_PARAMETER];
        else if (r == TIME) values[k] = i->plant.now.time;
        else return refused(i, "no variable has this reference");
    }
    return FMU_OK;
}

static int set(instance *i, const unsigned int references[], size_t count, const double values[])
{
    for (size_t k = 0; k < count; ++k) {
        unsigned int r = references[k];
        if (r < OUTPUTS) i->s.u[r] = values[k];
        else if (r >= FIRST_PARAMETER && r < TIME) {
            if (i->s.running) return refused(i, "a parameter is set before the initialization has ended");
            i->s.p[r - FIRST_PARAMETER] = values[k];
            i->ready = 0;
        } else return refused(i, "only inputs and parameters can be set");
    }
    i->fresh = 0;
    return FMU_OK;
}

static int begin(instance *i)
{
    int status = prepare(i);
    memcpy(i->s.last, i->s.u, sizeof i->s.last);
    i->s.running = 1;
    return reported(i, status);
}

/* A step of any length: steps of dt and what remains, inputs held or straight lines. */
static int go(instance *i, double time, double length)
{
    double first[ZV], after[ZV], at[ZV], to[ZV];
    int status = prepare(i), straight = 0;
    if (status) return reported(i, status);
    if (!(length >= 0.0 && length <= 1e9)) return refused(i, "the length of a step is not >= 0");
    for (int k = 0; k < NV; ++k) straight = straight || i->s.slope[k] != 0.0;
    for (int k = 0; k < NV; ++k) {
        first[k] = LINEAR && !straight ? i->s.last[k] : i->s.u[k];
        after[k] = i->s.u[k] + length * i->s.slope[k];
    }
    state before = i->plant.now;
    i->plant.now.time = time;
    /* lengths are differences of times, which are rounded */
    long long count = length > 0.0 ? (long long)largest(ceil(length / DT - SAME_STEP), 1.0) : 0;
    for (long long n = 0; n < count && !status; ++n) {
        double done = (double)n * DT, part = length - done;
        if (part > (1.0 - SAME_STEP) * DT) part = DT;
        double end = n < count - 1 ? done + part : length;
        for (int k = 0; k < NV; ++k) {
            at[k] = first[k] + (after[k] - first[k]) * (done / length);
            to[k] = first[k] + (after[k] - first[k]) * (end / length);
        }
        status = @NAME@_advance(&i->plant, n ? at : first, n < count - 1 ? to : after, part);
    }
    if (status) {
        i->plant.now = before;
        return reported(i, status);
    }
    i->plant.now.time = time + length;
    memcpy(i->s.u, after, sizeof after);
    memcpy(i->s.last, after, sizeof after);
    memset(i->s.slope, 0, sizeof i->s.slope);
    i->fresh = 0;
    return FMU_OK;
}

static int save(instance *i, void **to)
{
    int status = prepare(i);
    if (status) return reported(i, status);
    if (!*to) *to = malloc(sizeof(saved));
    if (!*to) return refused(i, "no memory");
    i->s.now = i->plant.now;
    memcpy(*to, &i->s, sizeof(saved));
    return FMU_OK;
}

static int restore(instance *i, const void *from)
{
    memcpy(&i->s, from, sizeof(saved));
    i->ready = i->fresh = 0;
    return FMU_OK;
}

static int pack(instance *i, const void *from, char bytes[], size_t size)
{
    if (size < sizeof(saved)) return refused(i, "less room than a state needs");
    memcpy(bytes, from, sizeof(saved));
    return FMU_OK;
}

static int unpack(instance *i, const char bytes[], size_t size, void **to)
{
    saved given;
    int same = size == sizeof given;
    if (same) memcpy(&given, bytes, sizeof given);
    for (int k = 0; k < NL && same; ++k) same = given.now.modes[k] >= 0 && given.now.modes[k] < LAWS[k].count;
    if (!same) return refused(i, "not a state of this model");
    if (!*to) *to = malloc(sizeof(saved));
    if (!*to) return refused(i, "no memory");
    memcpy(*to, bytes, sizeof(saved));
    return FMU_OK;
}

static instance *instantiate(const char *name, const char *token, void *environment)
{
    if (!token || strcmp(token, TOKEN)) return 0;
    instance *i = calloc(1, sizeof *i);
    size_t length = name ? strlen(name) : 0;
    if (!i) return 0;
    i->name = calloc(1, length + 1);
    if (!i->name) {
        free(i);
        return 0;
    }
    if (length) memcpy(i->name, name, length);
    i->environment = environment;
    restart(i);
    return i;
}

static void discard(instance *i)
{
    if (!i) return;
    free(i->name);
    free(i);
}

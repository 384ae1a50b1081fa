/* ---- what is called --------------------------------------------------------------------------------------------- */

static int read_inputs(const double before[], const double after[], double duration, segment *g)
{
    double first[NV], change[NV];
    for (int i = 0; i < NV; ++i) {
        double last = after[i];
        first[i] = before[i];
        if (!(fabs(first[i]) <= 1e300 && fabs(last) <= 1e300)) return NOT_FINITE;
        if (i >= NI && i < NI + NC) {
            double none = NO_CAPACITY[i - NI];
            if (fabs(first[i]) <= none) first[i] = 0.0;
            if (fabs(last) <= none) last = 0.0;
            if (first[i] < 0.0 || last < 0.0) return NEGATIVE;
        }
        change[i] = duration > 0.0 ? (last - first[i]) / duration : 0.0;
    }
    memset(g, 0, sizeof *g);
    for (int i = 0; i < NI; ++i) {
        g->u[i] = first[i];
        g->du[i] = change[i];
    }
    for (int i = 0; i < NC; ++i) {
        g->capacity[i] = first[NI + i];
        g->dcapacity[i] = change[NI + i];
    }
    for (int i = 0; i < NM; ++i) {
        g->speed[i] = first[NI + NC + i];
        g->u[NI + i] = change[NI + NC + i];
    }
    for (int i = 0; i < NC; ++i)
        if (CURVED[i]) g->level[i] = g->capacity[i] + 0.5 * duration * g->dcapacity[i];
    return OK;
}

/* To the start, with these parameters; with none as they were exported. */
int @NAME@_init(@NAME@_plant *s, const double parameters[])
{
    int status = OK;
    memset(s, 0, sizeof *s);
#if NP > 0
    status = build(s, parameters ? parameters : PARAMETERS);
#else
    (void)parameters;
    s->m = &MATRICES;
    memcpy(s->start, START, sizeof s->start);
#endif
    memcpy(s->now.z, s->start, sizeof s->now.z);
    for (int i = 0; i < NL; ++i) s->now.modes[i] = LAWS[i].unknown;
    s->now.started = 1;
    return status;
}

/* A time of at most dt, inputs straight lines from before to after. */
int @NAME@_advance(@NAME@_plant *s, const double before[], const double after[], double duration)
{
    segment g;
    int status = read_inputs(before, after, duration, &g);
    if (status) return status;
    state kept = s->now;
    status = advance(s, &s->now, &g, duration);
    if (status) s->now = kept;
    return status;
}

/* One step of dt; give the inputs twice to hold them. */
int @NAME@_step(@NAME@_plant *s, const double before[], const double after[])
{
    return @NAME@_advance(s, before, after, DT);
}

/* Outputs now, with these inputs, whatever modes they ask for. */
int @NAME@_outputs(@NAME@_plant *s, const double u[], double y[])
{
    state a = s->now;
    segment g;
    double column[NX + ZL + NU], given[ZL] = {0.0}, change[ZL] = {0.0};
    int looked[ZL] = {0}, count, status = read_inputs(u, u, 0.0, &g);
    if (status) return status;
    doubt(s, &a);
    if ((status = settle(s, &a, &g, looked, &count))) return status;
    const pattern *p = pattern_of(s, a.modes, g.level);
    if (!count && p->n_guards) {
        view v;
        int violated = 0;
        look(p, &g, a.z, 0.0, &v);
        for (int j = 0; j < p->n_guards; ++j) violated = violated || v.value[j] < -ROUNDING * v.size[j];
        if (violated) {
            if ((status = resolve(s, &a, &g, 0, 0.0, looked, &count))) return status;
            p = pattern_of(s, a.modes, g.level);
        }
    }
    given_torques(p, &g, given, change);
    memset(column, 0, sizeof column);
    memcpy(column, a.z, NX * sizeof column[0]);
    for (int i = 0; i < NL; ++i)
        column[NX + i] = dot(p->torque_x[i], a.z, NX) + dot(p->torque_u[i], g.u, NU) + dot(p->torque_tau[i], given, NL);
    for (int i = 0; i < NU; ++i) column[NX + NL + i] = g.u[i];
    /* speeds and twists are those of the state, whatever the inputs */
    for (int i = 0; i < NO; ++i)
        y[i] = IS_STATE[i] ? dot(s->m->out[i], s->now.z, NX) : dot(s->m->out[i], column, NX + NL + NU);
    for (int i = 0; i < NE; ++i) y[NO + i] = s->now.z[NX + i];
    for (int i = 0; i < NL; ++i) y[NO + NE + i] = mode_of(i, a.modes[i])->number;
    return OK;
}

/* What a number that is not 0 means. */
const char *@NAME@_message(int status)
{
    switch (status) {
    case OK: return "";
    case NOT_FINITE: return "an input is not finite";
    case NEGATIVE: return "a capacity is negative, permitted: >= 0";
    case NO_MODES:
        return "no choice of modes agrees with its own motion; make one clutch of those that hold each other in parallel";
    case NO_SLIDING: return "a law has a slip that none of its modes allows";
    case NO_END: return "events without end; give the bodies beside that law more inertia or their springs damping";
    default: return "parameters with which the driveline has no inertia; permitted: finite and > 0";
    }
}

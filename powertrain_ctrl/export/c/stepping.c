/* ---- from event to event ---------------------------------------------------------------------------------------- */

static void slips(const plant *s, const double z[], double slip[ZL])
{
    for (int i = 0; i < NL; ++i) slip[i] = dot(s->m->G[i], z, NX);
}

/* z after these laws have taken up their slip, with the momentum kept on either side. */
static void take_up(plant *s, double z[NZ], const int laws[], int count)
{
    double mult[ZL][NX];
    if (!count) return;
    multiplier(s->m, laws, count, mult);
    double torque[ZL] = {0.0};
    for (int j = 0; j < count; ++j) torque[j] = dot(mult[j], z, NX);
    for (int j = 0; j < count; ++j)
        for (int k = 0; k < NX; ++k) z[k] -= s->m->W[laws[j]][k] * torque[j];
}

static int is_free(int i, const segment *g)
{
    return LAWS[i].is_clutch && g->capacity[i] == 0.0 && g->dcapacity[i] == 0.0;
}

/* Index of the mode in which a law slides with this slip, the one that it is in if that is one; -1 if there is none. */
static int sliding(int i, double slip, int now)
{
    double edge = EDGE * (1.0 + fabs(slip));
    for (int pass = 0; pass < 3; ++pass)
        for (int n = 0; n < LAWS[i].count; ++n) {
            int number = pass ? n : now;
            const mode *a = mode_of(i, number);
            int able = !a->held && number != LAWS[i].idle;
            double least = pass == 2 || number == now ? -edge : 0.0;
            for (int j = a->first; j < a->first + a->count; ++j)
                if (GUARDS[j].slip != 0.0 && !(GUARDS[j].slip * slip + GUARDS[j].level > least)) able = 0;
            if (able) return number;
        }
    return -1;
}

/* Mode and stretch at rest at the twist of a law that never holds its slip. */
static int starting(int i, double z[NZ])
{
    double twist = z[NX + stretch_of(i)];
    for (int n = 0; n < LAWS[i].count; ++n) {
        const mode *a = mode_of(i, n);
        double stretch = a->has_origin ? twist - a->origin : 0.0, torque = a->stiffness * stretch + a->torque;
        double edge = EDGE * (1.0 + fabs(twist)) * (1.0 + a->stiffness);
        int able = !a->held;
        for (int j = a->first; j < a->first + a->count; ++j) {
            const guard *d = &GUARDS[j];
            if ((d->twist != 0.0 || d->stretch != 0.0 || d->torque != 0.0)
                && !(d->twist * twist + d->stretch * stretch + d->torque * torque + d->level >= -edge))
                able = 0;
        }
        if (able) {
            z[NX - NE + stretch_of(i)] = stretch;
            return n;
        }
    }
    return -1;
}

/* Modes that hold from this instant on; what has been looked at. */
static int resolve(plant *s, state *a, const segment *g, const event *hit, double done, int looked[], int *count)
{
    double *z = a->z, slip[ZL] = {0.0};
    int rigid[ZL] = {0}, near[ZL] = {0}, others[ZL] = {0}, n_rigid = 0, n_near = 0, n_others = 0;
    int before[ZL] = {0}, modes[ZL] = {0};
    for (int i = 0; i < NL; ++i)
        if (LAWS[i].is_rigid && !is_free(i, g)) rigid[n_rigid++] = i;
    take_up(s, z, rigid, n_rigid);
    slips(s, z, slip);
    for (int i = 0; i < NL; ++i) {
        int held = LAWS[i].held, is_near = LAWS[i].is_rigid;
        double scale = absdot(s->m->G[i], z, NX);
        int known = a->modes[i] == held || (hit && hit->law == i);
        double zero = known ? KNOWN_SLIP * (1.0 + scale) : ZERO_SLIP + 1e-14 * scale;
        before[i] = modes[i] = a->modes[i];
        if (held < 0) others[n_others++] = i;
        else if (!is_free(i, g) && (is_near || fabs(slip[i]) <= zero)) near[n_near++] = i;
    }
    take_up(s, z, near, n_near);
    for (int i = 0, j = 0; i < NL; ++i) {
        int is_near = j < n_near && near[j] == i;
        j += is_near;
        if (is_free(i, g) && LAWS[i].idle >= 0) modes[i] = LAWS[i].idle;
        else if (LAWS[i].held >= 0) modes[i] = is_near ? LAWS[i].held : sliding(i, slip[i], before[i]);
        if (modes[i] < 0) return NO_SLIDING;
        if (hit && hit->law == i && !is_near) modes[i] = hit->then;
    }
    enter(z, before, modes);
    int chosen[ZL] = {0};
    memcpy(chosen, modes, sizeof chosen);
    int status = consistent_modes(s, chosen, near, n_near, others, n_others, z, g, hit);
    if (status) return status;
    enter(z, modes, chosen);
    for (int i = 0; i < NL; ++i) {
        if (a->started && chosen[i] != before[i]) a->event_time[i] = a->time + done;
        a->modes[i] = chosen[i];
    }
    *count = 0;
    for (int j = 0; j < n_near; ++j) looked[(*count)++] = near[j];
    for (int j = 0; j < n_others; ++j) looked[(*count)++] = others[j];
    if (hit) {
        double time = a->time + done;
        int i = hit->law;
        if (s->events[i] == 0 || time - s->since[i] > WITHIN || time < s->since[i]) {
            s->since[i] = time;
            s->events[i] = 0;
        }
        if (++s->events[i] > MOST_EVENTS) return NO_END;
    }
    return OK;
}

/* Find the modes if they are unknown or a capacity appears or vanishes; what was looked at if so. */
static int settle(plant *s, state *a, const segment *g, int looked[], int *count)
{
    int same = a->started;
    *count = 0;
    for (int i = 0; i < NC && same; ++i) same = (a->modes[i] == LAWS[i].idle) == is_free(i, g);
    if (same) return OK;
    if (!a->started)
        for (int i = 0; i < NL; ++i)
            if (stretch_of(i) >= 0 && LAWS[i].held < 0) {
                a->modes[i] = starting(i, a->z);
                if (a->modes[i] < 0) return NO_MODES;
            }
    int status = resolve(s, a, g, 0, 0.0, looked, count);
    a->started = 1;
    return status;
}

/* What holds its slip must have none, or the modes are to be found anew. */
static void doubt(const plant *s, state *a)
{
    int known = a->started;
    for (int i = 0; i < NL; ++i)
        if (mode_of(i, a->modes[i])->held && !(fabs(dot(s->m->G[i], a->z, NX)) < KNOWN_SLIP)) known = 0;
    a->started = known;
    for (int i = 0; i < NL && !known; ++i) a->modes[i] = LAWS[i].unknown;
}

#if NM > 0
static void impose(double z[], const double speed[])
{
    double lacking[NM];
    for (int i = 0; i < NM; ++i) lacking[i] = speed[i] - dot(MOVING[i], z, NX);
    for (int k = 0; k < NX; ++k)
        for (int i = 0; i < NM; ++i) z[k] += IMPOSING[i][k] * lacking[i];
}

/* Bring moved nodes to their speeds; what they held is looked at again if they jump. */
static int jump(plant *s, state *a, const segment *g)
{
    double before[ZL] = {0.0}, after[ZL] = {0.0}, jumped = 0.0;
    int looked[ZL] = {0}, count;
    slips(s, a->z, before);
    impose(a->z, g->speed);
    slips(s, a->z, after);
    for (int i = 0; i < NL; ++i) jumped = largest(jumped, fabs(after[i] - before[i]));
    return a->started && jumped > ZERO_SLIP ? resolve(s, a, g, 0, 0.0, looked, &count) : OK;
}
#endif

/* All of one piece of the inputs, of at most dt. */
static int advance(plant *s, state *a, const segment *whole, double duration)
{
    segment g = *whole;
    event hit = {-1, 0, 0.0, 0.0};
    double done = 0.0, tick = TICK * largest(1.0, duration) + 8.0 * EPSILON * duration;
    int resolved[ZL] = {0}, count = 0, status = OK;
    doubt(s, a);
#if NM > 0
    if ((status = jump(s, a, &g))) return status;
#endif
    if ((status = settle(s, a, &g, resolved, &count))) return status;
    for (;;) {
        const pattern *p = pattern_of(s, a->modes, g.level);
        double left = duration - done;
        event next;
        status = first_event(s, p, &g, a->z, left, resolved, count, hit.law >= 0 ? &hit : 0, &next);
        if (status) return status;
        if (next.law < 0) break;
        if (left - next.time <= tick + next.doubt) {
            propagate(s, p, &g, a->z, left - next.time); /* the next piece decides what happens at its start */
            break;
        }
        hit = next;
        done += hit.time;
        if ((status = resolve(s, a, &g, &hit, done, resolved, &count))) return status;
    }
    a->time += duration;
    return OK;
}

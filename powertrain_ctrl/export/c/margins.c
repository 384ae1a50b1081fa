/* ---- which modes hold from an instant on ------------------------------------------------------------------------ */

/* What a law has left before its mode must end, with two derivatives and what of them is zero. */
typedef struct {
    int law, then;
    double value[3], tolerance[3], excess; /* tolerances below zero; 0 and not decided where all are zero */
    int decided;
} margin;

/* A law that can no longer do what it does, or law < 0. */
typedef struct {
    int law, then;
    double time, doubt;
} event;

/* x, its derivatives at the start, and of each the magnitude that INDIFFERENT is a part of. */
static void state_derivatives(const matrices *m, const pattern *p, const double z[], double u[4][NU], double given[4][ZL],
                              double x[4][NX], double size[4][NX])
{
    double norm = sqrt(dot(z, z, NX));
    for (int r = 0; r < NX; ++r) {
        x[0][r] = z[r];
        size[0][r] = fabs(z[r]) + ROUNDING / INDIFFERENT * norm;
    }
    for (int k = 0; k < 3; ++k) {
        double rate[NX], terms[NX];
        for (int r = 0; r < NX; ++r) {
            rate[r] = dot(p->A[r], x[k], NX) + dot(m->B[r], u[k], NU);
            terms[r] = absdot(p->A[r], size[k], NX) + absdot(m->B[r], u[k], NU);
            for (int i = 0; i < NL; ++i) {
                rate[r] -= m->W[i][r] * given[k][i];
                terms[r] += fabs(m->W[i][r] * given[k][i]);
            }
        }
        for (int r = 0; r < NX; ++r) {
            x[k + 1][r] = dot(p->push[r], rate, NX);
            size[k + 1][r] = fabs(x[k + 1][r]) + ROUNDING / INDIFFERENT * terms[r];
        }
    }
}

static void decide(margin *a, int number, int then, const double value[4], const double terms[4])
{
    a->law = number;
    a->then = then;
    a->excess = 0.0;
    a->decided = 0;
    for (int k = 0; k < 3; ++k) {
        a->value[k] = value[k];
        a->tolerance[k] = INDIFFERENT * terms[k] + TICK * terms[k + 1];
    }
}

static void weigh(margin *a)
{
    for (int k = 0; k < 3; ++k)
        if (fabs(a->value[k]) > a->tolerance[k]) {
            a->excess = -a->value[k] / a->tolerance[k];
            a->decided = 1;
            return;
        }
}

/* A reserve that has just been hit is not above zero, whatever rounding says. */
static void mind(margin *a, const event *hit, int now)
{
    if (hit && hit->law == a->law && hit->then != LAWS[a->law].held) {
        if (hit->then == a->then) a->value[0] = smallest(a->value[0], 0.0);
        else if (hit->then == now) a->value[0] = largest(a->value[0], 0.0);
    }
}

/* Inputs, torques that are given, capacities and the state at the start with their derivatives, sizes of the state's. */
typedef struct {
    double u[4][NU], given[4][ZL], capacity[4][ZL], x[4][NX], size[4][NX];
} beginning;

static void begin_of(const matrices *m, const pattern *p, const double z[], const segment *g, beginning *b)
{
    memset(b, 0, sizeof *b);
    memcpy(b->u[0], g->u, sizeof g->u);
    memcpy(b->u[1], g->du, sizeof g->du);
    memcpy(b->capacity[0], g->capacity, sizeof g->capacity);
    memcpy(b->capacity[1], g->dcapacity, sizeof g->dcapacity);
    given_torques(p, g, b->given[0], b->given[1]);
    state_derivatives(m, p, z, b->u, b->given, b->x, b->size);
}

/* What the laws that are held carry together with this one, which has the place that is given back. */
static int held_with(plant *s, const pattern *p, int i)
{
    int together[ZL] = {0}, h = 0, place = 0;
    for (int j = 0; j < NL; ++j)
        if (p->is_held[j] || j == i) {
            if (j == i) place = h;
            together[h++] = j;
        }
    hold_together(s->m, p->A, together, h, &s->hold);
    return place;
}

/* Guards of a law that never holds its slip. */
static int free_margins(const matrices *m, const pattern *p, const double z[], const beginning *b, int i, margin out[])
{
    const mode *a = mode_of(i, p->modes[i]);
    int e = stretch_of(i), y = NX - NE + e, n = 0;
    double slip[4], slips[4], torque[4], torques[4];
    for (int k = 0; k < 4; ++k) {
        slip[k] = dot(m->G[i], b->x[k], NX);
        slips[k] = absdot(m->G[i], b->size[k], NX);
        torque[k] = dot(p->torque_x[i], b->x[k], NX) + dot(p->torque_u[i], b->u[k], NU)
            + dot(p->torque_tau[i], b->given[k], NL);
        torques[k] = absdot(p->torque_x[i], b->size[k], NX) + absdot(p->torque_u[i], b->u[k], NU)
            + absdot(p->torque_tau[i], b->given[k], NL);
    }
    for (int j = a->first; j < a->first + a->count; ++j) {
        const guard *d = &GUARDS[j];
        double value[4], terms[4];
        for (int k = 0; k < 4; ++k) {
            double by_capacity = LAWS[i].is_clutch ? d->capacity * b->capacity[k][i] : 0.0, level = k ? 0.0 : d->level;
            value[k] = d->slip * slip[k] + d->torque * torque[k] + by_capacity + level;
            terms[k] = fabs(d->slip) * slips[k] + fabs(d->torque) * torques[k] + fabs(by_capacity) + fabs(level);
            if (e >= 0) {
                /* a twist changes by the slip */
                double twist = k ? slip[k - 1] : z[NX + e], twists = k ? slips[k - 1] : fabs(z[NX + e]);
                value[k] += d->twist * twist + d->stretch * b->x[k][y];
                terms[k] += fabs(d->twist) * twists + fabs(d->stretch) * b->size[k][y];
            }
        }
        decide(&out[n], i, d->then, value, terms);
        weigh(&out[n++]);
    }
    return n;
}

/* What a law that holds its slip, or slides at none, has left before it lets go, or sticks. */
static int holding_margins(plant *s, const pattern *p, const beginning *b, int i, const event *hit, margin out[])
{
    const mode *a = mode_of(i, p->modes[i]);
    int place = held_with(s, p, i), n = 0;
    double torque[4], terms[4], value[4], limits[4] = {0.0, 0.0, 0.0, 0.0};
    for (int k = 0; k < 4; ++k) {
        double others[ZL];
        memcpy(others, b->given[k], sizeof others);
        others[i] = 0.0;
        torque[k] = dot(s->hold.x[place], b->x[k], NX) + dot(s->hold.u[place], b->u[k], NU)
            + dot(s->hold.tau[place], others, NL);
        terms[k] = absdot(s->hold.x[place], b->size[k], NX) + absdot(s->hold.u[place], b->u[k], NU)
            + absdot(s->hold.tau[place], others, NL);
    }
    for (int j = a->first; a->held && j < a->first + a->count; ++j)
        for (int k = 0; k < 4; ++k) {
            double limit = (LAWS[i].is_clutch ? GUARDS[j].capacity * b->capacity[k][i] : 0.0) + (k ? 0.0 : GUARDS[j].level);
            limits[k] = largest(limits[k], fabs(limit));
        }
    for (int k = 0; k < 4; ++k)
        terms[k] += !a->held ? fabs(b->given[k][i]) : LAWS[i].is_clutch ? fabs(b->capacity[k][i]) : limits[k];
    for (int j = a->first; j < a->first + a->count; ++j) {
        const guard *d = &GUARDS[j];
        if (!a->held && d->then != LAWS[i].held) continue;
        double sign = d->slip > 0.0 ? 1.0 : d->slip < 0.0 ? -1.0 : 0.0;
        for (int k = 0; k < 4; ++k) {
            double limit = (LAWS[i].is_clutch ? d->capacity * b->capacity[k][i] : 0.0) + (k ? 0.0 : d->level);
            value[k] = a->held ? limit + d->torque * torque[k] : sign * (torque[k] - b->given[k][i]);
        }
        decide(&out[n], i, d->then, value, terms);
        mind(&out[n], hit, p->modes[i]);
        weigh(&out[n++]);
        if (!a->held) break; /* one way to stick is enough */
    }
    return n;
}

/* Margins at the start of these laws, at most ZG of them. */
static int margins(plant *s, const pattern *p, const double z[], const segment *g, const int laws[], int count,
                   const event *hit, margin out[])
{
    beginning b;
    int n = 0;
    begin_of(s->m, p, z, g, &b);
    for (int at = 0; at < count; ++at) {
        int i = laws[at];
        if (!mode_of(i, p->modes[i])->count || p->held_too[i]) continue;
        if (LAWS[i].held < 0) n += free_margins(s->m, p, z, &b, i, &out[n]);
        else n += holding_margins(s, p, &b, i, hit, &out[n]);
    }
    return n;
}

/* z with the stretches with which modes begin. */
static void enter(double z[NZ], const int before[], const int modes[])
{
    for (int i = 0; i < NL; ++i) {
        int e = stretch_of(i);
        if (e < 0 || before[i] == modes[i]) continue;
        const mode *a = mode_of(i, modes[i]);
        if (a->has_origin) z[NX - NE + e] = z[NX + e] - a->origin;
        else if (a->leak < 0.0) z[NX - NE + e] = 0.0;
    }
}

/* What these laws would do in the motion of these modes; by how many tolerances that differs. */
static double contradictions(plant *s, const int before[], const int modes[], const int laws[], int count, const double z[],
                             const segment *g, const event *hit, int wanted[])
{
    double entered[NZ], worst = 0.0;
    margin found[ZG];
    memcpy(entered, z, sizeof entered);
    enter(entered, before, modes);
    const pattern *p = pattern_of(s, modes, g->level);
    int n = margins(s, p, entered, g, laws, count, hit, found);
    for (int i = 0; i < NL; ++i) wanted[i] = modes[i];
    /* of two sides the one that is further beyond comes last */
    for (int i = 1; i < n; ++i) {
        margin a = found[i];
        int j = i;
        for (; j > 0 && found[j - 1].excess > a.excess; --j) found[j] = found[j - 1];
        found[j] = a;
    }
    for (int i = 0; i < n; ++i) {
        const margin *a = &found[i];
        if (!a->decided && a->then == LAWS[a->law].held) wanted[a->law] = a->then;
        else if (a->decided && a->excess > 0.0) {
            wanted[a->law] = a->then;
            worst = a->excess;
        }
    }
    return worst;
}

static int same_modes(const int a[], const int b[])
{
    for (int i = 0; i < NL; ++i)
        if (a[i] != b[i]) return 0;
    return 1;
}

/* Laws that are looked at, and the modes that each of them may be in. */
typedef struct {
    int count, law[ZL], modes[ZL][ZMODES], n_modes[ZL];
} options;

static void permit(options *o, int j, int then)
{
    for (int k = 0; k < o->n_modes[j]; ++k)
        if (o->modes[j][k] == then) return;
    o->modes[j][o->n_modes[j]++] = then;
}

/* The next of all combinations; 0 after the last. */
static int next_combination(const options *o, int at[ZL])
{
    for (int j = o->count - 1; j >= 0; --j) {
        if (++at[j] < o->n_modes[j]) return 1;
        at[j] = 0;
    }
    return 0;
}

/* The combination with the fewest changes that agrees with its own motion, or the one that contradicts itself least. */
static int fewest_changes(plant *s, int modes[ZL], const options *o, const double z[], const segment *g, const event *hit)
{
    int choice[ZL] = {0}, wanted[ZL] = {0}, best[ZL] = {0}, found = 0;
    double least = LENIENT;
    for (int changes = 0; changes <= o->count; ++changes) {
        int at[ZL] = {0};
        do {
            int changed = 0;
            for (int j = 0; j < o->count; ++j) changed += at[j] > 0;
            if (changed != changes) continue;
            for (int i = 0; i < NL; ++i) choice[i] = modes[i];
            for (int j = 0; j < o->count; ++j) choice[o->law[j]] = o->modes[j][at[j]];
            double excess = contradictions(s, modes, choice, o->law, o->count, z, g, hit, wanted);
            if (same_modes(wanted, choice)) {
                memcpy(modes, choice, sizeof choice);
                return OK;
            }
            if (excess < least) {
                least = excess;
                memcpy(best, choice, sizeof best);
                found = 1;
            }
        } while (next_combination(o, at));
    }
    if (!found) return NO_MODES;
    memcpy(modes, best, sizeof best);
    return OK;
}

/* Modes with those of the laws at zero slip (near) chosen so that they agree with their own motion: all stuck, then let go
   whoever cannot hold, which nearly always settles it. Others hold no slip and stay unless that contradicts itself. */
static int consistent_modes(plant *s, int modes[ZL], const int near[], int n_near, const int others[], int n_others,
                            const double z[], const segment *g, const event *hit)
{
    int choice[ZL] = {0}, wanted[ZL] = {0};
    options o;
    memset(&o, 0, sizeof o);
    for (int i = 0; i < NL; ++i) choice[i] = modes[i];
    for (int j = 0; j < n_near; ++j) {
        int i = near[j];
        const mode *a = mode_of(i, LAWS[i].held);
        o.law[o.count] = i;
        permit(&o, o.count, LAWS[i].held);
        for (int k = a->first; k < a->first + a->count; ++k) permit(&o, o.count, GUARDS[k].then);
        choice[i] = LAWS[i].held;
        ++o.count;
    }
    for (int j = 0; j < n_others; ++j) {
        o.law[o.count] = others[j];
        permit(&o, o.count++, modes[others[j]]);
    }
    for (int round = 0; round < 2 * o.count + 1; ++round) {
        contradictions(s, modes, choice, o.law, o.count, z, g, hit, wanted);
        if (same_modes(wanted, choice)) {
            memcpy(modes, choice, sizeof choice);
            return OK;
        }
        memcpy(choice, wanted, sizeof choice);
        for (int j = 0; j < o.count; ++j) permit(&o, j, choice[o.law[j]]);
    }
    return fewest_changes(s, modes, &o, z, g, hit);
}

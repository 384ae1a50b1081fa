/* ---- exact motion between events -------------------------------------------------------------------------------- */

static void shift(segment *g, double by)
{
    for (int i = 0; i < NU; ++i) g->u[i] += by * g->du[i];
    for (int i = 0; i < NC; ++i) g->capacity[i] += by * g->dcapacity[i];
    g->moves = 0;
}

/* Torques that depend on nothing but mode and capacity, and how fast they change. */
static void given_torques(const pattern *p, const segment *g, double given[ZL], double change[ZL])
{
    for (int i = 0; i < NL; ++i) {
        const mode *a = mode_of(i, p->modes[i]);
        given[i] = a->torque;
        change[i] = 0.0;
        if (LAWS[i].is_clutch) {
            given[i] += a->capacity * g->capacity[i];
            change[i] = a->capacity * g->dcapacity[i];
        }
    }
}

static void forces(const pattern *p, const segment *g, double b[NZ], double db[NZ])
{
    double given[ZL] = {0.0}, change[ZL] = {0.0};
    given_torques(p, g, given, change);
    for (int r = 0; r < NX; ++r) {
        b[r] = dot(p->force_u[r], g->u, NU) + dot(p->force_tau[r], given, NL);
        db[r] = dot(p->force_u[r], g->du, NU) + dot(p->force_tau[r], change, NL);
    }
    for (int r = NX; r < NZ; ++r) b[r] = db[r] = 0.0;
}

static void multiply(double a[NZ][NZ], double b[NZ][NZ], double out[NZ][NZ])
{
    for (int r = 0; r < NZ; ++r) {
        for (int c = 0; c < NZ; ++c) out[r][c] = 0.0;
        for (int k = 0; k < NZ; ++k)
            if (a[r][k] != 0.0)
                for (int c = 0; c < NZ; ++c) out[r][c] += a[r][k] * b[k][c];
    }
}

/* Steps of dt / 2^levels by Taylor's series, doubled until they are dt: of the change, so that what rests keeps to rest. */
static void make_propagator(plant *s, const pattern *p, propagator *q)
{
    double(*A)[NZ] = s->work[0], (*P2)[NZ] = s->work[1], (*term)[NZ] = s->work[2], (*next)[NZ] = s->work[3];
    double square = 0.0, h = DT;
    int doublings = 0;
    for (int r = 0; r < NZ; ++r)
        for (int c = 0; c < NZ; ++c) {
            double by = 1.0;
            if (NE > 0 && r >= NX - NE && r < NX) by *= p->scale[r - NX + NE];
            if (NE > 0 && c >= NX - NE && c < NX) by /= p->scale[c - NX + NE];
            A[r][c] = by * p->flow[r][c];
            square += A[r][c] * A[r][c];
        }
    q->rate = sqrt(square);
    while (q->rate * h > 0.5 && doublings < MOST_DOUBLINGS) {
        h *= 0.5;
        ++doublings;
    }
    q->levels = doublings < LEVELS ? doublings + 1 : LEVELS;
    /* P2 = h^2 (1/2! + A h/3! + ...), P1 = h + A P2, F = A P1 */
    for (int r = 0; r < NZ; ++r)
        for (int c = 0; c < NZ; ++c) P2[r][c] = term[r][c] = r == c ? 0.5 * h * h : 0.0;
    for (int k = 3; k < 21; ++k) {
        multiply(A, term, next);
        for (int r = 0; r < NZ; ++r)
            for (int c = 0; c < NZ; ++c) {
                term[r][c] = next[r][c] * h / (double)k;
                P2[r][c] += term[r][c];
            }
    }
    int level = doublings < LEVELS ? doublings : LEVELS - 1;
    double(*F)[NZ] = q->F[level], (*P1)[NZ] = q->P1[level], (*Q2)[NZ] = q->P2[level];
    memcpy(Q2, P2, sizeof q->P2[0]);
    multiply(A, Q2, P1);
    for (int r = 0; r < NZ; ++r) P1[r][r] += h;
    multiply(A, P1, F);
    for (int left = doublings; left > 0; --left, h *= 2.0) {
        /* of those that are shorter than what is kept, only the longest stays */
        int to = left - 1 < LEVELS ? left - 1 : LEVELS - 1;
        double(*F2)[NZ] = s->work[1], (*P12)[NZ] = s->work[2], (*P22)[NZ] = s->work[3];
        multiply(F, F, F2);
        multiply(F, P1, P12);
        multiply(F, Q2, P22);
        for (int r = 0; r < NZ; ++r)
            for (int c = 0; c < NZ; ++c) {
                P22[r][c] += 2.0 * Q2[r][c] + h * P1[r][c];
                P12[r][c] += 2.0 * P1[r][c];
                F2[r][c] += 2.0 * F[r][c];
            }
        F = q->F[to], P1 = q->P1[to], Q2 = q->P2[to];
        memcpy(F, F2, sizeof q->F[0]);
        memcpy(P1, P12, sizeof q->F[0]);
        memcpy(Q2, P22, sizeof q->F[0]);
    }
    for (int k = 0; k < q->levels && NE > 0; ++k)
        for (int r = 0; r < NZ; ++r)
            for (int c = 0; c < NZ; ++c) {
                double by = 1.0;
                if (r >= NX - NE && r < NX) by /= p->scale[r - NX + NE];
                if (c >= NX - NE && c < NX) by *= p->scale[c - NX + NE];
                q->F[k][r][c] *= by;
                q->P1[k][r][c] *= by;
                q->P2[k][r][c] *= by;
            }
}

static propagator *propagator_of(plant *s, const pattern *p)
{
    double key[ZL][5];
    memset(key, 0, sizeof key);
    for (int i = 0; i < NL; ++i) {
        const mode *a = mode_of(i, p->modes[i]);
        const double own[5] = {a->held, a->stiffness, p->damping[i], a->follows, a->leak};
        for (int k = 0; k < 5; ++k) key[i][k] = own[k];
    }
    for (int i = 0; i < PROPAGATORS; ++i) {
        propagator *q = &s->propagators[i];
        int same = q->used;
        for (int j = 0; j < NL && same; ++j)
            for (int k = 0; k < 5 && same; ++k) same = q->key[j][k] == key[j][k];
        if (same) return q;
    }
    propagator *q = &s->propagators[s->next_propagator];
    s->next_propagator = (s->next_propagator + 1) % PROPAGATORS;
    memcpy(q->key, key, sizeof key);
    make_propagator(s, p, q);
    q->used = 1;
    return q;
}

/* z and the inputs after a time of at most dt. */
static void propagate(plant *s, const pattern *p, segment *g, double z[NZ], double time)
{
    const propagator *q = propagator_of(s, p);
    double b[NZ], db[NZ], next[NZ], h = DT, longest = q->rate > 0.0 ? 0.5 / q->rate : DT;
    forces(p, g, b, db);
    for (int k = 0; k < q->levels; ++k, h *= 0.5) {
        if (time < h) continue;
        for (int r = 0; r < NZ; ++r)
            next[r] = z[r] + (dot(q->F[k][r], z, NZ) + dot(q->P1[k][r], b, NZ) + dot(q->P2[k][r], db, NZ));
        for (int r = 0; r < NZ; ++r) {
            z[r] = next[r];
            b[r] += h * db[r];
        }
        shift(g, h);
        time -= h;
    }
    while (time > 0.0) {
        double part = smallest(time, longest), rate[NZ], factor = part;
        for (int r = 0; r < NZ; ++r) rate[r] = dot(p->flow[r], z, NZ) + b[r];
        for (int k = 2; k < 24; ++k) {
            for (int r = 0; r < NZ; ++r) next[r] = dot(p->flow[r], rate, NZ) + (k == 2 ? db[r] : 0.0);
            double change = 0.0;
            for (int r = 0; r < NZ; ++r) {
                change = largest(change, fabs(factor * rate[r]) - 1e-18 * fabs(z[r]));
                z[r] += factor * rate[r];
                rate[r] = next[r];
            }
            factor *= part / (double)k;
            if (!(change > 0.0) && k > 3) break;
        }
        for (int r = 0; r < NZ; ++r) b[r] += part * db[r];
        shift(g, part);
        time -= part;
    }
}

/* Values, slopes, bounds on how they bend within a span, and sizes of the terms of all guards. */
typedef struct {
    double value[ZG], slope[ZG], bend[ZG], size[ZG];
} view;

static double scaled_norm(const pattern *p, const double x[])
{
    double square = 0.0;
    for (int k = 0; k < NX; ++k) {
        double part = k >= NX - NE ? p->scale[k - (NX - NE)] * x[k] : x[k];
        square += part * part;
    }
    return sqrt(square);
}

static void look(const pattern *p, const segment *g, const double z[NZ], double span, view *v)
{
    double b[NZ], db[NZ], rate[NZ], second[NZ], given[ZL] = {0.0}, change[ZL] = {0.0};
    given_torques(p, g, given, change);
    forces(p, g, b, db);
    for (int r = 0; r < NZ; ++r) rate[r] = dot(p->flow[r], z, NZ) + b[r];
    for (int r = 0; r < NX; ++r) second[r] = dot(p->flow[r], rate, NZ) + db[r];
    double bends = scaled_norm(p, second), turns = NE > 0 ? scaled_norm(p, rate) : 0.0;
    if (p->growth > 0.0) bends *= exp(p->growth * span);
    turns += span * bends;
    for (int j = 0; j < p->n_guards; ++j) {
        int i = p->law[j];
        double on_c = LAWS[i].is_clutch ? p->on_c[j] : 0.0, c = on_c * g->capacity[i], dc = on_c * g->dcapacity[i];
        v->value[j] = dot(p->on_z[j], z, NZ)
            + (dot(p->on_u[j], g->u, NU) + dot(p->on_tau[j], given, NL) + c + p->constant[j]);
        v->slope[j] = dot(p->on_z[j], rate, NZ) + (dot(p->on_u[j], g->du, NU) + dot(p->on_tau[j], change, NL) + dc);
        v->bend[j] = p->norm[j] * bends + p->turn[j] * turns;
        v->size[j] = absdot(p->on_z[j], z, NZ) + absdot(p->on_u[j], g->u, NU) + absdot(p->on_tau[j], given, NL) + fabs(c)
            + fabs(p->constant[j]);
    }
}

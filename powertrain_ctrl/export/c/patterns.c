/* ---- the driveline in its modes --------------------------------------------------------------------------------- */

static const mode *mode_of(int i, int index) { return &MODES[LAWS[i].first + index]; }

/* Place of the stretch of a law, -1 without one. */
static int stretch_of(int i) { return NE > 0 ? LAWS[i].stretch : -1; }

/* What laws carry that hold their slips at zero together. */
static void hold_together(const matrices *m, const double A[NX][NX], const int laws[], int h, holding *out)
{
    double mult[ZL][NX];
    multiplier(m, laws, h, mult);
    for (int i = 0; i < h; ++i) {
        double square = dot(mult[i], mult[i], NX);
        out->weight[i] = square > 0.0 ? 1.0 / square : 0.0;
        for (int j = 0; j < NX; ++j) {
            double sum = 0.0, terms = 0.0;
            for (int k = 0; k < NX; ++k) {
                sum += mult[i][k] * A[k][j];
                terms += fabs(mult[i][k] * A[k][j]);
            }
            out->x[i][j] = cleared(sum, terms);
        }
        for (int j = 0; j < NU; ++j) {
            double sum = 0.0, terms = 0.0;
            for (int k = 0; k < NX; ++k) {
                sum += mult[i][k] * m->B[k][j];
                terms += fabs(mult[i][k] * m->B[k][j]);
            }
            out->u[i][j] = cleared(sum, terms);
        }
        for (int j = 0; j < NL; ++j)
            out->tau[i][j] = -cleared(dot(mult[i], m->W[j], NX), absdot(mult[i], m->W[j], NX));
    }
}

static void acting(const matrices *m, pattern *p)
{
    memcpy(p->A, m->A, sizeof p->A);
    p->growth = 0.0;
    p->n_held = 0;
    for (int i = 0; i < NL; ++i) {
        const mode *a = mode_of(i, p->modes[i]);
        double square = dot(m->G[i], m->G[i], NX), damping = a->damping + p->level[i] * a->slope;
        p->damping[i] = damping;
        p->is_held[i] = a->held;
        if (a->held) p->held[p->n_held++] = i;
        if (damping != 0.0)
            for (int r = 0; r < NX; ++r)
                for (int c = 0; c < NX; ++c) p->A[r][c] -= damping * m->W[i][r] * m->G[i][c];
        if (damping < 0.0) p->growth -= damping * square;
        int e = stretch_of(i);
        if (e < 0) continue;
        int y = NX - NE + e;
        p->moving[e] = a->follows || a->leak > 0.0;
        double k = a->stiffness, scale = k > 0.0 ? sqrt(k) : 1.0;
        p->scale[e] = scale;
        for (int r = 0; r < NX; ++r) p->A[r][y] -= k * m->W[i][r];
        if (a->follows)
            for (int c = 0; c < NX; ++c) p->A[y][c] += m->G[i][c];
        if (a->leak > 0.0) p->A[y][y] -= a->leak;
        double oneway = p->moving[e] ? fabs((a->follows ? scale : 0.0) - k / scale) : 0.0;
        if (oneway > ROUNDING * scale) p->growth += 0.5 * oneway * sqrt(square);
    }
}

/* push: rates without what is held; still: an orthogonal projection on what is not. Free of rounding, so that bodies that
   are held at rest stay there to the last bit. */
static void projections(const matrices *m, pattern *p, double still[NX][NX])
{
    double mult[ZL][NX];
    memset(mult, 0, sizeof mult);
    multiplier(m, p->held, p->n_held, mult);
    for (int r = 0; r < NX; ++r)
        for (int c = 0; c < NX; ++c) {
            double sum = r == c ? 1.0 : 0.0, terms = sum;
            for (int j = 0; j < p->n_held; ++j) {
                sum -= m->W[p->held[j]][r] * mult[j][c];
                terms += fabs(m->W[p->held[j]][r] * mult[j][c]);
            }
            p->push[r][c] = cleared(sum, terms);
        }
#if NM > 0
    double columns[ZL][NW], inverse[ZL][NW];
    memset(columns, 0, sizeof columns);
    for (int j = 0; j < p->n_held; ++j) memcpy(columns[j], m->G[p->held[j]], sizeof m->G[0]);
    pseudo_inverse(p->n_held, NX, (const double(*)[NW])columns, inverse);
    for (int r = 0; r < NX; ++r)
        for (int c = 0; c < NX; ++c) {
            double sum = r == c ? 1.0 : 0.0, terms = sum;
            for (int j = 0; j < p->n_held; ++j) {
                sum -= m->G[p->held[j]][r] * inverse[j][c];
                terms += fabs(m->G[p->held[j]][r] * inverse[j][c]);
            }
            still[r][c] = cleared(sum, terms);
        }
#else
    memcpy(still, p->push, sizeof p->push);
#endif
    for (int e = 0; e < NE; ++e)
        if (!p->moving[e])
            for (int j = 0, y = NX - NE + e; j < NX; ++j)
                p->push[y][j] = p->push[j][y] = still[y][j] = still[j][y] = 0.0;
}

/* flow = push A still, with what twists below it, free of rounding. */
static void flows(plant *s, pattern *p, double still[NX][NX])
{
    const matrices *m = s->m;
    double(*half)[NZ] = s->work[0], (*terms)[NZ] = s->work[1];
    memset(p->flow, 0, sizeof p->flow);
    for (int r = 0; r < NX; ++r)
        for (int c = 0; c < NX; ++c) {
            half[r][c] = terms[r][c] = 0.0;
            for (int k = 0; k < NX; ++k) {
                half[r][c] += p->push[r][k] * p->A[k][c];
                terms[r][c] += fabs(p->push[r][k] * p->A[k][c]);
            }
        }
    for (int r = 0; r < NX; ++r)
        for (int c = 0; c < NX; ++c) {
            double sum = 0.0, size = 0.0;
            for (int k = 0; k < NX; ++k) {
                sum += half[r][k] * still[k][c];
                size += terms[r][k] * fabs(still[k][c]);
            }
            p->flow[r][c] = cleared(sum, size);
        }
    for (int i = 0; i < NL; ++i)
        for (int c = 0; stretch_of(i) >= 0 && c < NX; ++c) {
            double sum = 0.0, size = 0.0;
            for (int k = 0; k < NX; ++k) {
                sum += m->G[i][k] * still[k][c];
                size += fabs(m->G[i][k] * still[k][c]);
            }
            p->flow[NX + stretch_of(i)][c] = cleared(sum, size);
        }
    for (int r = 0; r < NX; ++r) {
        for (int c = 0; c < NU; ++c) {
            p->force_u[r][c] = 0.0;
            for (int k = 0; k < NX; ++k) p->force_u[r][c] += p->push[r][k] * m->B[k][c];
        }
        for (int i = 0; i < NL; ++i) p->force_tau[r][i] = -dot(p->push[r], m->W[i], NX);
    }
}

static void torques(const matrices *m, pattern *p, double still[NX][NX])
{
    hold_together(m, (const double(*)[NX])p->A, p->held, p->n_held, &p->hold);
    for (int i = 0, h = 0; i < NL; ++i) {
        const mode *a = mode_of(i, p->modes[i]);
        p->held_too[i] = 0;
        if (p->is_held[i]) {
            memcpy(p->torque_x[i], p->hold.x[h], sizeof p->hold.x[h]);
            memcpy(p->torque_u[i], p->hold.u[h], sizeof p->hold.u[h]);
            memcpy(p->torque_tau[i], p->hold.tau[h++], sizeof p->hold.tau[0]);
            continue;
        }
        for (int k = 0; k < NX; ++k) p->torque_x[i][k] = p->damping[i] * m->G[i][k];
        if (a->stiffness > 0.0) p->torque_x[i][NX - NE + stretch_of(i)] += a->stiffness;
        memset(p->torque_u[i], 0, sizeof p->torque_u[i]);
        memset(p->torque_tau[i], 0, sizeof p->torque_tau[i]);
        p->torque_tau[i][i] = 1.0;
        if (LAWS[i].held < 0) continue;
        double left = 0.0;
        for (int k = 0; k < NX; ++k) {
            double part = 0.0;
            for (int j = 0; j < NX; ++j) part += m->G[i][j] * still[j][k];
            left += part * part;
        }
        p->held_too[i] = sqrt(left) <= REDUNDANT * sqrt(dot(m->G[i], m->G[i], NX));
    }
}

static void guards(const matrices *m, pattern *p, double still[NX][NX])
{
    int n = 0;
    for (int i = 0; i < NL; ++i) {
        const mode *a = mode_of(i, p->modes[i]);
        int e = stretch_of(i);
        for (int j = a->first; j < a->first + a->count; ++j) {
            const guard *g = &GUARDS[j];
            if (p->held_too[i] && g->then == LAWS[i].held) continue;
            p->law[n] = i;
            p->then[n] = g->then;
            memset(p->on_z[n], 0, sizeof p->on_z[n]);
            for (int k = 0; k < NX; ++k) p->on_z[n][k] = g->slip * m->G[i][k] + g->torque * p->torque_x[i][k];
            for (int k = 0; k < NU; ++k) p->on_u[n][k] = g->torque * p->torque_u[i][k];
            for (int k = 0; k < NL; ++k) p->on_tau[n][k] = g->torque * p->torque_tau[i][k];
            if (e >= 0) {
                p->on_z[n][NX - NE + e] += g->stretch;
                p->on_z[n][NX + e] += g->twist;
            }
            p->on_c[n] = g->capacity;
            p->constant[n] = g->level;
            double bends = 0.0, turns = 0.0;
            for (int k = 0; k < NX; ++k) {
                double row = 0.0, turn = 0.0;
                for (int l = 0; l < NX; ++l) row += p->on_z[n][l] * still[l][k];
                for (int l = 0; l < NE; ++l) turn += p->on_z[n][NX + l] * p->flow[NX + l][k];
                if (k >= NX - NE) {
                    row /= p->scale[k - NX + NE];
                    turn /= p->scale[k - NX + NE];
                }
                bends += row * row;
                turns += turn * turn;
            }
            p->norm[n] = sqrt(bends);
            p->turn[n++] = sqrt(turns);
        }
    }
    p->n_guards = n;
}

/* The driveline in these modes, as kept or made anew in the place that was made first. */
static pattern *pattern_of(plant *s, const int modes[], const double level[])
{
    for (int i = 0; i < PATTERNS; ++i) {
        pattern *p = &s->patterns[i];
        int same = p->used;
        for (int j = 0; j < NL && same; ++j) same = p->modes[j] == modes[j] && p->level[j] == level[j];
        if (same) return p;
    }
    pattern *p = &s->patterns[s->next_pattern];
    s->next_pattern = (s->next_pattern + 1) % PATTERNS;
    for (int j = 0; j < NL; ++j) {
        p->modes[j] = modes[j];
        p->level[j] = level[j];
    }
    acting(s->m, p);
    projections(s->m, p, s->still);
    flows(s, p, s->still);
    torques(s->m, p, s->still);
    guards(s->m, p, s->still);
    p->used = 1;
    return p;
}

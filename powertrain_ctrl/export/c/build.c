/* ---- matrices from parameters ----------------------------------------------------------------------------------- */

#if NP > 0
/* Lower triangular L of a = L L^T in its place; 0 if there is none. */
static int cholesky(int n, double *a, int width)
{
    for (int j = 0; j < n; ++j)
        for (int i = j; i < n; ++i) {
            double *row = a + i * width, *column = a + j * width, sum = row[j] - dot(row, column, j);
            if (i == j) {
                if (!(sum > 1e-13 * row[j])) return 0;
                row[j] = sqrt(sum);
            } else {
                row[j] = sum / column[j];
                column[i] = 0.0;
            }
        }
    return 1;
}

/* L^-1 b in place of b. */
static void forward(int n, const double *L, int width, double b[])
{
    for (int i = 0; i < n; ++i) b[i] = (b[i] - dot(L + i * width, b, i)) / L[i * width + i];
}

static double combined(double at_zero, const double slopes[], const double p[], int stride)
{
    for (int j = 0; j < NP; ++j) at_zero += p[j] * slopes[j * stride];
    return at_zero;
}

static int build(plant *s, const double p[])
{
    matrices *m = &s->own;
    double(*L)[NN] = s->build, (*R)[ZR] = s->spread, k[ZK], d[ZK];
    for (int j = 0; j < NP; ++j)
        if (!(p[j] <= 1e300 && (ZERO_PERMITTED[j] ? p[j] >= 0.0 : p[j] > 0.0))) return BAD_PARAMETERS;
    for (int r = 0; r < NN; ++r)
        for (int c = 0; c < NN; ++c) L[r][c] = combined(MASS_0[r][c], &MASS_BY[0][r][c], p, NN * NN);
    for (int i = 0; i < NK; ++i) {
        k[i] = combined(STIFFNESS_0[i], &STIFFNESS_BY[0][i], p, NK);
        d[i] = combined(DAMPING_0[i], &DAMPING_BY[0][i], p, NK);
    }
    for (int r = 0; r < NR; ++r)
        for (int c = 0; c < NR; ++c) {
            R[r][c] = 0.0;
            for (int i = 0; i < NK; ++i) R[r][c] += k[i] * TWIST[i][r] * TWIST[i][c];
        }
    if (!cholesky(NN, &L[0][0], NN) || !cholesky(NR, &R[0][0], ZR)) return BAD_PARAMETERS;
    memset(m, 0, sizeof *m);
    /* springs hold half of |R^T twist|^2, bodies half of |L^T speed|^2 */
    for (int i = 0; i < NK; ++i) {
        memcpy(s->rows[i], COMPLIANCE[i], sizeof s->rows[i]);
        forward(NN, &L[0][0], NN, s->rows[i]);
    }
    for (int r = 0; r < NR; ++r)
        for (int c = 0; c < NN; ++c) {
            double sum = 0.0;
            for (int i = r; i < NR; ++i) sum += R[i][r] * s->rows[ELASTIC[i]][c];
            m->A[r][NR + c] = sum;
            m->A[NR + c][r] = -sum;
        }
    for (int r = 0; r < NN; ++r)
        for (int c = 0; c < NN; ++c)
            for (int i = 0; i < NK; ++i) m->A[NR + r][NR + c] -= d[i] * s->rows[i][r] * s->rows[i][c];
    for (int j = 0; j < NU; ++j) {
        double load[NN];
        memcpy(load, LOAD[j], sizeof load);
        forward(NN, &L[0][0], NN, load);
        for (int r = 0; r < NN; ++r) m->B[NR + r][j] = load[r];
    }
    for (int i = 0; i < NL; ++i) {
        memcpy(&m->G[i][NR], SLIP[i], sizeof SLIP[i]);
        forward(NN, &L[0][0], NN, &m->G[i][NR]);
        memcpy(m->W[i], m->G[i], sizeof m->W[i]);
    }
    for (int o = 0; o < NO; ++o) {
        double on_twist[ZR], on_speed[NN], on_rate[NN], *out = m->out[o];
        memcpy(on_twist, ON_TWIST[o], sizeof on_twist);
        memcpy(on_speed, ON_SPEED[o], sizeof on_speed);
        memcpy(on_rate, ON_ACCELERATION[o], sizeof on_rate);
        if (CARRIED[o] >= 0) {
            for (int r = 0; r < NR; ++r) on_twist[r] = k[CARRIED[o]] * TWIST[CARRIED[o]][r];
            for (int r = 0; r < NN; ++r) on_speed[r] = d[CARRIED[o]] * COMPLIANCE[CARRIED[o]][r];
        }
        forward(NR, &R[0][0], ZR, on_twist);
        forward(NN, &L[0][0], NN, on_speed);
        forward(NN, &L[0][0], NN, on_rate);
        for (int r = 0; r < NR; ++r) out[r] = on_twist[r];
        for (int r = 0; r < NN; ++r) out[NR + r] = on_speed[r];
        for (int c = 0; c < NX; ++c)
            for (int r = 0; r < NN; ++r) out[c] += on_rate[r] * m->A[NR + r][c];
        for (int i = 0; i < NL; ++i) out[NX + i] = ON_TORQUE[o][i] - dot(on_rate, &m->W[i][NR], NN);
        for (int j = 0; j < NU; ++j) {
            out[NX + NL + j] = ON_LOAD[o][j];
            for (int r = 0; r < NN; ++r) out[NX + NL + j] += on_rate[r] * m->B[NR + r][j];
        }
    }
    for (int r = 0; r < NN; ++r)
        for (int i = r; i < NN; ++i) s->start[NR + r] += L[i][r] * SPEED_0[i];
    s->m = m;
    return OK;
}
#endif

/* ---- small dense algebra ---------------------------------------------------------------------------------------- */

static double dot(const double *a, const double *b, int n)
{
    double sum = 0.0;
    for (int i = 0; i < n; ++i) sum += a[i] * b[i];
    return sum;
}

static double absdot(const double *a, const double *b, int n)
{
    double sum = 0.0;
    for (int i = 0; i < n; ++i) sum += fabs(a[i] * b[i]);
    return sum;
}

static double largest(double a, double b) { return a > b ? a : b; }

static double smallest(double a, double b) { return a < b ? a : b; }

/* Sums smaller than this part of the terms they consist of are zero. */
static double cleared(double sum, double terms) { return fabs(sum) <= ROUNDING * terms ? 0.0 : sum; }

/* out = pinv(M) of the matrix M whose h columns of length n are given as rows: one-sided Jacobi rotations.
   Columns that depend on each other share with least norm. */
static void pseudo_inverse(int h, int n, const double columns[ZL][NW], double out[ZL][NW])
{
    double u[ZL][NW], v[ZL][ZL], norm[ZL], top = 0.0;
    memcpy(u, columns, sizeof u);
    for (int i = 0; i < h; ++i)
        for (int j = 0; j < h; ++j) v[i][j] = i == j ? 1.0 : 0.0;
    for (int sweep = 0; sweep < 40; ++sweep) {
        int rotated = 0;
        for (int i = 0; i < h; ++i)
            for (int j = i + 1; j < h; ++j) {
                double a = dot(u[i], u[i], n), b = dot(u[j], u[j], n), c = dot(u[i], u[j], n);
                if (c == 0.0 || fabs(c) <= 1e-16 * sqrt(a) * sqrt(b)) continue;
                double zeta = (b - a) / (2.0 * c), t = 1.0 / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
                if (zeta < 0.0) t = -t;
                double cosine = 1.0 / sqrt(1.0 + t * t), sine = cosine * t;
                for (int k = 0; k < n; ++k) {
                    double first = u[i][k], second = u[j][k];
                    u[i][k] = cosine * first - sine * second;
                    u[j][k] = sine * first + cosine * second;
                }
                for (int k = 0; k < h; ++k) {
                    double first = v[i][k], second = v[j][k];
                    v[i][k] = cosine * first - sine * second;
                    v[j][k] = sine * first + cosine * second;
                }
                rotated = 1;
            }
        if (!rotated) break;
    }
    for (int i = 0; i < h; ++i) {
        norm[i] = sqrt(dot(u[i], u[i], n));
        top = largest(top, norm[i]);
    }
    for (int i = 0; i < h; ++i)
        for (int k = 0; k < n; ++k) {
            double sum = 0.0;
            for (int j = 0; j < h; ++j)
                if (norm[j] > REDUNDANT * top && top > 0.0) sum += v[j][i] * u[j][k] / (norm[j] * norm[j]);
            out[i][k] = sum;
        }
}

/* Torques of these laws that a rate of x takes to keep their slips as they are, one row a law. */
static void multiplier(const matrices *m, const int laws[], int h, double out[ZL][NX])
{
    double columns[ZL][NW], inverse[ZL][NW];
    memset(columns, 0, sizeof columns);
    memset(inverse, 0, sizeof inverse);
#if NM > 0
    for (int i = 0; i < h; ++i)
        for (int j = 0; j < h; ++j) columns[i][j] = dot(m->G[laws[j]], m->W[laws[i]], NX);
    pseudo_inverse(h, h, (const double(*)[NW])columns, inverse);
    for (int i = 0; i < h; ++i)
        for (int k = 0; k < NX; ++k) {
            out[i][k] = 0.0;
            for (int j = 0; j < h; ++j) out[i][k] += inverse[i][j] * m->G[laws[j]][k];
        }
#else
    for (int i = 0; i < h; ++i) memcpy(columns[i], m->G[laws[i]], sizeof m->G[0]);
    pseudo_inverse(h, NX, (const double(*)[NW])columns, inverse);
    for (int i = 0; i < h; ++i) memcpy(out[i], inverse[i], sizeof out[0]);
#endif
    /* what does not touch these laws must not do so by rounding */
    for (int i = 0; i < h; ++i) {
        double norm = sqrt(dot(out[i], out[i], NX));
        for (int k = 0; k < NX; ++k) out[i][k] = cleared(out[i][k], norm);
    }
}

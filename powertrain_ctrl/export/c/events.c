/* ---- the first event -------------------------------------------------------------------------------------------- */

/* Largest h for which g + slope h - bend h^2 / 2 >= 0 on all of [0, h], each form where its terms do not cancel. */
static double certified_step(double g, double slope, double bend)
{
    double root = sqrt(slope * slope + 2.0 * bend * g), below = slope < 0.0 ? root - slope : bend;
    if (below <= 1e-250) return HUGE_VAL;
    return (slope < 0.0 ? 2.0 * g : slope + root) / below;
}

/* Which guards start at zero, and polynomials within which they are not told from zero later on. */
static void departures(plant *s, const pattern *p, const double z[], const segment *g, const int laws[], int count,
                       const event *hit, int departing[], double blur[][4])
{
    margin found[ZG];
    view now;
    memset(blur, 0, ZG * sizeof blur[0]);
    for (int j = 0; j < p->n_guards; ++j) departing[j] = 0;
    if (!count) return;
    look(p, g, z, 0.0, &now);
    int n = margins(s, p, z, g, laws, count, hit, found);
    for (int j = 0; j < p->n_guards; ++j) {
        const margin *a = 0;
        for (int k = 0; k < n; ++k)
            if (found[k].law == p->law[j] && found[k].then == p->then[j]) a = &found[k];
        if (!a) continue;
        double drift[3];
        for (int k = 0; k < 3; ++k) drift[k] = 2.0 * LENIENT * a->tolerance[k];
        if (a->then == LAWS[a->law].held) {
            int place = held_with(s, p, a->law);
            double weight = s->hold.weight[place];
            departing[j] = 1;
            blur[j][0] = 2.0 * fabs(now.value[j]) + ROUNDING * now.size[j];
            blur[j][1] = weight * drift[0];
            blur[j][2] = weight * drift[1] / 2.0;
            blur[j][3] = weight * drift[2] / 6.0;
        } else {
            departing[j] = a->value[0] <= a->tolerance[0];
            blur[j][0] = drift[0] + 2.0 * fabs(now.value[j]);
            blur[j][1] = drift[1];
            blur[j][2] = drift[2] / 2.0;
        }
    }
}

static event event_at(const pattern *p, const view *v, int j, double time)
{
    double rounding = ROUNDING * v->size[j], slope = fabs(v->slope[j]);
    event e = {p->law[j], p->then[j], time, LONGEST_DOUBT};
    if (slope * LONGEST_DOUBT > 2.0 * rounding) e.doubt = 2.0 * rounding / slope;
    return e;
}

/* The longest of the tabulated steps that is no longer than this; below the last of them anything goes. */
static double tabulated(const propagator *q, double step)
{
    double h = DT;
    for (int k = 0; k < q->levels; ++k, h *= 0.5)
        if (h <= step) return h;
    return step;
}

/* The first guard that reaches zero within the duration, where it does; z and the inputs are moved there or to the end. */
static int first_event(plant *s, const pattern *p, segment *g, double z[NZ], double duration, const int resolved[], int count,
                       const event *hit, event *out)
{
    int departing[ZG] = {0}, any = 0;
    double blur[ZG][4], t = 0.0, creep = FIRST_STEP;
    view v;
    out->law = -1;
    if (!p->n_guards) {
        propagate(s, p, g, z, duration);
        return OK;
    }
    departures(s, p, z, g, resolved, count, hit, departing, blur);
    for (int j = 0; j < p->n_guards; ++j) any = any || departing[j];
    const propagator *q = propagator_of(s, p);
    if (!any) {
        /* a guard above h^2 / 8 of its bend at both ends stays positive in between */
        double end[NZ];
        segment later = *g;
        view w;
        look(p, g, z, duration, &v);
        memcpy(end, z, sizeof end);
        propagate(s, p, &later, end, duration);
        look(p, &later, end, 0.0, &w);
        int safe = 1;
        for (int j = 0; j < p->n_guards && safe; ++j) {
            double least = SAFE * v.bend[j] * duration * duration / 8.0 + 4.0 * ROUNDING * largest(v.size[j], w.size[j]);
            safe = v.value[j] > least && w.value[j] > least;
        }
        if (safe) {
            memcpy(z, end, sizeof end);
            *g = later;
            return OK;
        }
    }
    for (long looks = 0; looks < MOST_LOOKS; ++looks) {
        double until = p->growth > 0.0 ? smallest(duration, t + 1.0 / p->growth) : duration, onward = HUGE_VAL;
        int first = -1, least = 0, waits = 0;
        look(p, g, z, until - t, &v);
        for (int j = 0; j < p->n_guards; ++j) {
            double fog = blur[j][0] + t * (blur[j][1] + t * (blur[j][2] + t * blur[j][3])) + ROUNDING * v.size[j];
            int hidden = departing[j] && !(v.value[j] > fog), touching = v.value[j] <= ROUNDING * v.size[j];
            int below = (touching && v.slope[j] < 0.0) || v.value[j] < -2.0 * INDIFFERENT * v.size[j];
            if ((hidden ? v.value[j] < -fog : below) && first < 0) first = j;
            double step = certified_step(largest(v.value[j], 0.0), v.slope[j], v.bend[j]);
            if (hidden) step *= 0.5;
            if (hidden || touching) {
                step = largest(step, largest(creep, 10.0 * SAME_TIME * t));
                waits = 1;
            }
            if (until < duration) step = smallest(step, until - t);
            if (step < onward) {
                onward = step;
                least = j;
            }
            departing[j] = hidden;
        }
        if (first >= 0) {
            *out = event_at(p, &v, first, t);
            return OK;
        }
        if (t + onward >= duration) {
            propagate(s, p, g, z, duration - t);
            return OK;
        }
        if (onward < SAME_TIME * largest(1.0, t)) {
            *out = event_at(p, &v, least, t);
            return OK;
        }
        onward = tabulated(q, onward);
        if (waits) creep = 2.0 * onward;
        propagate(s, p, g, z, onward);
        t += onward;
    }
    return NO_END;
}

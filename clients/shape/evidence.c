#include "clients/shape/evidence.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

void kn_evidence_close(kn_evidence *e)
{
    e->readings = e->pulled ? e->pull.bins : 0;
    e->until_s = e->pulled ? e->press.hold_end_s : e->press.time_s[0];
    for (int i = 0; i < e->reliefs; i++) {
        e->readings += e->relief[i].readings;
        e->until_s = fmax(e->until_s, e->moment_s[i]);
    }
}

void kn_evidence_free(kn_evidence *e)
{
    kn_press_free(&e->press);
    for (int i = 0; i < e->reliefs; i++) kn_relief_free(&e->relief[i]);
    if (e->pulled) kn_pull_free(&e->pull);
    memset(e, 0, sizeof *e);
}

// Compute the residuals of the surfaces, without those of the force. Return a pointer past the last residual, or NULL
// if memory runs out.
static double *surfaces(const kn_evidence *e, const kn_exhibit *x, const double shift_m[2], double *residual,
                        kn_relief_misfit *misfit)
{
    const kn_surface *s = x->surface;
    for (int i = 0; i < e->reliefs; i++) {
        if (!kn_relief_compare(&e->relief[i], shift_m, (const float(*)[3])x->pressed.shape_m[i], x->rest_m,
                               s->vertex_count, s->triangle_count, (const int(*)[3])s->triangle, residual,
                               misfit ? &misfit[i] : NULL))
            return NULL;
        residual += e->relief[i].readings;
    }
    return residual;
}

// Improve the shift of the images by one Gauss-Newton step. The slopes come from shifts by a pixel to either side.
// Return false if memory runs out.
static bool align(const kn_evidence *e, const kn_exhibit *x, double shift_m[2])
{
    const double h = e->relief[0].frame.pixel_m;
    double normal[2][2] = {{0}}, right[2] = {0};
    int n = e->readings;
    double *r = calloc(5 * (size_t)n, sizeof *r);
    bool ok = r && surfaces(e, x, shift_m, r, NULL);
    for (int k = 0; k < 4 && ok; k++) {
        double there_m[2] = {shift_m[0], shift_m[1]};
        there_m[k / 2] += k % 2 ? h : -h;
        ok = surfaces(e, x, there_m, r + (k + 1) * n, NULL);
    }
    for (int i = 0; ok && i < n; i++) {
        // Central differences give the slopes; sum up the normal equations.
        const double slope[2] = {(r[2 * n + i] - r[n + i]) / (2 * h), (r[4 * n + i] - r[3 * n + i]) / (2 * h)};
        for (int a = 0; a < 2; a++) {
            right[a] -= slope[a] * r[i];
            for (int b = 0; b < 2; b++) normal[a][b] += slope[a] * slope[b];
        }
    }
    free(r);
    // Solve the normal equations. A step is limited to ten pixels.
    const double det = normal[0][0] * normal[1][1] - normal[0][1] * normal[1][0];
    if (!ok || !(det > 1e-12 * normal[0][0] * normal[1][1])) return ok;
    shift_m[0] += fmin(fmax((normal[1][1] * right[0] - normal[0][1] * right[1]) / det, -10 * h), 10 * h);
    shift_m[1] += fmin(fmax((normal[0][0] * right[1] - normal[1][0] * right[0]) / det, -10 * h), 10 * h);
    return true;
}

bool kn_evidence_compare(const kn_evidence *e, const kn_exhibit *x, double shift_m[2], double *residual,
                         kn_relief_misfit misfit[KN_PRESS_MOMENTS])
{
    enum { STEPS = 3 };
    for (int i = 0; i < STEPS && e->align; i++)
        if (!align(e, x, shift_m)) return false;
    double *end = surfaces(e, x, shift_m, residual, misfit);
    if (end && e->pulled) kn_pull_compare(&e->pull, &e->press, &x->pressed, end, NULL);
    return end;
}

// Return the number of independent readings that one series is worth, n (1 - c)/(1 + c). c is the correlation of
// successive residuals. A negative correlation counts as 0.
static double worth_of(int count, const double *r)
{
    double mean = 0, whole = 0, next = 0;
    for (int i = 0; i < count; i++) mean += r[i] / count;
    for (int i = 0; i < count; i++) whole += (r[i] - mean) * (r[i] - mean);
    for (int i = 0; i + 1 < count; i++) next += (r[i] - mean) * (r[i + 1] - mean);
    const double c = whole > 0 ? fmin(fmax(next / whole, 0), 0.99) : 0;
    return count * (1 - c) / (1 + c);
}

double kn_evidence_worth(const kn_evidence *e, const double *residual)
{
    double worth = 0;
    for (int i = 0; i < e->reliefs; i++) {
        const kn_relief *r = &e->relief[i];
        if (r->points > 0) worth += worth_of(r->points, residual);
        else worth += worth_of(r->rays, residual) + worth_of(r->patches, residual + r->rays);
        residual += r->readings;
    }
    return worth + (e->pulled ? worth_of(e->pull.bins, residual) : 0);
}

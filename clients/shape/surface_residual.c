#include "clients/shape/measurement.h"
#include "core/algebra/algebra.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SUBRAYS 8 // number of subrays averaged in a ray; subrays are a quarter of a degree apart
#define ALL_RAYS (KN_SURFACE_RAYS * SUBRAYS)

static const double march = 0.25; // length of a step along a ray [pixels]
static const double exact = 1e-3; // possible error of the solver in a position, as a share of the object's height
static const double finest_step_m = 1e-6;
enum { PATCHES = 32, PATCH_LEAST = 4, LEVELS = 65534 };

void kn_surface_residual_free(kn_surface_residual *r)
{
    free(r->level);
    free(r->counts);
    free(r->patch_m);
    free(r->patch_sigma_m);
    free(r->point_m);
    memset(r, 0, sizeof *r);
}

// Compute the direction of one ray (number `ray` of `rays`) from the middle of the object.
static void direction(int ray, int rays, double way[2])
{
    const double angle = (ray + 0.5) * 2 * M_PI / rays;
    way[0] = cos(angle);
    way[1] = sin(angle);
}

static bool inside(const kn_hidden_area *b, double x_m, double y_m)
{
    return x_m > b->low_m[0] && x_m < b->high_m[0] && y_m > b->low_m[1] && y_m < b->high_m[1];
}

// ---- the measured outline

// Return whether the image shows the object at this place.
static bool seen(const kn_surface_residual *r, double x_m, double y_m)
{
    const double column = floor((x_m - r->frame.left_m) / r->frame.pixel_m + 0.5);
    const double row = floor((r->frame.top_m - y_m) / r->frame.pixel_m + 0.5);
    if (!(column >= 0 && column < r->frame.width && row >= 0 && row < r->frame.height)) return false;
    return r->level[(size_t)row * (size_t)r->frame.width + (size_t)column] > 0;
}

// Set the middle of the object, from which the rays start, to the centre of all pixels that show the object.
static void find_middle(kn_surface_residual *r)
{
    double sum[2] = {0}, count = 0;
    for (int y = 0; y < r->frame.height; y++)
        for (int x = 0; x < r->frame.width; x++) {
            if (r->level[(size_t)y * (size_t)r->frame.width + (size_t)x] == 0) continue;
            sum[0] += x, sum[1] += y, count++;
        }
    r->centre_m[0] = r->frame.left_m + sum[0] / count * r->frame.pixel_m;
    r->centre_m[1] = r->frame.top_m - sum[1] / count * r->frame.pixel_m;
}

// Step along a ray from outside to the first place where the image shows the object and at least two of the next three
// places also show it.
static double march_in(const kn_surface_residual *r, const double way[2], double from_m)
{
    const double step_m = march * r->frame.pixel_m;
    for (double at_m = from_m; at_m > 0; at_m -= step_m) {
        int more = 0;
        if (!seen(r, r->centre_m[0] + at_m * way[0], r->centre_m[1] + at_m * way[1])) continue;
        for (int i = 1; i <= 3; i++) {
            const double in_m = fmax(0, at_m - i * r->frame.pixel_m);
            more += seen(r, r->centre_m[0] + in_m * way[0], r->centre_m[1] + in_m * way[1]);
        }
        if (more >= 2) return at_m + 0.5 * step_m;
    }
    return 0;
}

// Return whether a place is at the border of the image, so that the image may cut off the outline of the object there.
static bool at_border(const kn_surface_residual *r, double x_m, double y_m)
{
    const kn_range *f = &r->frame;
    const double column = (x_m - f->left_m) / f->pixel_m, row = (f->top_m - y_m) / f->pixel_m;
    return column < 0.6 || row < 0.6 || column > f->width - 1.6 || row > f->height - 1.6;
}

// Measure the outline along all rays. A ray is compared only if each of its subrays finds an edge, and no subray ends
// at the tool or at the border of the image.
static void find_outline(kn_surface_residual *r, const kn_hidden_area *hidden)
{
    const double far_m = hypot(r->frame.width, r->frame.height) * r->frame.pixel_m;
    for (int i = 0; i < KN_SURFACE_RAYS; i++) {
        bool good = true;
        r->ray_m[i] = 0;
        for (int k = 0; k < SUBRAYS; k++) {
            double way[2];
            direction(i * SUBRAYS + k, ALL_RAYS, way);
            const double reach_m = march_in(r, way, far_m);
            const double x_m = r->centre_m[0] + reach_m * way[0], y_m = r->centre_m[1] + reach_m * way[1];
            good &= reach_m > 0 && !inside(hidden, x_m, y_m) && !at_border(r, x_m, y_m);
            r->ray_m[i] += reach_m / SUBRAYS;
        }
        r->ray_counts[i] = good;
        r->rays += good;
    }
    r->ray_sigma_m = hypot(r->frame.pixel_m / sqrt(12), exact * r->tall_m);
}

// ---- the patches of an image

// Choose the pixels whose height is compared: visible, not hidden by the tool, and inside the outline by at least two
// pixels and at least a thirtieth of the object's height.
static void choose_pixels(kn_surface_residual *r, const kn_hidden_area *hidden)
{
    const double margin_m = fmax(2 * r->frame.pixel_m, r->tall_m / 30);
    for (int y = 0; y < r->frame.height; y++)
        for (int x = 0; x < r->frame.width; x++) {
            const size_t at = (size_t)y * (size_t)r->frame.width + (size_t)x;
            const double x_m = r->frame.left_m + x * r->frame.pixel_m, y_m = r->frame.top_m - y * r->frame.pixel_m;
            const double away[2] = {x_m - r->centre_m[0], y_m - r->centre_m[1]};
            const double turn = atan2(away[1], away[0]) / (2 * M_PI) * KN_SURFACE_RAYS + KN_SURFACE_RAYS;
            const double outline_m = r->ray_m[(int)turn % KN_SURFACE_RAYS];
            r->counts[at] =
                r->level[at] > 0 && !inside(hidden, x_m, y_m) && hypot(away[0], away[1]) < outline_m - margin_m;
        }
}

// Compute the standard deviation of the independent noise of a pixel, from the median second difference along the rows
// of the image.
static bool find_noise(kn_surface_residual *r)
{
    enum { SAMPLES = 100000 };
    const size_t pixels = (size_t)r->frame.width * (size_t)r->frame.height;
    const size_t every = pixels / SAMPLES + 1;
    double *difference = malloc((pixels / every + 1) * sizeof *difference);
    int count = 0;
    if (!difference) return false;
    for (size_t at = 1; at + 1 < pixels; at += every) {
        if (!r->counts[at - 1] || !r->counts[at] || !r->counts[at + 1]) continue;
        difference[count++] = fabs(r->level[at - 1] - 2.0 * r->level[at] + r->level[at + 1]) * r->frame.step_m;
    }
    qsort(difference, (size_t)count, sizeof *difference, kn_ascending);
    const double median_m = count > 0 ? difference[count / 2] : 0;
    r->noise_m = fmax(median_m / (0.6745 * sqrt(6)), r->frame.step_m / sqrt(12));
    free(difference);
    return true;
}

typedef struct mean {
    double sum;
    int count;
} mean;

// Average those pixels of a patch that are compared and are visible in this image.
static mean mean_of(const kn_surface_residual *r, const uint16_t *level, double step_m, int patch)
{
    const int first[2] = {patch % r->across * r->side, patch / r->across * r->side};
    mean m = {0};
    for (int y = first[1]; y < first[1] + r->side && y < r->frame.height; y++)
        for (int x = first[0]; x < first[0] + r->side && x < r->frame.width; x++) {
            const size_t at = (size_t)y * (size_t)r->frame.width + (size_t)x;
            if (!r->counts[at] || level[at] == 0) continue;
            m.sum += (level[at] - 1) * step_m;
            m.count++;
        }
    return m;
}

// Divide the image into patches. A patch takes part in the comparison if at least half of
// its pixels are unmasked and visible.
static bool make_patches(kn_surface_residual *r, double extent_m)
{
    r->side = (int)fmax(PATCH_LEAST, extent_m / PATCHES / r->frame.pixel_m);
    r->across = (r->frame.width + r->side - 1) / r->side;
    r->down = (r->frame.height + r->side - 1) / r->side;
    const size_t all = (size_t)r->across * (size_t)r->down;
    r->patch_m = malloc(all * sizeof *r->patch_m);
    r->patch_sigma_m = malloc(all * sizeof *r->patch_sigma_m);
    if (!r->patch_m || !r->patch_sigma_m) return false;
    for (int i = 0; i < r->across * r->down; i++) {
        const mean m = mean_of(r, r->level, r->frame.step_m, i);
        const bool good = m.count >= r->side * r->side / 2;
        r->patch_m[i] = good ? m.sum / m.count : (double)NAN;
        if (good) r->patch_sigma_m[i] = hypot(r->noise_m / sqrt(m.count), exact * r->tall_m);
        r->patches += good;
    }
    return true;
}

// ---- check of a measured image

// Find the extent of the surface at rest.
static void box_of(const kn_model_surface *model, double low_m[3], double high_m[3])
{
    for (int k = 0; k < 3; k++) low_m[k] = INFINITY, high_m[k] = -INFINITY;
    for (int v = 0; v < model->mesh->vertex_count; v++)
        for (int k = 0; k < 3; k++) {
            low_m[k] = fmin(low_m[k], model->rest_m[v][k]);
            high_m[k] = fmax(high_m[k], model->rest_m[v][k]);
        }
}

// Check that height, extent and place of the measured object agree with the scene's object, and that enough of it is
// seen. If not, write an error to `error` and return false.
static bool fits(const kn_surface_residual *r, const double low_m[3], const double high_m[3], char *error,
                 size_t error_size)
{
    double reach_m[2] = {0}, there_m[2];
    for (int i = 0; i < KN_SURFACE_RAYS; i++) {
        double way[2];
        direction(i, KN_SURFACE_RAYS, way);
        // Along each axis, the visible extent is estimated as twice the longest reach of a ray.
        for (int k = 0; k < 2; k++) reach_m[k] = fmax(reach_m[k], 2 * fabs(r->ray_m[i] * way[k]));
    }
    for (int k = 0; k < 2; k++) there_m[k] = high_m[k] - low_m[k];
    if (r->frame.highest_m > 2 * r->tall_m)
        snprintf(error, error_size, "shows a height of %.3g mm, expected about the object's %.3g mm",
                 1e3 * r->frame.highest_m, 1e3 * r->tall_m);
    else if (reach_m[0] < 0.6 * there_m[0] || reach_m[0] > 1.8 * there_m[0] || reach_m[1] < 0.6 * there_m[1] ||
             reach_m[1] > 1.8 * there_m[1])
        snprintf(error, error_size, "shows an extent of %.3g x %.3g mm, expected about the object's %.3g x %.3g mm",
                 1e3 * reach_m[0], 1e3 * reach_m[1], 1e3 * there_m[0], 1e3 * there_m[1]);
    else if (fabs(r->centre_m[0] - 0.5 * (low_m[0] + high_m[0])) > 0.25 * there_m[0] ||
             fabs(r->centre_m[1] - 0.5 * (low_m[1] + high_m[1])) > 0.25 * there_m[1])
        snprintf(error, error_size,
                 "has its centre at %.3g, %.3g mm, expected the object's place; are --left and --top right?",
                 1e3 * r->centre_m[0], 1e3 * r->centre_m[1]);
    else if (r->rays < KN_SURFACE_RAYS / 6 || r->patches < 10)
        snprintf(error, error_size,
                 "shows %d of %d rays of the outline and %d patches of the top, expected more of the object", r->rays,
                 KN_SURFACE_RAYS, r->patches);
    else return true;
    return false;
}

bool kn_surface_residual_image(kn_surface_residual *r, const kn_range *frame, uint16_t *level,
                               const kn_model_surface *model, const kn_hidden_area *hidden, char *error,
                               size_t error_size)
{
    double low_m[3], high_m[3];
    box_of(model, low_m, high_m);
    *r = (kn_surface_residual){.frame = *frame, .level = level, .tall_m = high_m[2] - low_m[2]};
    find_middle(r);
    find_outline(r, hidden);
    r->counts = calloc((size_t)frame->width, (size_t)frame->height);
    bool ok = r->counts;
    if (ok) choose_pixels(r, hidden);
    ok = ok && find_noise(r) && make_patches(r, fmax(high_m[0] - low_m[0], high_m[1] - low_m[1]));
    r->readings = r->rays + r->patches;
    if (!ok) snprintf(error, error_size, "out of memory");
    else if (fits(r, (const double *)low_m, (const double *)high_m, error, error_size)) return true;
    kn_surface_residual_free(r);
    return false;
}

// ---- distance of a point from a triangle

static double length2(const double a[3]) { return kn_dot(a, a); }

// Find the point of the side from a to b that is nearest to p.
static void to_side(const double p[3], const double a[3], const double b[3], double near[3])
{
    double along[3], from[3];
    for (int k = 0; k < 3; k++) along[k] = b[k] - a[k], from[k] = p[k] - a[k];
    const double share = fmin(fmax(kn_dot(from, along) / fmax(length2(along), 1e-30), 0), 1);
    for (int k = 0; k < 3; k++) near[k] = a[k] + share * along[k];
}

// Find the point of a triangle that is nearest to p. Project p onto the plane of the triangle. If the projected point
// is inside the triangle, it is the result. Otherwise the result is the nearest point on the three sides. `normal` need
// not have the length 1.
static void to_triangle(const double p[3], const double corner[3][3], const double normal[3], double near[3])
{
    double from[3], foot[3], best = INFINITY;
    for (int k = 0; k < 3; k++) from[k] = p[k] - corner[0][k];
    const double height = kn_dot(from, normal) / fmax(length2(normal), 1e-30);
    bool on_face = true;
    for (int k = 0; k < 3; k++) foot[k] = p[k] - height * normal[k];
    for (int e = 0; e < 3; e++) {
        const double *a = corner[e], *b = corner[(e + 1) % 3];
        double along[3], to[3], turn[3];
        for (int k = 0; k < 3; k++) along[k] = b[k] - a[k], to[k] = foot[k] - a[k];
        kn_cross(along, to, turn);
        on_face &= kn_dot(turn, normal) >= 0;
    }
    for (int k = 0; on_face && k < 3; k++) near[k] = foot[k];
    for (int e = 0; !on_face && e < 3; e++) {
        double here[3], away[3];
        to_side(p, corner[e], corner[(e + 1) % 3], here);
        for (int k = 0; k < 3; k++) away[k] = p[k] - here[k];
        if (length2(away) >= best) continue;
        best = length2(away);
        for (int k = 0; k < 3; k++) near[k] = here[k];
    }
}

double kn_surface_residual_distance(const double p[3], const float (*now_m)[3], int triangles, const int (*triangle)[3])
{
    double best2 = INFINITY, square = 0, sign = 1;
    for (int t = 0; t < triangles; t++) {
        double corner[3][3], u[3], v[3], normal[3], near[3] = {0}, away[3];
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++) corner[c][k] = now_m[triangle[t][c]][k];
        for (int k = 0; k < 3; k++) u[k] = corner[1][k] - corner[0][k], v[k] = corner[2][k] - corner[0][k];
        kn_cross(u, v, normal);
        to_triangle(p, (const double(*)[3])corner, normal, near);
        for (int k = 0; k < 3; k++) away[k] = p[k] - near[k];
        const double far2 = length2(away), over = kn_dot(away, normal) / sqrt(fmax(length2(normal), 1e-60));
        const bool nearer = far2 < best2 * (1 - 1e-9), as_near = far2 <= best2 * (1 + 1e-9) && fabs(over) > square;
        if (!(nearer || as_near)) continue;
        best2 = fmin(far2, best2);
        square = fabs(over);
        sign = over < 0 ? -1 : 1;
    }
    return sign * sqrt(best2);
}

// ---- the model's outline and heights

typedef struct outline {
    const double *centre_m;
    double reach_m[ALL_RAYS];
} outline;

// Extend the rays that cross the edge from `a` to `b` of a triangle, so that each reaches at least to this edge. The
// angle of such a ray lies between the angles of the two ends of the edge.
static void sweep(outline *o, const float a[3], const float b[3])
{
    double p[2] = {a[0] - o->centre_m[0], a[1] - o->centre_m[1]}, q[2] = {b[0] - o->centre_m[0], b[1] - o->centre_m[1]};
    double turn = p[0] * q[1] - p[1] * q[0];
    if (!isfinite(turn) || turn == 0) return;
    if (turn < 0) { // the edge runs clockwise, so exchange its ends
        const double other[2] = {p[0], p[1]};
        memcpy(p, q, sizeof p);
        memcpy(q, other, sizeof q);
        turn = -turn;
    }
    double from = atan2(p[1], p[0]), to = atan2(q[1], q[0]);
    if (to < from) to += 2 * M_PI;
    const double unit = 2 * M_PI / ALL_RAYS;
    for (int k = (int)ceil(from / unit - 0.5); (k + 0.5) * unit <= to; k++) {
        const double way[2] = {cos((k + 0.5) * unit), sin((k + 0.5) * unit)};
        // The ray meets the edge at the distance turn/across from the middle.
        const double across = way[0] * (q[1] - p[1]) - way[1] * (q[0] - p[0]);
        double *reach_m = &o->reach_m[((k % ALL_RAYS) + ALL_RAYS) % ALL_RAYS];
        if (across > 0) *reach_m = fmax(*reach_m, turn / across);
    }
}

// Compute the largest distance by which the ends of rays lie outside the sides of the object at rest, along x and
// along y. For each axis use only compared rays whose direction is mostly along this axis.
static void bulge_of(const kn_surface_residual *r, const double centre_m[2], const double *ray_m, const double low_m[3],
                     const double high_m[3], double bulge_m[2])
{
    for (int k = 0; k < 2; k++) bulge_m[k] = (double)NAN;
    for (int i = 0; i < KN_SURFACE_RAYS; i++) {
        double way[2];
        if (!r->ray_counts[i]) continue;
        direction(i, KN_SURFACE_RAYS, way);
        for (int k = 0; k < 2; k++) {
            const double at_m = centre_m[k] + ray_m[i] * way[k];
            if (fabs(way[k]) > M_SQRT1_2) bulge_m[k] = fmax(bulge_m[k], fmax(at_m - high_m[k], low_m[k] - at_m));
        }
    }
}

// Find the model's outline by sweeping over all edges of the triangles. Compare it with the measured outline along the
// rays that are not left out.
static double *compare_outline(const kn_surface_residual *r, const double centre_m[2], const kn_surface *mesh,
                               const float (*now_m)[3], double ray_m[KN_SURFACE_RAYS], double *residual,
                               double *squares)
{
    outline o = {.centre_m = centre_m};
    for (const int *t = mesh->triangle; t < mesh->triangle + 3 * mesh->triangle_count; t += 3)
        for (int e = 0; e < 3; e++) sweep(&o, now_m[t[e]], now_m[t[(e + 1) % 3]]);
    for (int i = 0; i < KN_SURFACE_RAYS; i++) {
        ray_m[i] = 0;
        for (int k = 0; k < SUBRAYS; k++) ray_m[i] += o.reach_m[i * SUBRAYS + k] / SUBRAYS;
        if (!r->ray_counts[i]) continue;
        const double off_m = ray_m[i] - r->ray_m[i];
        *squares += off_m * off_m;
        *residual++ = off_m / r->ray_sigma_m;
    }
    return residual;
}

// Draw the model's range image in the shifted frame, and compare the mean heights of the patches.
static bool compare_heights(const kn_surface_residual *r, const double shift_m[2], const kn_surface *mesh,
                            const float (*now_m)[3], double *residual, double *squares)
{
    kn_range frame = r->frame;
    uint16_t *level = malloc((size_t)frame.width * (size_t)frame.height * sizeof *level);
    if (!level) return false;
    frame.left_m += shift_m[0];
    frame.top_m += shift_m[1];
    // Choose the height step so that the 16 bits cover three times the object's height.
    frame.step_m = fmax(finest_step_m, 3 * r->tall_m / LEVELS);
    kn_range_draw(&frame, now_m, mesh->triangle_count, (const int(*)[3])mesh->triangle, level);
    for (int i = 0; i < r->across * r->down; i++) {
        if (isnan(r->patch_m[i])) continue;
        // If the model shows no pixel of the patch, the residual is 0: the outline already contains that difference.
        const mean m = mean_of(r, level, frame.step_m, i);
        const double off_m = m.count > 0 ? m.sum / m.count - r->patch_m[i] : 0;
        *squares += off_m * off_m;
        *residual++ = off_m / r->patch_sigma_m[i];
    }
    free(level);
    return true;
}

bool kn_surface_residual_compare(const kn_surface_residual *r, const double shift_m[2], const kn_model_surface *model,
                                 const float (*now_m)[3], double *residual, kn_surface_misfit *misfit)
{
    const kn_surface *mesh = model->mesh;
    double squares[2] = {0}, ray_m[KN_SURFACE_RAYS], low_m[3], high_m[3];
    const double centre_m[2] = {r->centre_m[0] + shift_m[0], r->centre_m[1] + shift_m[1]};
    // If points were measured, compare only their distances from the model.
    if (r->points > 0) {
        for (int i = 0; i < r->points; i++) {
            const double off_m = -kn_surface_residual_distance(r->point_m[i], now_m, mesh->triangle_count,
                                                               (const int(*)[3])mesh->triangle);
            squares[0] += off_m * off_m;
            residual[i] = off_m / r->point_sigma_m;
        }
        if (misfit)
            *misfit = (kn_surface_misfit){
                sqrt(squares[0] / r->points), (double)NAN, {{(double)NAN, (double)NAN}, {(double)NAN, (double)NAN}}};
        return true;
    }
    residual = compare_outline(r, centre_m, mesh, now_m, ray_m, residual, &squares[1]);
    if (!compare_heights(r, shift_m, mesh, now_m, residual, &squares[0])) return false;
    if (!misfit) return true;
    misfit->height_m = sqrt(squares[0] / r->patches);
    misfit->outline_m = sqrt(squares[1] / r->rays);
    box_of(model, low_m, high_m);
    bulge_of(r, centre_m, r->ray_m, (const double *)low_m, (const double *)high_m, misfit->bulge_m[0]);
    bulge_of(r, centre_m, ray_m, (const double *)low_m, (const double *)high_m, misfit->bulge_m[1]);
    return true;
}

// ---- measured points

bool kn_surface_residual_points(kn_surface_residual *r, int count, double (*point_m)[3], const kn_model_surface *model,
                                const kn_hidden_area *hidden, char *error, size_t error_size)
{
    double low_m[3], high_m[3];
    int kept = 0, far = 0;
    box_of(model, low_m, high_m);
    *r = (kn_surface_residual){.point_m = point_m, .tall_m = high_m[2] - low_m[2]};
    r->point_sigma_m = 0.01 * r->tall_m;
    for (int i = 0; i < count; i++) {
        bool near = true;
        // Points farther from the object than its height belong to something else.
        for (int k = 0; k < 3; k++)
            near &= point_m[i][k] > low_m[k] - r->tall_m && point_m[i][k] < high_m[k] + r->tall_m;
        far += !near;
        if (near && point_m[i][2] > 0 && !inside(hidden, point_m[i][0], point_m[i][1]))
            memmove(point_m[kept++], point_m[i], sizeof *point_m);
    }
    // Keep every n-th point, so that at most KN_SURFACE_POINTS points remain.
    const int every = (kept + KN_SURFACE_POINTS - 1) / KN_SURFACE_POINTS;
    for (int i = 0; every > 0 && i < kept; i += every) memmove(point_m[r->points++], point_m[i], sizeof *point_m);
    r->readings = r->points;
    if (r->points >= 20 && far <= count / 2) return true;
    if (far > count / 2)
        snprintf(error, error_size,
                 "%d of %d points are farther from the object than its height, "
                 "expected points on its surface, in the scene's frame",
                 far, count);
    else
        snprintf(error, error_size, "%d points on the surface that the tool does not hide, expected 20 or more",
                 r->points);
    kn_surface_residual_free(r);
    return false;
}

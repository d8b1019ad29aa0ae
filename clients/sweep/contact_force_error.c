#include "clients/sweep/replay_trace.h"
#include <complex.h>
#include <math.h>

#define TICK_S 1e-3
#define BAND_HZ 8.0 // lower end of the frequency band around 10 Hz in which the lag is computed
#define BAND_WIDTH_HZ 4.0
// Least energy in the frequency band, as a share of the largest energy that one frequency can have. If the energy is
// smaller, no lag is computed.
#define BAND_FLOOR 1e-6
enum { BAND_POINTS = 17 };

static double squares(const double v[3]) { return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; }

static double squared_distance(const double a[3], const double b[3])
{
    return squares((double[3]){a[0] - b[0], a[1] - b[1], a[2] - b[2]});
}

// Return the relative Euclidean distance sqrt(difference / size) from two sums of squares. Return NAN if `size` is 0.
static double ratio(double difference, double size) { return size > 0 ? sqrt(difference / size) : NAN; }

// Return the relative Euclidean distance between n vectors in a and those in b.
static double relative(const double (*a)[3], const double (*b)[3], int64_t n)
{
    double difference = 0, size = 0;
    for (int64_t i = 0; i < n; i++) {
        difference += squared_distance(a[i], b[i]);
        size += squares(b[i]);
    }
    return ratio(difference, size);
}

double kn_contact_force_error(const kn_replay_trace *a, const kn_replay_trace *b)
{
    if (a->ticks != b->ticks || a->probes != b->probes) return NAN;
    return relative((const double(*)[3])a->force_n, (const double(*)[3])b->force_n, a->ticks * a->probes);
}

double kn_contact_force_factor(const kn_replay_trace *a, const kn_replay_trace *b, double *left)
{
    double both = 0, size = 0, other = 0;
    *left = NAN;
    if (a->ticks != b->ticks || a->probes != b->probes) return NAN;
    for (int64_t i = 0; i < a->ticks * a->probes; i++) {
        for (int k = 0; k < 3; k++) both += a->force_n[i][k] * b->force_n[i][k];
        size += squares(a->force_n[i]), other += squares(b->force_n[i]);
    }
    if (!(size > 0)) return NAN;
    *left = ratio(fmax(other - both * both / size, 0), other);
    return both / size;
}

// ---- shape

// Find the index of the cell that contains the coordinate `place` along one axis. `place` is the distance from the
// first of the n nodes, in node spacings. `*in` becomes the position within the cell, 0 to 1.
static int64_t cell_of(double place, int64_t n, double *in)
{
    int64_t cell = (int64_t)floor(place);
    if (cell > n - 2) cell = n - 2;
    if (cell < 0) cell = 0;
    *in = n > 1 ? place - (double)cell : 0;
    return cell;
}

// Interpolate the displacement of `b` (trilinear) at the place of one node of `a`.
static void interpolate(const kn_replay_trace *b, const kn_replay_trace *a, const int64_t node[3], double u_m[3])
{
    int64_t cell[3];
    double in[3];
    // Find the cell of `b` that contains the node.
    for (int k = 0; k < 3; k++) cell[k] = cell_of((double)node[k] * a->spacing_m / b->spacing_m, b->grid[k], &in[k]);
    u_m[0] = u_m[1] = u_m[2] = 0;
    // Add the weighted displacements at the corners of the cell. A lattice that is one node wide has a single layer of
    // corners.
    for (int corner = 0; corner < 8; corner++) {
        int64_t at[3];
        double weight = 1;
        for (int k = 0; k < 3; k++) {
            int up = corner >> k & 1;
            weight *= up ? in[k] : 1 - in[k];
            at[k] = b->grid[k] > 1 ? cell[k] + up : 0;
        }
        const double *u = b->shape_m[(at[2] * b->grid[1] + at[1]) * b->grid[0] + at[0]];
        for (int k = 0; k < 3; k++) u_m[k] += weight * u[k];
    }
}

// Compare the shapes of blocks with different lattices at the nodes of `a`.
static double shape_between(const kn_replay_trace *a, const kn_replay_trace *b)
{
    double difference = 0, size = 0, u_m[3];
    int64_t node[3], n = 0;
    for (node[2] = 0; node[2] < a->grid[2]; node[2]++)
        for (node[1] = 0; node[1] < a->grid[1]; node[1]++)
            for (node[0] = 0; node[0] < a->grid[0]; node[0]++, n++) {
                interpolate(b, a, node, u_m);
                difference += squared_distance(a->shape_m[n], u_m);
                size += squares(u_m);
            }
    return ratio(difference, size);
}

double kn_contact_shape_error(const kn_replay_trace *a, const kn_replay_trace *b)
{
    bool same = a->nodes == b->nodes;
    for (int k = 0; k < 3; k++) same &= a->grid[k] == b->grid[k];
    // Two meshes with different nodes cannot be compared, but two blocks with different lattices can.
    if (!same) return a->grid[0] && b->grid[0] ? shape_between(a, b) : NAN;
    return relative((const double(*)[3])a->shape_m, (const double(*)[3])b->shape_m, a->nodes);
}

// ---- differences that a hand would notice

double kn_contact_force_peak(const kn_replay_trace *t)
{
    double most = 0;
    for (int64_t i = 0; i < t->ticks * t->probes; i++) most = fmax(most, squares(t->force_n[i]));
    return sqrt(most);
}

double kn_contact_force_jump(const kn_replay_trace *t)
{
    double most = 0;
    for (int64_t i = t->probes; i < t->ticks * t->probes; i++)
        most = fmax(most, squared_distance(t->force_n[i], t->force_n[i - t->probes]));
    return sqrt(most);
}

double kn_contact_force_variation(const kn_replay_trace *t)
{
    double sum = 0;
    for (int64_t i = t->probes; i < t->ticks * t->probes; i++)
        sum += sqrt(squared_distance(t->force_n[i], t->force_n[i - t->probes]));
    return sum;
}

double kn_contact_depth(const kn_replay_trace *t)
{
    double deepest = 0;
    for (int64_t i = 0; i < t->nodes; i++) deepest = fmax(deepest, -t->shape_m[i][2]);
    return deepest;
}

// Return the Fourier transform of one component of one tool's force at a frequency. At each tick a phasor is multiplied
// by a constant, so that only one exponential has to be computed.
static double complex spectrum(const kn_replay_trace *t, int64_t first, int component, double hz)
{
    double complex sum = 0, phasor = 1, turn = cexp(-2 * M_PI * I * hz * TICK_S);
    for (int64_t i = first; i < t->ticks * t->probes; i += t->probes) {
        sum += t->force_n[i][component] * phasor;
        phasor *= turn;
    }
    return sum;
}

double kn_contact_force_lag(const kn_replay_trace *a, const kn_replay_trace *b)
{
    double complex cross = 0;
    double energy = 0, mean_hz = 0, all = 0;
    if (a->ticks != b->ticks || a->probes != b->probes) return NAN;
    // Sum the cross spectrum over frequencies, tools and force components, so that large components have more weight.
    for (int f = 0; f < BAND_POINTS; f++)
        for (int64_t c = 0; c < 3 * b->probes; c++) {
            double hz = BAND_HZ + BAND_WIDTH_HZ * f / (BAND_POINTS - 1);
            double complex x = spectrum(a, c / 3, (int)(c % 3), hz), y = spectrum(b, c / 3, (int)(c % 3), hz);
            double size = creal(y * conj(y));
            cross += x * conj(y);
            energy += size;
            mean_hz += hz * size;
        }
    for (int64_t i = 0; i < b->ticks * b->probes; i++) all += squares(b->force_n[i]);
    // By the Cauchy-Schwarz inequality the energy at one frequency is at most `ticks` * `all`, where `all` is the sum
    // of the squared forces. Return NAN if the energy in the band is too small a share of this limit.
    if (!(energy > BAND_FLOOR * all * (double)b->ticks)) return NAN;
    return -carg(cross) / (2 * M_PI * mean_hz / energy);
}

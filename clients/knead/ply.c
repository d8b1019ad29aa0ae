#include "clients/knead/ply.h"
#include "clients/viewer/label.h"
#include "core/algebra.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct __attribute__((packed)) vertex { // one vertex in the layout that the header of the PLY file declares
    float xyz[3], normal[3], quality;
    uint8_t rgb[3];
} vertex;

typedef struct __attribute__((packed)) face {
    uint8_t count;
    int32_t vertex[3];
} face;

// Add the contribution of one corner of a triangle to the normal of the corner's vertex: the triangle's unit normal
// times the corner's angle. The weighting makes the result independent of how a quad is cut into triangles.
static void add_corner(const float at[3], const float next[3], const float last[3], float normal[3])
{
    double a[3], b[3], across[3];
    for (int k = 0; k < 3; k++) {
        a[k] = (double)next[k] - (double)at[k];
        b[k] = (double)last[k] - (double)at[k];
    }
    kn_cross(a, b, across);
    const double size = sqrt(kn_dot(across, across)), angle = atan2(size, kn_dot(a, b));
    for (int k = 0; k < 3 && size > 0; k++) normal[k] += (float)(angle * across[k] / size);
}

// Compute unit normals of all vertices. A vertex without triangles gets 0.
static void add_normals(const kn_still *s, vertex *v)
{
    for (int t = 0; t < s->triangle_count; t++)
        for (int i = 0; i < 3; i++) {
            const int *c = s->triangle[t], at = c[i];
            float normal[3]; // a copy: members of a packed struct cannot be passed by pointer
            memcpy(normal, v[at].normal, sizeof normal);
            add_corner(s->now[at], s->now[c[(i + 1) % 3]], s->now[c[(i + 2) % 3]], normal);
            memcpy(v[at].normal, normal, sizeof normal);
        }
    // Scale the summed normal of each vertex to unit length.
    for (int i = 0; i < s->vertex_count; i++) {
        float n[3];
        memcpy(n, v[i].normal, sizeof n);
        const float length = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (int k = 0; k < 3 && length > 0; k++) v[i].normal[k] = n[k] / length;
    }
}

bool kn_ply_write(FILE *f, const kn_still *s, kn_measure what, double top, const char *about)
{
    const kn_measure_name *name = &kn_measure_names[what];
    vertex *v = calloc((size_t)s->vertex_count + 1, sizeof *v);
    if (!v) return false;
    // Fill in position, value of the measure and colour of every vertex.
    for (int i = 0; i < s->vertex_count; i++) {
        float srgb[3];
        memcpy(v[i].xyz, s->now[i], sizeof v[i].xyz);
        v[i].quality = s->value[i];
        kn_scale_at((double)s->value[i] / top, srgb);
        for (int k = 0; k < 3; k++) v[i].rgb[k] = (uint8_t)lroundf(255 * srgb[k]);
    }
    add_normals(s, v);
    fprintf(f,
            "ply\nformat binary_little_endian 1.0\ncomment knead: %s; metres\ncomment quality: %s%s%s, colours to %g\n",
            about, name->words, *name->unit ? ", " : "", name->unit, top);
    fprintf(f,
            "element vertex %d\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n"
            "property float ny\nproperty float nz\nproperty float quality\nproperty uchar red\n"
            "property uchar green\nproperty uchar blue\nelement face %d\n"
            "property list uchar int vertex_indices\nend_header\n",
            s->vertex_count, s->triangle_count);
    fwrite(v, sizeof *v, (size_t)s->vertex_count, f);
    // The faces follow the vertices: a count and three indices each.
    for (int t = 0; t < s->triangle_count; t++) {
        face c = {.count = 3};
        memcpy(c.vertex, s->triangle[t], sizeof c.vertex);
        fwrite(&c, sizeof c, 1, f);
    }
    free(v);
    return true;
}

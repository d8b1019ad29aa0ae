#include "core/outside.h"
#include "core/vec.h"

#include <math.h>
#include <stdlib.h>

// Return the reason why a box or cross is too small or too round, or NULL.
static const char *unfit_box(const kn_probe_def *p, double spacing_m)
{
    for (int k = 0; k < 3; k++)
        if (!(p->size_m[k] > 2 * p->edge_m && p->edge_m >= 0 && isfinite(p->size_m[k])))
            return "a box's sizes must be positive and more than twice the radius of its edges";
    for (int k = 0; k < 3; k++)
        if (p->size_m[k] < spacing_m) return "a box must be at least a lattice spacing wide and high";
    return NULL;
}

// Refuse a shape smaller than the lattice's spacing, because it would fall between the nodes.
const char *kn_outside_unfit(const kn_probe_def *p, double spacing_m)
{
    const bool cylinder = p->shape == KN_PROBE_CYLINDER, long_one = cylinder || p->shape == KN_PROBE_CAPSULE;
    if (p->shape == KN_PROBE_BOX || p->shape == KN_PROBE_CROSS) return unfit_box(p, spacing_m);
    const bool of_parts = p->shape == KN_PROBE_UNION || p->shape == KN_PROBE_MESH;
    if (of_parts && !p->parts) return "a union or mesh needs its parts";
    if (of_parts && !(2 * p->parts->fine_m >= spacing_m))
        return "every part of a tool must be at least a lattice spacing wide and high";
    if (long_one && !(p->length_m > 0 && isfinite(p->length_m))) return "a capsule or cylinder needs a positive length";
    if (cylinder && !(p->edge_m >= 0 && p->edge_m <= p->radius_m && 2 * p->edge_m <= p->length_m))
        return "a cylinder's edges must not be rounder than it is wide or long";
    if (p->shape == KN_PROBE_PLATE && !(p->size_m[0] > 0 && p->size_m[1] > 0 && isfinite(p->size_m[0] + p->size_m[1])))
        return "a plate needs two positive sizes";
    if ((long_one || p->shape == KN_PROBE_SPHERE) && !(p->radius_m >= spacing_m && isfinite(p->radius_m)))
        return "a tool's radius must be at least the lattice spacing, or it falls between the nodes";
    return NULL;
}

// Add the two boxes of a cross.
static bool add_cross(kn_shape *shape, const kn_probe_def *def)
{
    const double along[3] = {def->size_m[0], def->size_m[1], def->size_m[2]};
    const double across[3] = {def->size_m[1], def->size_m[0], def->size_m[2]};
    const kn_solid arms[2] = {kn_solid_box(along, def->edge_m), kn_solid_box(across, def->edge_m)};
    return kn_shape_add(shape, &arms[0]) && kn_shape_add(shape, &arms[1]);
}

bool kn_outside_shape(const kn_probe_def *def, kn_shape *shape)
{
    kn_solid part;
    switch (def->shape) {
    case KN_PROBE_PLATE: return true;
    case KN_PROBE_CROSS: return add_cross(shape, def);
    case KN_PROBE_UNION:
    case KN_PROBE_MESH: return *shape = *def->parts, true;
    case KN_PROBE_SPHERE: part = kn_solid_sphere(def->radius_m); break;
    case KN_PROBE_CAPSULE: part = kn_solid_capsule(def->radius_m, def->length_m); break;
    case KN_PROBE_CYLINDER: part = kn_solid_cylinder(def->radius_m, def->length_m, def->edge_m); break;
    default: part = kn_solid_box(def->size_m, def->edge_m);
    }
    return kn_shape_add(shape, &part);
}

// Compute the area that every node of a block's outside stands for. A node on an edge or corner belongs to several
// faces. It stands for its part of the largest of them, because the object may lie on that face.
static void face_areas(const kn_model *m, double *area)
{
    for (int f = 0; f < m->outside_count; f++) {
        const kn_face *face = &m->face[f];
        for (int v = 0; v < face->len[1]; v++)
            for (int u = 0; u < face->len[0]; u++) {
                double share = face->spacing_m * face->spacing_m;
                if (m->grid.flat) share *= m->grid.depth_m / face->spacing_m;
                // a node at the rim of a face has half of the area of an inner one
                if (face->len[0] > 1 && (u == 0 || u == face->len[0] - 1)) share *= 0.5;
                if (face->len[1] > 1 && (v == 0 || v == face->len[1] - 1)) share *= 0.5;
                int node = face->origin + u * face->step[0] + v * face->step[1];
                area[node] = fmax(area[node], share);
            }
    }
}

double kn_outside_area(const kn_model *m, const int node[3])
{
    double u[3], v[3], n[3];
    for (int k = 0; k < 3; k++) {
        u[k] = m->rest_m[node[1]][k] - m->rest_m[node[0]][k];
        v[k] = m->rest_m[node[2]][k] - m->rest_m[node[0]][k];
    }
    kn_cross(u, v, n);
    return 0.5 * sqrt(kn_dot(n, n));
}

// Compute the area that every node of a net's outside stands for: a third of each of its triangles.
static void skin_areas(const kn_model *m, double *area)
{
    for (int t = 0; t < m->skin_count; t++)
        for (int c = 0; c < 3; c++) area[m->skin[t][c]] += kn_outside_area(m, m->skin[t]) / 3;
}

// List the nodes that the table can push, with their areas.
static bool build_base(kn_model *m)
{
    double *area = calloc((size_t)m->node_count, sizeof *area);
    if (!area) return false;
    if (m->skin_count > 0) skin_areas(m, area);
    else face_areas(m, area);
    for (int i = 0; i < m->node_count; i++) {
        if (m->support[i] & 4) area[i] = 0; // the support already holds it on the table
        m->base_count += area[i] > 0;
    }
    m->base = calloc((size_t)m->base_count + 1, sizeof *m->base);
    m->base_area_m2 = calloc((size_t)m->base_count + 1, sizeof *m->base_area_m2);
    for (int i = 0, at = 0; m->base && m->base_area_m2 && i < m->node_count; i++) {
        if (!(area[i] > 0)) continue;
        m->base[at] = i;
        m->base_area_m2[at++] = area[i];
    }
    free(area);
    return m->base && m->base_area_m2;
}

bool kn_outside_build(kn_model *model)
{
    model->shape = calloc(KN_PROBES_MAX, sizeof *model->shape);
    if (!model->shape) return false;
    bool table = model->def.support == KN_SUPPORT_FRICTION;
    for (int p = 0; p < model->def.probe_count; p++) {
        kn_outside_shape(&model->def.probe[p], &model->shape[p]);
        // a coupled tool may drive the object against the table, whatever the support: the table must stop it
        table |= model->def.probe[p].coupling_n_m > 0 && model->def.support != KN_SUPPORT_NONE;
    }
    return !table || build_base(model);
}

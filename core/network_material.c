// Conversion of the papers' material to an element of the bench, and back.
#include "core/network.h"

static kn_network from_text(const char *text)
{
    kn_network net = {0};
    char error[64];
    kn_element_parse(&net.element, text, error, sizeof error); // always one of the texts below
    return net;
}

kn_network kn_network_of(const kn_material *mat)
{
    static const char *const text[2][4] = {{"", "s", "d", "s|d"}, {"", "s-d", "d-d", "(s|d)-d"}};
    double in, out;
    bool damper = !kn_material_stroke(mat, &in, &out);
    kn_network net = from_text(text[damper][(mat->k1_pa > 0) + 2 * (mat->c1_pa_s > 0)]);
    int at = 0;
    if (mat->k1_pa > 0) net.part[at++].modulus = mat->k1_pa;
    if (mat->c1_pa_s > 0) net.part[at++].modulus = mat->c1_pa_s;
    if (!damper) return net;
    if (mat->damper == KN_DAMPER_CONSTANT) net.part[at].modulus = mat->c2_pa_s;
    if (mat->damper == KN_DAMPER_EXPONENTIAL)
        net.part[at] = (kn_part){
            .modulus = mat->alpha_pa_s, .beta_per_pa = mat->beta_per_pa, .p0_pa = mat->p0_pa, .p1_pa = mat->p1_pa};
    if (mat->damper == KN_DAMPER_RAMP)
        net.part[at] = (kn_part){
            .modulus = mat->c_max_pa_s, .p0_pa = mat->p0_pa, .p1_pa = mat->p1_pa, .c_min_pa_s = mat->c_min_pa_s};
    net.part[at].stroke = mat->stroke[1] > 0;
    // compression is positive on the bench: the stops change sign and place
    if (net.part[at].stroke) net.part[at].stop[0] = -out, net.part[at].stop[1] = -in;
    return net;
}

static void set_damper(kn_material *mat, const kn_part *p)
{
    mat->damper = p->beta_per_pa > 0 ? KN_DAMPER_EXPONENTIAL : p->c_min_pa_s > 0 ? KN_DAMPER_RAMP : KN_DAMPER_CONSTANT;
    mat->c2_pa_s = mat->alpha_pa_s = p->modulus;
    mat->beta_per_pa = p->beta_per_pa;
    mat->p0_pa = p->p0_pa;
    mat->p1_pa = p->p1_pa;
    mat->c_max_pa_s = p->modulus;
    mat->c_min_pa_s = p->c_min_pa_s;
}

// Take a spring as k1 or a linear damper as c1. Return false if the material already has such a part.
static bool take_voigt(const kn_network *net, const kn_element_node *n, kn_material *mat)
{
    double *to = n->kind == KN_ELEMENT_SPRING ? &mat->k1_pa : &mat->c1_pa_s;
    if (n->kind >= KN_ELEMENT_SERIES || *to > 0 || kn_part_thins(&net->part[n->leaf])) return false;
    *to = net->part[n->leaf].modulus;
    return true;
}

// Take a spring, a linear damper, or both side by side.
static bool take_part(const kn_network *net, int node, kn_material *mat)
{
    const kn_element_node *n = &net->element.node[node];
    if (n->kind != KN_ELEMENT_PARALLEL) return take_voigt(net, n, mat);
    for (int i = 0; i < n->count; i++)
        if (!take_voigt(net, &net->element.node[n->child[i]], mat)) return false;
    return true;
}

bool kn_network_material(const kn_network *net, kn_material *mat)
{
    const kn_element *e = &net->element;
    const kn_element_node *n = &e->node[e->root];
    *mat = (kn_material){.damper = KN_DAMPER_NONE};
    if (n->kind != KN_ELEMENT_SERIES) return take_part(net, e->root, mat);
    if (n->count != 2) return false;
    // choose as c2 the last of the two members that is a damper and leaves a Voigt element as the rest
    for (int last = 1; last >= 0; last--) {
        const kn_element_node *d = &e->node[n->child[last]];
        *mat = (kn_material){.damper = KN_DAMPER_NONE};
        if (d->kind != KN_ELEMENT_DAMPER || !take_part(net, n->child[!last], mat)) continue;
        set_damper(mat, &net->part[d->leaf]);
        return true;
    }
    return false;
}

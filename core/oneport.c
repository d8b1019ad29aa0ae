#include "core/oneport.h"

#include <complex.h>
#include <stdint.h>
#include <string.h>

// ---- polynomials in p and their derivatives with respect to every parameter, in integers modulo a prime

#define PRIME UINT64_C(2147483647) // 2^31 - 1: a product fits 64 bits, and a rank is wrong with a probability of 1e-8

// A coefficient is a dual number: entry 0 is its value, entry 1 + i its derivative with respect to leaf i.
enum { TERMS = KN_ELEMENT_MAX + 1, DUALS = KN_ELEMENT_MAX + 1 };

typedef struct poly {
    int degree; // degree of the polynomial; -1: the polynomial is zero
    uint64_t c[TERMS][DUALS];
} poly;

typedef struct ratio {
    poly n, d;
} ratio;

static uint64_t times(uint64_t a, uint64_t b) { return a * b % PRIME; }

// Add the product of the polynomials a and b to f, derivatives included.
static void accumulate(poly *f, const poly *a, const poly *b)
{
    for (int i = 0; i <= a->degree; i++)
        for (int j = 0; j <= b->degree; j++) {
            uint64_t *to = f->c[i + j];
            const uint64_t *x = a->c[i], *y = b->c[j];
            to[0] = (to[0] + times(x[0], y[0])) % PRIME;
            for (int k = 1; k < DUALS; k++) to[k] = (to[k] + times(x[0], y[k]) + times(x[k], y[0])) % PRIME;
        }
    if (a->degree >= 0 && b->degree >= 0 && a->degree + b->degree > f->degree) f->degree = a->degree + b->degree;
}

// Cancel the factor p in numerator and denominator. If no parameter occurs twice, there is no other common factor.
static void cancel(ratio *z)
{
    while (z->n.c[0][0] == 0 && z->d.c[0][0] == 0) {
        memmove(z->n.c, z->n.c + 1, sizeof z->n.c - sizeof *z->n.c);
        memmove(z->d.c, z->d.c + 1, sizeof z->d.c - sizeof *z->d.c);
        memset(z->n.c[TERMS - 1], 0, sizeof *z->n.c);
        memset(z->d.c[TERMS - 1], 0, sizeof *z->d.c);
        z->n.degree--;
        z->d.degree--;
    }
}

// Connect a second element to z, in series or in parallel.
static void connect(ratio *z, const ratio *with, kn_element_kind kind)
{
    ratio sum = {.n.degree = -1, .d.degree = -1};
    poly *cross = kind == KN_ELEMENT_SERIES ? &sum.d : &sum.n;
    accumulate(cross, &z->n, &with->d);
    accumulate(cross, &with->n, &z->d);
    if (kind == KN_ELEMENT_SERIES) accumulate(&sum.n, &z->n, &with->n);
    else accumulate(&sum.d, &z->d, &with->d);
    cancel(&sum);
    *z = sum;
}

// Compute Z of the tree under a node, with an arbitrary fixed value for each leaf.
static void impedance(const kn_element *e, int node, ratio *z)
{
    const kn_element_node *g = &e->node[node];
    // a leaf: numerator k or c p, denominator 1
    if (g->kind < KN_ELEMENT_SERIES) {
        int power = g->kind == KN_ELEMENT_DAMPER;
        *z = (ratio){.n.degree = power, .d.degree = 0};
        z->d.c[0][0] = 1;
        z->n.c[power][0] = (UINT64_C(48271) * (uint64_t)(g->leaf + 1) * (uint64_t)(g->leaf + 7919)) % PRIME;
        z->n.c[power][1 + g->leaf] = 1;
        return;
    }
    impedance(e, g->child[0], z);
    for (int i = 1; i < g->count; i++) {
        ratio next;
        impedance(e, g->child[i], &next);
        connect(z, &next, g->kind);
    }
}

// ---- rank

// Return 1/a, which is a^(PRIME - 2) modulo the prime.
static uint64_t inverse(uint64_t a)
{
    uint64_t result = 1;
    for (uint64_t power = PRIME - 2; power; power >>= 1, a = times(a, a))
        if (power & 1) result = times(result, a);
    return result;
}

// Return the rank of a matrix modulo the prime, by Gaussian elimination.
static int rank(uint64_t (*row)[2 * TERMS], int rows)
{
    int found = 0;
    for (int column = 0; column < 2 * TERMS && found < rows; column++) {
        int pivot = found;
        while (pivot < rows && row[pivot][column] == 0) pivot++;
        if (pivot == rows) continue;
        uint64_t spare[2 * TERMS];
        memcpy(spare, row[pivot], sizeof spare);
        memcpy(row[pivot], row[found], sizeof spare);
        memcpy(row[found], spare, sizeof spare);
        uint64_t scale = inverse(spare[column]);
        for (int i = found + 1; i < rows; i++) {
            uint64_t factor = PRIME - times(row[i][column], scale);
            for (int k = column; k < 2 * TERMS; k++) row[i][k] = (row[i][k] + times(factor, spare[k])) % PRIME;
        }
        found++;
    }
    return found;
}

// Return the number of parameters that can be determined: the rank of the derivatives of N and D, minus 1, because a
// common factor of N and D does not change Z.
static int identifiable(const ratio *z, int leaves)
{
    uint64_t row[DUALS][2 * TERMS];
    for (int k = 0; k <= leaves; k++)
        for (int i = 0; i < TERMS; i++) {
            row[k][i] = z->n.c[i][k];
            row[k][TERMS + i] = z->d.c[i][k];
        }
    return rank(row, leaves + 1) - 1;
}

// ---- the class

kn_oneport kn_oneport_of(const kn_element *e)
{
    ratio z;
    impedance(e, e->root, &z);
    kn_oneport o = {.degree_n = z.n.degree, .degree_d = z.d.degree};
    o.fluid = z.n.c[0][0] == 0;
    o.elastic = z.n.degree == z.d.degree;
    o.relaxation = z.d.degree;
    o.retardation = z.n.degree - o.fluid;
    o.parameters = identifiable(&z, e->leaves);
    return o;
}

bool kn_oneport_equal(const kn_oneport *a, const kn_oneport *b)
{
    return a->fluid == b->fluid && a->elastic == b->elastic && a->relaxation == b->relaxation;
}

static void append(char text[KN_ELEMENT_TEXT], char mark, const char *part)
{
    size_t at = strlen(text), size = strlen(part);
    if (at) text[at++] = mark;
    memcpy(text + at, part, size + 1);
}

void kn_oneport_maxwell(const kn_oneport *o, char text[KN_ELEMENT_TEXT])
{
    bool alone = o->fluid && o->elastic && o->relaxation == 1; // a single Maxwell unit is printed without parentheses
    *text = '\0';
    for (int i = 0; i < o->relaxation; i++) append(text, '|', alone ? "s-d" : "(s-d)");
    if (!o->fluid) append(text, '|', "s");
    if (!o->elastic) append(text, '|', "d");
}

void kn_oneport_voigt(const kn_oneport *o, char text[KN_ELEMENT_TEXT])
{
    bool alone = !o->fluid && !o->elastic && o->retardation == 1;
    *text = '\0';
    for (int i = 0; i < o->retardation; i++) append(text, '-', alone ? "s|d" : "(s|d)");
    if (o->elastic) append(text, '-', "s");
    if (o->fluid) append(text, '-', "d");
}

const char *kn_oneport_name(const kn_oneport *o)
{
    static const char *const name[3][2][2] = {// [relaxation][fluid][elastic]
                                              {{"Voigt", "spring"}, {"damper", NULL}},
                                              {{NULL, "standard linear solid"}, {"Jeffreys", "Maxwell"}},
                                              {{NULL, NULL}, {NULL, "Burgers"}}};
    return o->relaxation < 3 ? name[o->relaxation][o->fluid][o->elastic] : NULL;
}

// Return Z at p = i omega of the tree under a node.
static double complex modulus(const kn_element *e, int node, const double *moduli, double omega)
{
    const kn_element_node *g = &e->node[node];
    if (g->kind == KN_ELEMENT_SPRING) return moduli[g->leaf];
    if (g->kind == KN_ELEMENT_DAMPER) return I * omega * moduli[g->leaf];
    double complex sum = 0;
    for (int i = 0; i < g->count; i++) {
        double complex part = modulus(e, g->child[i], moduli, omega);
        sum += g->kind == KN_ELEMENT_SERIES ? 1 / part : part;
    }
    return g->kind == KN_ELEMENT_SERIES ? 1 / sum : sum;
}

void kn_oneport_modulus(const kn_element *e, int node, const double *moduli, double omega, double *storage,
                        double *loss)
{
    double complex z = modulus(e, node, moduli, omega);
    *storage = creal(z);
    *loss = cimag(z);
}

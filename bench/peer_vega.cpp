// Vega FEM's mass-spring system, with its implicit backward Euler: one linearisation per step, solved by its own
// Jacobi-preconditioned conjugate gradients. Its damping is the tangent stiffness times a time, which damps along the
// links.
#include "bench/peer.h"

#include "forceModel.h"
#include "implicitBackwardEulerSparse.h"
#include "massSpringSystem.h"

#include <memory>
#include <vector>

namespace
{
struct springs : ForceModel {
    MassSpringSystem system;
    springs(int nodes, double *mass, double *x, int links, int *link, int *group, double *stiffness, double *damping)
        : system(nodes, mass, x, links, link, group, 1, stiffness, damping)
    {
        r = 3 * nodes;
    }
    void GetInternalForce(const double *u, double *force) override { system.ComputeForce(u, force); }
    void GetTangentStiffnessMatrixTopology(SparseMatrix **k) override { system.GetStiffnessMatrixTopology(k); }
    void GetTangentStiffnessMatrix(const double *u, SparseMatrix *k) override { system.ComputeStiffnessMatrix(u, k); }
};

struct block {
    std::vector<double> x, q, v; // q, v: displacements and velocities that the held nodes shall have
    std::vector<int> held;
    std::unique_ptr<springs> force;
    std::unique_ptr<SparseMatrix> mass;
    std::unique_ptr<ImplicitBackwardEulerSparse> integrator;

    explicit block(const peer_block &b)
    {
        std::vector<double> masses(size_t(b.node_count), b.mass_kg);
        std::vector<int> group(size_t(b.link_count), 0);
        double stiffness = b.stiffness_n_m, damping = 0;
        x.assign(b.x_m[0], b.x_m[0] + 3 * b.node_count);
        q.assign(x.size(), 0), v = q;
        for (int i = 0; i < 3 * b.node_count; i++)
            if (b.held[i / 3]) held.push_back(i);
        force.reset(new springs(b.node_count, masses.data(), x.data(), b.link_count, const_cast<int *>(b.link[0]),
                                group.data(), &stiffness, &damping));
        SparseMatrix *m;
        force->system.GenerateMassMatrix(&m);
        mass.reset(m);
        integrator.reset(new ImplicitBackwardEulerSparse(3 * b.node_count, b.dt_s, m, force.get(), int(held.size()),
                                                         held.data(), 0, b.damping_n_s_m / b.stiffness_n_m));
    }

    // Vega keeps held nodes in place: a step sets them to 0.
    void place()
    {
        for (int i : held) integrator->Getq()[i] = q[size_t(i)], integrator->Getqvel()[i] = v[size_t(i)];
    }
};

block *of(const peer *p) { return reinterpret_cast<block *>(const_cast<peer *>(p)); }
peer *create(const peer_block *b) { return reinterpret_cast<peer *>(new block(*b)); }
void destroy(peer *p) { delete of(p); }

void step(peer *p)
{
    of(p)->place();
    of(p)->integrator->DoTimestep();
    of(p)->place();
}

void hold(peer *p, int node, const double x_m[3], const double v_m_s[3])
{
    for (size_t k = 0, i = size_t(3 * node); k < 3; k++, i++)
        of(p)->q[i] = x_m[k] - of(p)->x[i], of(p)->v[i] = v_m_s[k];
}

void read(const peer *p, int node, double x_m[3], double v_m_s[3])
{
    for (int k = 0; k < 3; k++) {
        x_m[k] = of(p)->x[size_t(3 * node + k)] + of(p)->integrator->Getq()[3 * node + k];
        v_m_s[k] = of(p)->integrator->Getqvel()[3 * node + k];
    }
}
} // namespace

const peer_engine peer_vega = {"Vega FEM", create, destroy, hold, step, read};

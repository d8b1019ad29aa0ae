// Bullet's deformable body (btDeformableMultiBodyDynamicsWorld with btDeformableMassSpringForce), as Debian builds it:
// in float, with explicit elasticity and implicit damping, solved by conjugate gradients. All settings are Bullet's
// defaults, but gravity, contact and sleep are off. This is the only C++ file of the benches, because Bullet has a C++
// interface.
#include "bench/peer.h"

#include <BulletCollision/BroadphaseCollision/btDbvtBroadphase.h>
#include <BulletSoftBody/btDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>

#define TEXT2(x) #x
#define TEXT(x) TEXT2(x)
const char peer_name[] = "Bullet " TEXT(BT_BULLET_VERSION);

struct peer {
    btSoftBodyRigidBodyCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btDeformableBodySolver bodies;
    btDeformableMultiBodyConstraintSolver constraints;
    btDeformableMassSpringForce force;
    btDeformableMultiBodyDynamicsWorld *world;
    btSoftBody *body;
    btScalar dt_s;

    explicit peer(const peer_block &b)
        : force(btScalar(b.stiffness_n_m), btScalar(b.damping_n_s_m), b.axial), dt_s(btScalar(b.dt_s))
    {
        constraints.setDeformableSolver(&bodies);
        world = new btDeformableMultiBodyDynamicsWorld(&dispatcher, &broadphase, &constraints, &configuration, &bodies);
        world->setGravity(btVector3(0, 0, 0));
        btAlignedObjectArray<btVector3> x;
        btAlignedObjectArray<btScalar> mass;
        for (int i = 0; i < b.node_count; i++) {
            x.push_back(btVector3(btScalar(b.x_m[i][0]), btScalar(b.x_m[i][1]), btScalar(b.x_m[i][2])));
            mass.push_back(b.held[i] ? 0 : btScalar(b.mass_kg)); // mass 0: the node moves as peer_hold prescribes
        }
        body = new btSoftBody(&world->getWorldInfo(), b.node_count, &x[0], &mass[0]);
        for (int i = 0; i < b.link_count; i++) body->appendLink(b.link[i][0], b.link[i][1]);
        body->m_cfg.collisions = 0;
        body->m_cfg.kDP = 0;
        body->m_sleepingThreshold = 0;
        body->setActivationState(DISABLE_DEACTIVATION);
        world->addSoftBody(body);
        world->addForce(body, &force);
    }

    ~peer()
    {
        world->removeSoftBody(body);
        delete body;
        delete world;
    }
};

peer *peer_create(const peer_block *block) { return new peer(*block); }
void peer_destroy(peer *p) { delete p; }
void peer_step(peer *p) { p->world->stepSimulation(p->dt_s, 0); }

void peer_hold(peer *p, int node, const double x_m[3], const double v_m_s[3])
{
    btSoftBody::Node &n = p->body->m_nodes[node];
    for (int k = 0; k < 3; k++) {
        n.m_x[k] = n.m_q[k] = btScalar(x_m[k]);
        n.m_v[k] = n.m_vn[k] = btScalar(v_m_s[k]);
    }
}

void peer_position(const peer *p, int node, double x_m[3])
{
    for (int k = 0; k < 3; k++) x_m[k] = p->body->m_nodes[node].m_x[k];
}

void peer_velocity(const peer *p, int node, double v_m_s[3])
{
    for (int k = 0; k < 3; k++) v_m_s[k] = p->body->m_nodes[node].m_v[k];
}

// Bullet's deformable body (btDeformableMultiBodyDynamicsWorld with btDeformableMassSpringForce), as Debian builds it:
// in float, with explicit elasticity and implicit damping, solved by conjugate gradients. All settings are Bullet's
// defaults, but gravity, contact and sleep are off.
#include "bench/peer.h"

#include <BulletCollision/BroadphaseCollision/btDbvtBroadphase.h>
#include <BulletSoftBody/btDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>

#define TEXT2(x) #x
#define TEXT(x) TEXT2(x)

namespace
{
struct block {
    btSoftBodyRigidBodyCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btDeformableBodySolver bodies;
    btDeformableMultiBodyConstraintSolver constraints;
    btDeformableMassSpringForce force;
    btDeformableMultiBodyDynamicsWorld *world;
    btSoftBody *body;
    btScalar dt_s;

    explicit block(const peer_block &b)
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

    ~block()
    {
        world->removeSoftBody(body);
        delete body;
        delete world;
    }
};

block *of(const peer *p) { return reinterpret_cast<block *>(const_cast<peer *>(p)); }
peer *create(const peer_block *b) { return reinterpret_cast<peer *>(new block(*b)); }
void destroy(peer *p) { delete of(p); }
void step(peer *p) { of(p)->world->stepSimulation(of(p)->dt_s, 0); }

void hold(peer *p, int node, const double x_m[3], const double v_m_s[3])
{
    btSoftBody::Node &n = of(p)->body->m_nodes[node];
    for (int k = 0; k < 3; k++) {
        n.m_x[k] = n.m_q[k] = btScalar(x_m[k]);
        n.m_v[k] = n.m_vn[k] = btScalar(v_m_s[k]);
    }
}

void read(const peer *p, int node, double x_m[3], double v_m_s[3])
{
    const btSoftBody::Node &n = of(p)->body->m_nodes[node];
    for (int k = 0; k < 3; k++) x_m[k] = n.m_x[k], v_m_s[k] = n.m_v[k];
}
} // namespace

const peer_engine peer_bullet = {"Bullet " TEXT(BT_BULLET_VERSION), create, destroy, hold, step, read};

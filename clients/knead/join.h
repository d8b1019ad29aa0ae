#ifndef KN_CLIENTS_JOIN_H
#define KN_CLIENTS_JOIN_H
// A client's way onto an LCM bus: stock liblcm behind the same check of the route as the daemon's, because already the
// joining of a group whose route is not loopback would go out to the network.
#include <lcm/lcm.h>
#include <stdint.h>
#include <stdbool.h>
#include <stddef.h>

#define KN_FORCE_URL "udpm://239.255.76.67:7667?ttl=0" // poses, forces, scene, events, status
#define KN_MEMORY_URL "memq://" // no bus: a queue of this lcm_t, for whoever carries messages by hand (tests/rig.h)
#define KN_MESH_URL "udpm://239.255.76.67:7668?ttl=0"

// Whether kn_join would understand the URL; nothing is opened. False and one line in error: bad input, where a failing
// kn_join is the machine's refusal.
bool kn_join_check(const char *url, const char *otherwise, char *error, size_t error_size);

// url NULL: LCM_DEFAULT_URL if it is set and `otherwise` is KN_FORCE_URL, else `otherwise`. The receive buffer is as
// large as the kernel allows, up to 4 MiB: what a full one loses is lost silently. NULL and one line in error.
// LCM's hidden receive thread gets the scheduling class of the thread that makes the first subscription.
lcm_t *kn_join(const char *url, const char *otherwise, char *error, size_t error_size);

// Of the environment: KNEAD_LAN, an interface in lo's place, for URLs with ttl=1 or more; KNEAD_KEY, a file of
// server/auth.h, which kn_join_check and kn_join read. Then what is sent is signed, and what was not signed with it was
// not heard. bytes: size of them, and room for KN_WIRE_MAC more.
int kn_join_send(lcm_t *lcm, const char *channel, uint8_t *bytes, int size);
bool kn_join_heard(const lcm_recv_buf_t *buf, const char *channel);

// SCHED_FIFO for the calling thread, or back to SCHED_OTHER for priority 0. 0, or the errno of the refusal.
int kn_join_priority(int priority);

#endif

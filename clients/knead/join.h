#ifndef KN_CLIENTS_JOIN_H
#define KN_CLIENTS_JOIN_H
// A client's place on an LCM bus: it hears through kneadd's own bounded receiver (server/bus.h), and liblcm only
// transmits, because a datagram made for it writes out of the bounds of liblcm's receiving half.
//
//     kn_join_open -> kn_join_hear, once per channel -> kn_join_handle, as often as there is time -> kn_join_close
//
// With a key (KNEAD_KEY), the tag is checked before anything of a message is read, and only messages of the life of
// kneadd that answered our hello are believed, each older than the next (server/auth.h).
//
// A message in parts (LC03) is put together when its parts come in order, one message at a time, of KN_JOIN_LARGEST
// bytes at most, on the channels of scenes and topologies alone. One thread uses a join; several joins of one process share a key and the life of kneadd.
#include <lcm/lcm.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_FORCE_URL "udpm://239.255.76.67:7667?ttl=0" // poses, forces, scene, events, status
#define KN_MEMORY_URL "memq://" // no bus: a queue of this join, for tests, which move messages themselves (tests/rig.h)
#define KN_MESH_URL "udpm://239.255.76.67:7668?ttl=0"
#define KN_JOIN_LARGEST (16 << 20) // bytes of a message in parts: a mesh of 2^20 triangles has 12 MiB
#define KN_JOIN_ASK "is kneadd running on this bus? (server/run, or kneadd --scene core/scenes/dough.yaml)"
#define KN_JOIN_TURN 256 // datagrams taken by one call

typedef struct kn_join kn_join;

// Check URL and environment without opening anything. False and one line in error: bad input, where a failing
// kn_join_open is the machine's refusal.
bool kn_join_check(const char *url, const char *otherwise, char *error, size_t error_size);

// Join a bus. url NULL: LCM_DEFAULT_URL if it is set and `otherwise` is KN_FORCE_URL, else `otherwise`. The receive
// buffer is as large as the kernel allows, up to 4 MiB: what a full one loses is lost silently. NULL and one line in
// error. From the environment:
//     KNEAD_LAN     an interface in lo's place, for URLs with ttl=1 or more
//     KNEAD_KEY     a file of server/auth.h: sign what is sent, believe what is signed with it and fresh
//     KNEAD_MUTE=1  with a key: send nothing. Messages stamped within 5 s of this machine's wall clock are then fresh
kn_join *kn_join_open(const char *url, const char *otherwise, char *error, size_t error_size);
void kn_join_close(kn_join *join); // NULL is fine

// Call handler for each message on a channel; a '*' at its end stands for any
// name of a tool, [a-z0-9_]+. buf->data is the
// payload alone, without a trailer, valid during the call. False: more than 16.
bool kn_join_hear(kn_join *join, const char *channel, lcm_msg_handler_t handler, void *user);

// Take what waits, KN_JOIN_TURN datagrams at most; when nothing does, wait timeout_ms for the first that is handed on.
// Return the number of messages handed on. Says hello when it is time. Allocates for messages in parts alone.
int kn_join_handle(kn_join *join, int timeout_ms);

// Judge one datagram as if it had come over the bus. Return the number of handlers that were called.
int kn_join_take(kn_join *join, const void *datagram, size_t size);

// Return a descriptor that is readable when datagrams wait.
int kn_join_fd(const kn_join *join);

// Send `size` bytes, which have room for KN_AUTH_TRAILER more. With a key nothing is sent before a life is known.
void kn_join_send(kn_join *join, const char *channel, uint8_t *bytes, int size);

// Return the reason why no message has been believed of late, or `otherwise` when there is none that we know.
const char *kn_join_why(const char *otherwise);

// Return the queue in memory of a join at KN_MEMORY_URL.
lcm_t *kn_join_memory(kn_join *join);

// Return whether this process may send. False and one line in error.
bool kn_join_speaks(char *error, size_t error_size);

// Stop signing and checking: for messages that never meet kneadd (knead latency's echo).
void kn_join_trust(kn_join *join);

// SCHED_FIFO for the calling thread, or back to SCHED_OTHER for priority 0. 0, or the errno of the refusal.
int kn_join_priority(int priority);

#endif

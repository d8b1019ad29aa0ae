#ifndef KN_CLIENTS_JOIN_H
#define KN_CLIENTS_JOIN_H
// A client's connection to an LCM bus. It receives through kneadd's own bounded receiver (server/bus.h). liblcm only
// sends: a crafted datagram makes the receiving half of liblcm write out of bounds.
//
//     kn_join_open -> kn_join_hear, once per channel -> kn_join_handle, as often as there is time -> kn_join_close
//
// If a key is set (KNEAD_KEY), the tag of a message is checked before its contents are read. A life is one run of
// kneadd, or the run after one `load`, and a hello is the message with which a client asks for the present life. Only
// messages of the life that answered this process's hello are believed. Each message must be newer than the last one
// (server/auth.h).
//
// A message in parts (LC03) is assembled if its parts come in order. One message is assembled at a time, of at most
// KN_JOIN_LARGEST bytes, and only on the channels of scenes and topologies. A join must be used by one thread only. All
// joins of a process share the key and the life of kneadd.
#include <lcm/lcm.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_FORCE_URL "udpm://239.255.76.67:7667?ttl=0" // poses, forces, scene, events, status
// URL of a queue in memory in place of a bus, for tests that move the messages themselves (tests/rig.h).
#define KN_MEMORY_URL "memq://"
#define KN_MESH_URL "udpm://239.255.76.67:7668?ttl=0"
// Largest message in parts, bytes. A mesh of 2^20 triangles has 12 MiB.
#define KN_JOIN_LARGEST (16 << 20)
#define KN_JOIN_ASK "is kneadd running on this bus? (server/run, or kneadd --scene core/scenes/dough.yaml)"
// Largest number of datagrams that one call of kn_join_handle takes.
#define KN_JOIN_TURN 256

typedef struct kn_join kn_join;

// Check URL and environment without opening anything. Return false with one line in error for bad input. If the check
// succeeds, a failure of kn_join_open means that the machine refuses.
bool kn_join_check(const char *url, const char *otherwise, char *error, size_t error_size);

// Join the bus at `url`. If `url` is NULL, use LCM_DEFAULT_URL if it is set and `otherwise` is KN_FORCE_URL. Else use
// `otherwise`, or with KNEAD_LAN the same bus on the LAN. The receive buffer is as large as the kernel allows, up to 4
// MiB. Datagrams that overflow the buffer are lost silently. On failure return NULL with one line in error. The
// environment can set:
//     KNEAD_LAN     a network interface to use instead of lo, for URLs with ttl=1 or more
//     KNEAD_KEY     a key file (server/auth.h): messages are signed, and only fresh messages with its tag are believed
//     KNEAD_MUTE=1  with a key: send nothing. Messages stamped within 5 s of this machine's wall clock are then fresh
kn_join *kn_join_open(const char *url, const char *otherwise, char *error, size_t error_size);
// NULL is allowed.
void kn_join_close(kn_join *join);

// Call `handler` for each message on `channel`. A '*' at the end of `channel` stands for any name of a tool,
// [a-z0-9_]+. buf->data is the payload without a trailer, valid during the call. Return false if there are more than 16
// channels.
bool kn_join_hear(kn_join *join, const char *channel, lcm_msg_handler_t handler, void *user);

// Take the waiting datagrams, KN_JOIN_TURN at most. If no message reaches a handler, wait up to `timeout_ms` for the
// first one. Return the number of calls of handlers. The function also sends a hello when one is due. The function
// allocates memory only for messages in parts.
int kn_join_handle(kn_join *join, int timeout_ms);

// Process one datagram as if it had come over the bus. Return the number of handlers called.
int kn_join_take(kn_join *join, const void *datagram, size_t size);

// Return a descriptor that is readable when datagrams are waiting.
int kn_join_fd(const kn_join *join);

// Send `size` bytes. The buffer must have room for KN_AUTH_TRAILER more. With a key nothing is sent before a life is
// known.
void kn_join_send(kn_join *join, const char *channel, uint8_t *bytes, int size);

// Return the reason why no message has been believed recently, or `otherwise` if no reason is known.
const char *kn_join_why(const char *otherwise);

// Return the memory queue of a join at KN_MEMORY_URL.
lcm_t *kn_join_memory(kn_join *join);

// Return true if this process may send, else false with one line in error.
bool kn_join_speaks(char *error, size_t error_size);

// Stop signing and checking on this join. Use this only for messages that never reach kneadd (the echo of knead
// latency).
void kn_join_trust(kn_join *join);

// Set SCHED_FIFO for the calling thread, or SCHED_OTHER for priority 0. Return 0, or the errno of the refusal.
int kn_join_priority(int priority);

#endif

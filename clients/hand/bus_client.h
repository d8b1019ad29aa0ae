#ifndef KN_CLIENTS_BUS_CLIENT_H
#define KN_CLIENTS_BUS_CLIENT_H
// A client's connection to an LCM bus. It receives through kneadd's own bounded receiver (server/bus.h). liblcm is used
// only to send, because a crafted datagram makes the receiving half of liblcm write out of bounds.
//
//     open -> hear, once per channel -> handle, as often as there is time -> close
//
// If a key is set (KNEAD_KEY), the tag of a message is checked before its contents are read. A life is one run of
// kneadd, or the run after one `load`, and a hello is the message with which a client asks for the present life. Only
// messages of the life that answered this process's hello are accepted. Each message must be newer than the last one
// (server/auth.h).
//
// A message in parts (LC03) is assembled if its parts come in order. One message is assembled at a time, of at most
// KN_BUS_CLIENT_LARGEST bytes, and only on the channels of scenes and topologies. A connection must be used by one
// thread only. All connections of a process share the key and the life of kneadd.
#include <lcm/lcm.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_FORCE_URL "udpm://239.255.76.67:7667?ttl=0" // poses, forces, scene, events, status
// URL of a queue in memory that replaces the bus. Only tests use this queue; they pass its messages on themselves
// (tests/rig.h).
#define KN_MEMORY_URL "memq://"
#define KN_MESH_URL "udpm://239.255.76.67:7668?ttl=0"
// Largest size of a message that is sent in parts, bytes. A mesh of 2^20 triangles needs 12 MiB.
#define KN_BUS_CLIENT_LARGEST (16 << 20)
#define KN_BUS_CLIENT_ASK "is kneadd running on this bus? (server/run, or kneadd dough)"
// Largest number of datagrams that one call of kn_bus_client_handle processes.
#define KN_BUS_CLIENT_TURN 256

typedef struct kn_bus_client kn_bus_client;

// Check the URL and the environment variables without opening a socket. Return false with one line in error if they are
// invalid. If the check succeeds, a later failure of kn_bus_client_open is caused by the operating system.
bool kn_bus_client_check(const char *url, const char *otherwise, char *error, size_t error_size);

// Join the bus at `url`. If `url` is NULL, use the first of: LCM_DEFAULT_URL, if it is set and `otherwise` is
// KN_FORCE_URL; the bus of `otherwise` on the LAN, if KNEAD_LAN is set; `otherwise`. The receive buffer is as large as
// the kernel allows, up to 4 MiB. Datagrams that overflow the buffer are lost silently. On failure return NULL with one
// line in error. The environment can set:
//     KNEAD_LAN     a network interface to use instead of lo, for URLs with ttl=1 or more
//     KNEAD_KEY     a key file (server/auth.h): sign messages; accept only fresh messages with a valid tag
//     KNEAD_MUTE=1  with a key: send nothing; accept messages stamped within 5 s of this machine's wall clock
kn_bus_client *kn_bus_client_open(const char *url, const char *otherwise, char *error, size_t error_size);
// Close the connection `join` and free its memory. NULL is allowed.
void kn_bus_client_close(kn_bus_client *join);

// Call `handler` for each message on `channel`. A '*' at the end of `channel` stands for any name of a tool,
// [a-z0-9_]+. buf->data is the payload without a trailer, valid during the call. Return false if there are more than 16
// channels.
bool kn_bus_client_hear(kn_bus_client *join, const char *channel, lcm_msg_handler_t handler, void *user);

// Process the waiting datagrams, at most KN_BUS_CLIENT_TURN, and call the handlers of their messages. If no message
// reaches a handler, wait up to `timeout_ms` for one. Return the number of calls of handlers. The function sends a
// hello message when one is due. It allocates memory only for messages in parts.
int kn_bus_client_handle(kn_bus_client *join, int timeout_ms);

// Process a datagram that the caller provides, as if it had come from the bus. Return the number of handlers called.
int kn_bus_client_take(kn_bus_client *join, const void *datagram, size_t size);

// Return a descriptor that is readable when datagrams are waiting.
int kn_bus_client_fd(const kn_bus_client *join);

// Send a message of `size` bytes on a channel. The buffer must have room for KN_AUTH_TRAILER further bytes. If a key is
// set, nothing is sent until the present life of kneadd is known.
void kn_bus_client_send(kn_bus_client *join, const char *channel, uint8_t *bytes, int size);

// Return the reason why no message has been accepted recently, or `otherwise` if no reason is known.
const char *kn_bus_client_why(const char *otherwise);

// Return the message queue in memory of a connection that was opened with KN_MEMORY_URL.
lcm_t *kn_bus_client_memory(kn_bus_client *join);

// Return true if this process may send messages. Otherwise (KNEAD_MUTE) return false with one line in error.
bool kn_bus_client_speaks(char *error, size_t error_size);

// Stop signing and checking the messages of this connection. Use this function only for messages that never reach
// kneadd, such as the echo of knead latency.
void kn_bus_client_trust(kn_bus_client *join);

// Set the scheduling of the calling thread: SCHED_FIFO with the given priority, or SCHED_OTHER for priority 0. Return
// 0, or the errno if the kernel refuses.
int kn_bus_client_priority(int priority);

#endif

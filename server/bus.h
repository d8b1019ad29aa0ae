#ifndef KN_SERVER_BUS_H
#define KN_SERVER_BUS_H
// A bus: an LCM URL, its multicast group, and a socket that receives the group.
//
// All traffic stays on this machine, or on the one network interface that --lan names. If the route of a group leaves
// through another interface, the group is refused before any socket joins it, because joining already sends a packet
// (IGMP) through the network card, even with ttl 0. The socket is bound to the group's own address and joins the group
// on that one interface. (Stock liblcm binds any address and hears every group on its port.) The socket reports for
// each datagram its sender, and whether it arrived over that interface.
#include <netinet/in.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/socket.h>
#include <sys/types.h>

// Number of bytes kept of one datagram. A pose has fewer than 300 bytes; longer datagrams are only counted.
#define KN_DATAGRAM_MAX 512
#define KN_BATCH 32       // largest number of datagrams read each time the main thread wakes
#define KN_CHANNEL_MAX 64 // LCM's own limit for a channel name, bytes with its NUL

typedef struct kn_bus {
    const char *url; // LCM URL of the bus, borrowed
    struct sockaddr_in group;
    int device;      // index of the bus's network interface: lo, or the one named in `lan`
    const char *lan; // name of the LAN interface (--lan), borrowed; NULL: lo
} kn_bus;

typedef struct kn_datagram {
    size_t size; // number of bytes kept in `bytes`
    bool here;   // true if the datagram arrived over the bus's network interface
    struct in_addr from;
    unsigned char bytes[KN_DATAGRAM_MAX];
} kn_datagram;

typedef struct kn_datagram_batch { // datagrams that the main thread reads in one call
    int count;
    kn_datagram datagram[KN_BATCH];
} kn_datagram_batch;

// Parse udpm://GROUP:PORT[?ttl=0&recv_buf_size=N]. If `lan` is NULL, the bus is on lo and ttl must be 0. Otherwise
// `lan` names an interface and ttl must be 1 or more. For any other URL return false and put one line in error.
bool kn_bus_parse(kn_bus *bus, const char *url, const char *lan, char *error, size_t error_size);

// Return whether the kernel would route the group over the bus's network interface. If not, put one line with the
// remedy in error.
bool kn_bus_check_route(const kn_bus *bus, char *error, size_t error_size);

// Claim the bus for this server, because a second server on the bus would answer the same poses. The claim is a lock on
// a file that only this user can create or open, so no other user can hold the lock. The file lies in the first of
// these directories that belongs to the user of this process: $RUNTIME_DIRECTORY (set by systemd), /run (root),
// $XDG_RUNTIME_DIR, /run/user/UID, a folder of this user in /tmp. The kernel releases the lock when the process ends,
// however it ends; the empty file stays. The file name contains the network namespace, since each namespace has its own
// lo. A kneadd of another user claims in another directory and is therefore not noticed.
// Return the descriptor that holds the claim. If another server holds it, return -1 and put one line in error. The line
// names `option`, with which the operator selects another bus.
int kn_bus_claim(const kn_bus *bus, const char *option, char *error, size_t error_size);

// Return whether two buses have the same group and the same port.
bool kn_bus_same(const kn_bus *a, const kn_bus *b);

// Return a non-blocking socket that receives the group over the bus's network interface. Other sockets may receive the
// group as well. On failure return -1 and put one line in error. `buffer_bytes` is the wanted size of the receive
// buffer. The kernel may allow less: only root may exceed net.core.rmem_max.
int kn_bus_listen(const kn_bus *bus, int buffer_bytes, char *error, size_t error_size);

// Read the waiting datagrams, at most `limit` (<= KN_BATCH) of them. The function neither blocks nor allocates.
void kn_bus_read(const kn_bus *bus, int fd, int limit, kn_datagram_batch *batch);

// Read one datagram of at most `room` bytes; a longer datagram is cut. Return its size, or -1 if no datagram waits. Set
// *here to true if the datagram arrived over the bus's network interface. The function neither blocks nor allocates.
ssize_t kn_bus_take(const kn_bus *bus, int fd, void *bytes, size_t room, bool *here);

// An LCM datagram after its bounds were checked:
//
//     "LC02" | sequence u32 | channel, NUL | payload
//     "LC03" | sequence u32 | message size u32 | offset u32 | part u16 | parts u16 | channel, NUL in part 0 | payload
typedef struct kn_packet {
    bool split;          // true if this is an LC03 datagram, that is, one part of a message
    const char *channel; // channel name; NULL in all parts of an LC03 message but the first
    const unsigned char *payload;
    size_t size; // number of bytes in `payload`
    // `whole`: size of the whole message, bytes; `whole` and `offset` are set for LC03 only.
    uint32_t sequence, whole, offset;
    uint16_t part, parts;
} kn_packet;

typedef enum kn_framing { KN_FRAMED, KN_FRAME_RUNT, KN_FRAME_MAGIC, KN_FRAME_CHANNEL_END } kn_framing;

// Parse a datagram of `size` bytes. The pointers in *packet point into `bytes`.
kn_framing kn_bus_unpack(const unsigned char *bytes, size_t size, kn_packet *packet);

// Return how many datagrams the kernel has dropped since the socket was opened, modulo 2^32. The kernel drops a
// datagram when the socket's receive buffer is full. This function asks the socket for the number (SO_MEMINFO). The
// socket option SO_RXQ_OVFL would attach the number to each received datagram, so drops after the last received
// datagram would be missed.
uint32_t kn_bus_drops(int fd);

// Read and write big-endian integers, as LCM encodes them. The caller checks the bounds.
static inline uint32_t kn_bytes_32(const unsigned char *bytes)
{
    return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
}

static inline int64_t kn_bytes_64(const unsigned char *bytes)
{
    return (int64_t)((uint64_t)kn_bytes_32(bytes) << 32 | kn_bytes_32(bytes + 4));
}

static inline void kn_bytes_put_64(unsigned char *bytes, int64_t value)
{
    for (int i = 0; i < 8; i++) bytes[i] = (unsigned char)((uint64_t)value >> (56 - 8 * i));
}

#endif

#ifndef KN_SERVER_BUS_H
#define KN_SERVER_BUS_H
// A bus: an LCM URL, the multicast group behind it, and a socket that hears it.
//
// Everything stays on this machine, or on one interface that was named. A group whose route leaves by another is refused
// before anything joins it, because the join itself (IGMP) would already leave through the network card, even with
// ttl 0. The socket is bound to the group's own address (stock liblcm binds any address and hears every group of its
// port), joins it on that one interface, and tells of each datagram whether it came over it, and from where.
#include <netinet/in.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/socket.h>
#include <sys/types.h>

#define KN_DATAGRAM_MAX 512 // bytes kept of one datagram: a pose has less than 300, what is larger is only counted
#define KN_BATCH 32         // datagrams taken per wake
#define KN_CHANNEL_MAX 64   // bytes of a channel's name with its NUL, LCM's own limit

typedef struct kn_bus {
    const char *url; // borrowed
    struct sockaddr_in group;
    int device;      // index of lo, or of the interface that was named
    const char *lan; // its name, borrowed; NULL: lo
} kn_bus;

typedef struct kn_datagram {
    size_t size; // bytes kept
    bool here;   // it arrived over the bus's device
    struct in_addr from;
    unsigned char bytes[KN_DATAGRAM_MAX];
} kn_datagram;

typedef struct kn_batch { // what one wake brought
    int count;
    kn_datagram datagram[KN_BATCH];
} kn_batch;

// udpm://GROUP:PORT[?ttl=0&recv_buf_size=N] on lo; with lan, the name of an interface, ttl is 1 or more. False and one
// line in error for anything else.
bool kn_bus_parse(kn_bus *bus, const char *url, const char *lan, char *error, size_t error_size);

// Whether the kernel would route the group over the bus's device. False and one line in error that names the cure.
bool kn_bus_check_route(const kn_bus *bus, char *error, size_t error_size);

// Takes the bus for one server: a second one would answer the same hands. The claim is a lock on a file that only our
// user can make or open, so no other user can hold it: in $RUNTIME_DIRECTORY, which systemd gives, /run (root),
// $XDG_RUNTIME_DIR, /run/user/UID, or a folder of ours in /tmp, the first that is ours. The kernel gives the lock back
// with the process, however that ends; the empty file stays. The file's name has the network namespace in it, since each
// has its own lo. A kneadd of another user has another directory and is not noticed. Returns the descriptor that holds
// the claim; -1 and one line in error, with the option that names another bus, when another server has it.
int kn_bus_claim(const kn_bus *bus, const char *option, char *error, size_t error_size);

// Whether they are one group and one port.
bool kn_bus_same(const kn_bus *a, const kn_bus *b);

// A non-blocking socket that hears the group over that device, beside any number of others; -1 and one line in error.
// buffer_bytes: of its receive buffer, as far as the kernel allows; only root may pass net.core.rmem_max.
int kn_bus_listen(const kn_bus *bus, int buffer_bytes, char *error, size_t error_size);

// Takes what waits, at most limit (<= KN_BATCH) datagrams. Neither blocks nor allocates.
void kn_bus_read(const kn_bus *bus, int fd, int limit, kn_batch *batch);

// Take one datagram of at most `room` bytes; longer ones are cut. Return its size, -1 when none waits. *here: it arrived
// over that device. Neither blocks nor allocates.
ssize_t kn_bus_take(const kn_bus *bus, int fd, void *bytes, size_t room, bool *here);

// An LCM datagram, its bounds checked:
//
//     "LC02" | sequence u32 | channel, NUL | payload
//     "LC03" | sequence u32 | size of the message u32 | offset u32 | part u16 | parts u16 | channel, NUL in part 0 | payload
typedef struct kn_packet {
    bool split;          // LC03
    const char *channel; // NULL in a later part of LC03
    const unsigned char *payload;
    size_t size;                      // of payload
    uint32_t sequence, whole, offset; // the last two of LC03
    uint16_t part, parts;
} kn_packet;

typedef enum kn_framing { KN_FRAMED, KN_FRAME_RUNT, KN_FRAME_MAGIC, KN_FRAME_CHANNEL_END } kn_framing;

// Point into bytes of a datagram. Pure.
kn_framing kn_bus_unpack(const unsigned char *bytes, size_t size, kn_packet *packet);

// Datagrams the kernel dropped because this socket's buffer was full, since it was opened, modulo 2^32: the number that
// SO_RXQ_OVFL attaches to datagrams, asked for directly, so that drops after the last datagram count as well.
uint32_t kn_bus_drops(int fd);

#endif

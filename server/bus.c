#include "server/bus.h"
#include "server/console.h"
#include <arpa/inet.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/rtnetlink.h>
#include <linux/sock_diag.h>
#include <net/if.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

enum { LO = 1 }; // index of the loopback interface lo, the same in every network namespace of Linux (LOOPBACK_IFINDEX)

// Return the value of the field ttl among the KEY=VALUE fields that follow the '?' of a URL, or 0 if there is no ttl.
// liblcm separates fields at '&'. This function also separates at ',', so that no field can be hidden behind a comma.
// Return -1 if ttl is given twice (liblcm would take the last value), or if only liblcm accepts the value as a number
// (" 1", "0x1").
static long ttl_of(const char *fields)
{
    long hops = 0;
    int said = 0;
    for (size_t size; *fields; fields += size + (fields[size] != 0)) {
        size = strcspn(fields, "&,");
        if (strncmp(fields, "ttl", 3) != 0 || (size > 3 && fields[3] != '=')) continue;
        if (size < 5 || strspn(fields + 4, "0123456789") != size - 4) return -1;
        char *end;
        hops = strtol(fields + 4, &end, 0);
        if (said++ || end != fields + size) return -1;
    }
    return hops;
}

bool kn_bus_parse(kn_bus *bus, const char *url, const char *lan, char *error, size_t error_size)
{
    char address[16], end = 0;
    unsigned port = 0;
    memset(bus, 0, sizeof *bus);
    bus->url = url;
    bus->lan = lan;
    bus->device = lan ? (int)if_nametoindex(lan) : LO;
    if (bus->device == 0) return kn_refuse(error, error_size, "%s: no such network interface", lan);
    if (lan && bus->device == LO)
        return kn_refuse(error, error_size, "%s: is the loopback interface, expected an interface of a network", lan);
    // Accept a multicast group and a port, followed by nothing or by '?'. `end` is set only if something follows the
    // port.
    int fields = sscanf(url, "udpm://%15[0-9.]:%5u%c", address, &port, &end);
    if (fields < 2 || (fields == 3 && end != '?') || inet_pton(AF_INET, address, &bus->group.sin_addr) != 1 ||
        !IN_MULTICAST(ntohl(bus->group.sin_addr.s_addr)) || port == 0 || port > 65535)
        return kn_refuse(error, error_size,
                         "%s: expected udpm://GROUP:PORT?ttl=0 with a multicast group; "
                         "LCM's other providers are not supported",
                         url);
    const char *query = strchr(url, '?');
    long hops = ttl_of(query ? query + 1 : "");
    if (hops < 0 || hops > 255)
        return kn_refuse(error, error_size, "%s: expected at most one ttl=, a number from 0 to 255", url);
    // Without a LAN interface no message may leave the machine, so ttl must be 0. With a LAN interface, ttl 0 would
    // reach nobody.
    if (!lan != (hops == 0))
        return kn_refuse(
            error, error_size,
            lan ? "%s: expected ttl=1 or more: with ttl=0 nothing reaches %s"
                : "%s: expected ttl=0: anyone on a bus can move the tool, so the bus stays on this machine",
            url, lan);
    bus->group.sin_family = AF_INET;
    bus->group.sin_port = htons((uint16_t)port);
    return true;
}

// Return the index of the network interface over which the kernel would route the group, or 0 if there is no route.
// This function asks the kernel, as `ip route get` does. Reading the source address of a connected socket would not be
// enough, because this address is 0.0.0.0 both for a link-scope route over lo and for a network card without an
// address.
static int route_device(struct in_addr group)
{
    struct {
        struct nlmsghdr header;
        struct rtmsg route;
        struct rtattr attribute;
        struct in_addr destination;
    } ask = {.header = {.nlmsg_len = sizeof ask, .nlmsg_type = RTM_GETROUTE, .nlmsg_flags = NLM_F_REQUEST},
             .route = {.rtm_family = AF_INET, .rtm_dst_len = 32},
             .attribute = {.rta_len = RTA_LENGTH(sizeof group), .rta_type = RTA_DST},
             .destination = group};
    // Send one netlink request and read one reply.
    _Alignas(struct nlmsghdr) char answer[2048];
    int device = 0, fd = socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE);
    if (fd < 0) return 0;
    ssize_t size = send(fd, &ask, sizeof ask, 0) == sizeof ask ? recv(fd, answer, sizeof answer, 0) : -1;
    close(fd);
    const struct nlmsghdr *header = (const struct nlmsghdr *)answer;
    if (size < (ssize_t)NLMSG_LENGTH(sizeof ask.route) || header->nlmsg_type != RTM_NEWROUTE) return 0;
    // Find the output interface among the attributes of the route.
    unsigned left = header->nlmsg_len - (unsigned)NLMSG_LENGTH(sizeof ask.route);
    for (struct rtattr *a = RTM_RTA((struct rtmsg *)NLMSG_DATA(header)); RTA_OK(a, left); a = RTA_NEXT(a, left))
        if (a->rta_type == RTA_OIF) memcpy(&device, RTA_DATA(a), sizeof device);
    return device;
}

bool kn_bus_check_route(const kn_bus *bus, char *error, size_t error_size)
{
    int device = route_device(bus->group.sin_addr);
    if (device == bus->device) return true;
    char name[IF_NAMESIZE] = "", group[16];
    inet_ntop(AF_INET, &bus->group.sin_addr, group, sizeof group);
    bool named = device != 0 && if_indextoname((unsigned)device, name);
    snprintf(
        error, error_size,
        "%s: the multicast group is not routed to %s (%s%s); as root: ip link set %s up; ip route add %s/32 dev %s",
        bus->url, bus->lan ? bus->lan : "loopback", named ? "but to " : "it has no route", name,
        bus->lan ? bus->lan : "lo", group, bus->lan ? bus->lan : "lo");
    return false;
}

bool kn_bus_same(const kn_bus *a, const kn_bus *b)
{
    return a->group.sin_addr.s_addr == b->group.sin_addr.s_addr && a->group.sin_port == b->group.sin_port;
}

// Open a directory in which only the user of this process can create, rename or remove files. Return -1 for any other
// directory.
static int open_own(int parent, const char *path)
{
    struct stat s;
    int dir = path ? openat(parent, path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC) : -1;
    if (dir < 0 || (fstat(dir, &s) == 0 && s.st_uid == geteuid() && !(s.st_mode & 022))) return dir;
    close(dir);
    return -1;
}

// Open a folder of this user in /tmp, for users without a runtime directory. The folder has a random name, so that no
// other user can guess the name and create the folder first. A folder that an earlier kneadd made is used again.
static int open_own_in_tmp(void)
{
    char fresh[] = "/tmp/kneadd-XXXXXX";
    int own = -1;
    DIR *tmp = opendir("/tmp");
    // Look for an existing folder of this user.
    for (struct dirent *e; own < 0 && tmp && (e = readdir(tmp));)
        if (strncmp(e->d_name, fresh + 5, 7) == 0) own = open_own(dirfd(tmp), e->d_name);
    if (tmp) closedir(tmp);
    return own >= 0 || !mkdtemp(fresh) ? own : open_own(AT_FDCWD, fresh);
}

int kn_bus_claim(const kn_bus *bus, const char *option, char *error, size_t error_size)
{
    char name[80], group[16], user[40];
    struct stat net = {0};
    // the name of the lock file contains the network namespace, because every namespace has a loopback device of its
    // own
    stat("/proc/self/ns/net", &net);
    inet_ntop(AF_INET, &bus->group.sin_addr, group, sizeof group);
    snprintf(name, sizeof name, "kneadd-%ju-%s:%u", (uintmax_t)net.st_ino, group, ntohs(bus->group.sin_port));
    snprintf(user, sizeof user, "/run/user/%u", geteuid());
    const char *const places[] = {getenv("RUNTIME_DIRECTORY"), "/run", getenv("XDG_RUNTIME_DIR"), user};
    int fd = -1;
    // Try the directories in order of preference. If none is usable, use a folder in /tmp.
    for (size_t i = 0; fd < 0 && i <= sizeof places / sizeof *places; i++) {
        int dir = i < sizeof places / sizeof *places ? open_own(AT_FDCWD, places[i]) : open_own_in_tmp();
        // Set the sticky bit, so that programs that remove old files from /tmp keep the lock file.
        fd = dir < 0 ? -1 : openat(dir, name, O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 01600);
        if (dir >= 0) close(dir);
    }
    if (fd >= 0 && flock(fd, LOCK_EX | LOCK_NB) == 0) return fd;
    if (fd >= 0 && errno == EWOULDBLOCK)
        snprintf(error, error_size, "another kneadd serves %s: expected %s with another port", bus->url, option);
    else
        snprintf(error, error_size, "%s: cannot reserve this bus, no lock file in XDG_RUNTIME_DIR, /run or /tmp: %s",
                 bus->url, strerror(errno));
    if (fd >= 0) close(fd);
    return -1;
}

// Set the size of the receive buffer, beyond the system's limit if the process runs as root.
static void enlarge_buffer(int fd, int size)
{
    if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &size, sizeof size) != 0)
        setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);
}

int kn_bus_listen(const kn_bus *bus, int buffer_bytes, char *error, size_t error_size)
{
    const int on = 1, off = 0;
    const struct ip_mreqn group = {.imr_multiaddr = bus->group.sin_addr, .imr_ifindex = bus->device};
    // IP_PKTINFO reports the network interface of each datagram. Without IP_MULTICAST_ALL the socket receives only the
    // groups that it joined itself.
    int fd = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd >= 0 && setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) == 0 &&
        setsockopt(fd, IPPROTO_IP, IP_PKTINFO, &on, sizeof on) == 0 &&
        setsockopt(fd, IPPROTO_IP, IP_MULTICAST_ALL, &off, sizeof off) == 0 &&
        bind(fd, (const struct sockaddr *)&bus->group, sizeof bus->group) == 0 &&
        setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) == 0) {
        enlarge_buffer(fd, buffer_bytes);
        return fd;
    }
    snprintf(error, error_size, "%s: cannot listen: %s%s", bus->url, strerror(errno),
             errno == EADDRINUSE ? "; ss -uap shows the program that does not share the port" : "");
    if (fd >= 0) close(fd);
    return -1;
}

// Return the index of the network interface over which a datagram arrived, or 0 if the kernel did not report it.
static int device_of(struct msghdr *header)
{
    for (struct cmsghdr *c = CMSG_FIRSTHDR(header); c; c = CMSG_NXTHDR(header, c)) {
        if (c->cmsg_level != IPPROTO_IP || c->cmsg_type != IP_PKTINFO) continue;
        struct in_pktinfo info;
        memcpy(&info, CMSG_DATA(c), sizeof info);
        return info.ipi_ifindex;
    }
    return 0;
}

void kn_bus_read(const kn_bus *bus, int fd, int limit, kn_datagram_batch *batch)
{
    struct mmsghdr header[KN_BATCH] = {0};
    struct iovec vector[KN_BATCH];
    struct sockaddr_in from[KN_BATCH] = {0};
    _Alignas(struct cmsghdr) char control[KN_BATCH][CMSG_SPACE(sizeof(struct in_pktinfo))];
    // Prepare one header for each datagram, so that one system call reads all datagrams.
    for (int i = 0; i < limit; i++) {
        vector[i] = (struct iovec){batch->datagram[i].bytes, KN_DATAGRAM_MAX};
        header[i].msg_hdr = (struct msghdr){.msg_name = &from[i],
                                            .msg_namelen = sizeof from[i],
                                            .msg_iov = &vector[i],
                                            .msg_iovlen = 1,
                                            .msg_control = control[i],
                                            .msg_controllen = sizeof control[i]};
    }
    int count = recvmmsg(fd, header, (unsigned)limit, 0, NULL);
    batch->count = count > 0 ? count : 0;
    for (int i = 0; i < batch->count; i++) {
        kn_datagram *datagram = &batch->datagram[i];
        datagram->size = header[i].msg_len;
        datagram->here = device_of(&header[i].msg_hdr) == bus->device;
        datagram->from = from[i].sin_addr;
    }
}

ssize_t kn_bus_take(const kn_bus *bus, int fd, void *bytes, size_t room, bool *here)
{
    _Alignas(struct cmsghdr) char control[CMSG_SPACE(sizeof(struct in_pktinfo))];
    struct iovec vector = {bytes, room};
    struct msghdr header = {
        .msg_iov = &vector, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
    ssize_t size = recvmsg(fd, &header, MSG_DONTWAIT);
    *here = size >= 0 && device_of(&header) == bus->device;
    return size;
}

kn_framing kn_bus_unpack(const unsigned char *bytes, size_t size, kn_packet *packet)
{
    enum { LC02 = 0x4c433032, LC03 = 0x4c433033, SHORT = 8, LONG = 20 };
    *packet = (kn_packet){0};
    if (size < SHORT) return KN_FRAME_RUNT;
    uint32_t magic = kn_bytes_32(bytes);
    if (magic != LC02 && magic != LC03) return KN_FRAME_MAGIC;
    // An LC03 header is 12 bytes longer than an LC02 header.
    size_t at = magic == LC03 ? LONG : SHORT;
    if (size < at) return KN_FRAME_RUNT;
    packet->sequence = kn_bytes_32(bytes + 4);
    packet->split = magic == LC03;
    if (packet->split) {
        packet->whole = kn_bytes_32(bytes + 8);
        packet->offset = kn_bytes_32(bytes + 12);
        packet->part = (uint16_t)(kn_bytes_32(bytes + 16) >> 16);
        packet->parts = (uint16_t)kn_bytes_32(bytes + 16);
    }
    // Only the first part of a split message carries the channel name.
    if (!packet->split || packet->part == 0) {
        size_t left = size - at;
        const char *name = (const char *)bytes + at;
        const char *end = memchr(name, 0, left < KN_CHANNEL_MAX ? left : KN_CHANNEL_MAX);
        if (!end) return KN_FRAME_CHANNEL_END;
        packet->channel = name;
        at += (size_t)(end - name) + 1;
    }
    packet->payload = bytes + at;
    packet->size = size - at;
    return KN_FRAMED;
}

uint32_t kn_bus_drops(int fd)
{
    uint32_t info[SK_MEMINFO_VARS] = {0};
    socklen_t size = sizeof info;
    return getsockopt(fd, SOL_SOCKET, SO_MEMINFO, info, &size) == 0 ? info[SK_MEMINFO_DROPS] : 0;
}

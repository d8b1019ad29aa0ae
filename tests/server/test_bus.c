#include "server/bus.h"
#include "tests/check.h"
#include "tests/words.h"
#include <arpa/inet.h>
#include <fcntl.h>
#include <net/if.h>
#include <sched.h>
#include <unistd.h>

TEST("a URL with a multicast group and a port is accepted as a bus")
{
    static const char *const good[] = {"udpm://239.255.76.67:7667", "udpm://224.0.0.251:1",
                                       "udpm://239.255.76.67:7667?ttl=0",
                                       "udpm://239.255.76.67:65535?ttl=0&recv_buf_size=4194304"};
    kn_bus bus;
    char error[256] = "";
    for (int i = 0; i < 4; i++) {
        if (!kn_bus_parse(&bus, good[i], NULL, error, sizeof error)) KN_TEST_FAIL("refused: %s", error);
        CHECK(bus.group.sin_family == AF_INET && bus.url == good[i]);
        CHECK(i != 2 || (ntohs(bus.group.sin_port) == 7667 && ntohl(bus.group.sin_addr.s_addr) == 0xefff4c43));
    }
}

TEST("any other URL is refused in one line that names what was expected")
{
    static const char urls[] =
        "|udpm://|tcpq://localhost:7700|memq://|file://a.lcmlog|mpudpm://239.255.76.67:7667|udpm://127.0.0.1:7667|"
        "udpm://10.0.0.1:7667|udpm://239.255.76.67|udpm://239.255.76.67:0|udpm://239.255.76.67:65536|"
        "udpm://239.255.76.67:7667x|udpm://239.255.76.67:7667/|udpm://239.255.76.300:7667";
    // behind udpm://239.255.76.67:7667?; liblcm takes the last ttl, in any notation of numbers
    static const char options[] = "ttl=1|a=b&ttl=255|a=b,ttl=1|ttl=0&ttl=1|ttl=0&ttl=0|ttl=0,ttl=1|attl=0&ttl=1|"
                                  "ttl= 0x1|ttl= 0|ttl=0x1|ttl=0x0|ttl=+0|ttl=-0|ttl=08|ttl=0 |ttl=|ttl|ttl=256|"
                                  "ttl=99999999999999999999";
    for (int i = 0, more = 0; word_of(options, more); i++) {
        char url[256], error[256] = "";
        kn_bus bus;
        if (word_of(urls, i)) strcpy(url, word_of(urls, i));
        else snprintf(url, sizeof url, "udpm://239.255.76.67:7667?%s", word_of(options, more++));
        if (kn_bus_parse(&bus, url, NULL, error, sizeof error)) KN_TEST_FAIL("accepted: %s", url);
        CHECK(strstr(error, "expected") && !strchr(error, '\n') && strncmp(error, url, strlen(url)) == 0);
    }
}

// --- another interface beside lo ---

static bool write_text(const char *path, const char *text)
{
    int fd = open(path, O_WRONLY);
    bool written = fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text);
    if (fd >= 0) close(fd);
    return written;
}

// Enter a network of this process alone: lo, and a card with an address.
static bool enter_network(void)
{
    char map[40];
    snprintf(map, sizeof map, "0 %u 1", geteuid());
    bool own = geteuid() == 0 ? unshare(CLONE_NEWNET) == 0
                              : unshare(CLONE_NEWUSER | CLONE_NEWNET) == 0 && write_text("/proc/self/uid_map", map);
    return own && system("exec 2>/dev/null; ip link set lo up && ip link add card type veth peer name far &&"
                         "ip addr add 10.9.0.1/24 dev card && ip link set card up && ip link set far up") == 0;
}

// Send over an interface. The sender also hears the datagram itself over that interface, like the other end.
static bool send_over(const char *interface, const kn_bus *bus, const char *text)
{
    int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0), size = (int)strlen(text);
    const struct ip_mreqn over = {.imr_ifindex = (int)if_nametoindex(interface)};
    bool sent = fd >= 0 && setsockopt(fd, IPPROTO_IP, IP_MULTICAST_IF, &over, sizeof over) == 0 &&
                sendto(fd, text, (size_t)size, 0, (const struct sockaddr *)&bus->group, sizeof bus->group) == size;
    if (fd >= 0) close(fd);
    return sent;
}

TEST("a datagram from another interface is not delivered or is marked as foreign")
{
    kn_bus bus;
    static kn_datagram_batch batch;
    char error[256] = "";
    if (kn_test_failures > 0) return; // SKIP would hide an earlier failure
    if (!enter_network()) SKIP("no network of its own, or no ip (package iproute2)");
    CHECK(kn_bus_parse(&bus, "udpm://239.255.76.67:7667?ttl=0", NULL, error, sizeof error));
    int fd = kn_bus_listen(&bus, 1 << 20, error, sizeof error);
    if (fd < 0) KN_TEST_FAIL("%s", error);
    const struct ip_mreqn too = {.imr_multiaddr = bus.group.sin_addr, .imr_ifindex = (int)if_nametoindex("card")};
    int other = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0); // another socket joins the group on the card
    CHECK(other >= 0 && setsockopt(other, IPPROTO_IP, IP_ADD_MEMBERSHIP, &too, sizeof too) == 0);
    CHECK(send_over("lo", &bus, "lo") && send_over("card", &bus, "card"));
    kn_bus_read(&bus, fd, KN_BATCH, &batch);
    CHECK(batch.count == 1 && batch.datagram[0].here && memcmp(batch.datagram[0].bytes, "lo", 2) == 0);
    CHECK(setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &too, sizeof too) == 0);
    CHECK(send_over("card", &bus, "card") && send_over("lo", &bus, "lo"));
    kn_bus_read(&bus, fd, KN_BATCH, &batch);
    CHECK(batch.count == 2);
    for (int i = 0; i < batch.count; i++) CHECK(batch.datagram[i].here == (batch.datagram[i].size == 2));
    close(other);
    close(fd);
}

TESTS_MAIN

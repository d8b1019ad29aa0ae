#include "server/bus.h"
#include "tests/check.h"
#include <arpa/inet.h>

TEST("a multicast group and a port are a bus")
{
    const char *good[] = {"udpm://239.255.76.67:7667", "udpm://239.255.76.67:7667?ttl=0", "udpm://224.0.0.251:1",
                          "udpm://239.255.76.67:65535?ttl=0&recv_buf_size=4194304"};
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
        kn_bus bus;
        char error[256] = "";
        if (!kn_bus_parse(&bus, good[i], NULL, error, sizeof error)) KN_TEST_FAIL("refused: %s", error);
        CHECK(bus.group.sin_family == AF_INET && bus.url == good[i]);
    }
    kn_bus bus;
    char error[256];
    CHECK(kn_bus_parse(&bus, good[1], NULL, error, sizeof error));
    CHECK(ntohs(bus.group.sin_port) == 7667 && ntohl(bus.group.sin_addr.s_addr) == 0xefff4c43);
}

TEST("anything else is refused in one line that names what was expected")
{
    const char *bad[] = {"",
                         "udpm://",
                         "tcpq://localhost:7700",
                         "memq://",
                         "file://a.lcmlog",
                         "mpudpm://239.255.76.67:7667",
                         "udpm://127.0.0.1:7667",
                         "udpm://10.0.0.1:7667",
                         "udpm://239.255.76.67",
                         "udpm://239.255.76.67:0",
                         "udpm://239.255.76.67:65536",
                         "udpm://239.255.76.67:7667x",
                         "udpm://239.255.76.67:7667/",
                         "udpm://239.255.76.300:7667",
                         "udpm://239.255.76.67:7667?ttl=1",
                         "udpm://239.255.76.67:7667?a=b&ttl=255",
                         "udpm://239.255.76.67:7667?a=b,ttl=1",
                         "udpm://239.255.76.67:7667?ttl=0&ttl=1", // liblcm takes the last
                         "udpm://239.255.76.67:7667?ttl=0&ttl=0",
                         "udpm://239.255.76.67:7667?ttl=0,ttl=1",
                         "udpm://239.255.76.67:7667?attl=0&ttl=1",
                         "udpm://239.255.76.67:7667?ttl= 0x1", // and any number
                         "udpm://239.255.76.67:7667?ttl= 0",
                         "udpm://239.255.76.67:7667?ttl=0x1",
                         "udpm://239.255.76.67:7667?ttl=0x0",
                         "udpm://239.255.76.67:7667?ttl=+0",
                         "udpm://239.255.76.67:7667?ttl=-0",
                         "udpm://239.255.76.67:7667?ttl=08",
                         "udpm://239.255.76.67:7667?ttl=0 ",
                         "udpm://239.255.76.67:7667?ttl=",
                         "udpm://239.255.76.67:7667?ttl",
                         "udpm://239.255.76.67:7667?ttl=256",
                         "udpm://239.255.76.67:7667?ttl=99999999999999999999"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        kn_bus bus;
        char error[256] = "";
        if (kn_bus_parse(&bus, bad[i], NULL, error, sizeof error)) KN_TEST_FAIL("accepted: %s", bad[i]);
        CHECK(strstr(error, "expected") && !strchr(error, '\n') && strncmp(error, bad[i], strlen(bad[i])) == 0);
    }
}

TESTS_MAIN

// sniff DEVICE: count the IPv4 multicast datagrams and IGMP messages that leave by DEVICE until SIGTERM, then print
// the number. First print "ready", once the socket hears.
#include <arpa/inet.h>
#include <linux/if_packet.h>
#include <net/ethernet.h>
#include <net/if.h>
#include <netinet/ip.h>
#include <signal.h>
#include <stdio.h>
#include <sys/socket.h>

static volatile sig_atomic_t stop;
static void on_term(int number) { stop = number; }

int main(int argc, char **argv)
{
    struct sockaddr_ll device = {.sll_family = AF_PACKET, .sll_protocol = htons(ETH_P_ALL)};
    int fd = socket(AF_PACKET, SOCK_DGRAM, htons(ETH_P_ALL)), count = 0;
    device.sll_ifindex = argc == 2 ? (int)if_nametoindex(argv[1]) : 0;
    if (fd < 0 || !device.sll_ifindex || bind(fd, (struct sockaddr *)&device, sizeof device) != 0) return 3;
    // without SA_RESTART, so that recvfrom returns
    sigaction(SIGTERM, &(struct sigaction){.sa_handler = on_term}, NULL);
    puts("ready");
    fflush(stdout);
    while (!stop) {
        struct ip ip = {0};
        struct sockaddr_ll from = {0};
        socklen_t size = sizeof from;
        if (recvfrom(fd, &ip, sizeof ip, 0, (struct sockaddr *)&from, &size) < (ssize_t)sizeof ip) continue;
        if (from.sll_pkttype != PACKET_OUTGOING || from.sll_protocol != htons(ETH_P_IP)) continue;
        count += ip.ip_p == IPPROTO_IGMP || IN_MULTICAST(ntohl(ip.ip_dst.s_addr));
    }
    printf("%d\n", count);
    return 0;
}

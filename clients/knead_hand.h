#ifndef KNEAD_HAND_H
#define KNEAD_HAND_H
// A hand of a running kneadd on this machine, in C or C++, without a library: copy this header (clients/python has the
// same in Python, clients/knead_hand.js in JavaScript).
//
//     kn_hand hand;
//     if (!kn_hand_open(&hand, "finger")) ...            the tool's name in the scene; errno says why not
//     kn_hand_move(&hand, position_m, velocity_m_s, force_n);   1000 times a second: waits for the next millisecond
//     kn_hand_close(&hand);                              its force fades without a fault, and the tool is free at once
//
// Needs POSIX and multicast (cc -std=gnu17, the default). The bus is that of LCM_DEFAULT_URL, else LCM's own.
// Poses and forces are LCM messages of one datagram (proto/README.md). The hand has a watchdog of its own: it holds a
// force for 3 ms, fades it to 0 N by 20 ms, and then sends no poses for 1.2 s, which ends the session.
#include <arpa/inet.h>
#include <errno.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

typedef struct kn_hand {
    double force_n[3];   // newest force of kneadd on the hand, before the watchdog
    double contact_n[3]; // force of the object on the tool in the same message, before the limits of the device
    int32_t flags;       // FLAG_* of proto/contact_force_t.lcm
    const char *trouble; // why there is no force, ""; valid after kn_hand_move
    int socket;          // private from here on
    struct sockaddr_in group;
    char pose[64], force[64]; // channels
    int64_t session, seq, tick, next_ns, heard_ns, silent_ns, count, wall_ns;
    double last_m[3], last_m_s[3]; // newest pose
} kn_hand;

// Bits of `flags`: the tool acts on the object; a fault holds the force at 0.
enum { KN_HAND_ENGAGED = 1, KN_HAND_LATCHED = 4 };
enum { KN_HAND_POSE = 125, KN_HAND_FORCE = 249 }; // sizes of probe_pose_t and contact_force_t [bytes]

static inline int64_t kn_hand_now(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static inline void kn_hand_put(unsigned char *at, uint64_t value, int bytes) // big-endian
{
    for (int i = 0; i < bytes; i++) at[i] = (unsigned char)(value >> 8 * (bytes - 1 - i));
}

static inline uint64_t kn_hand_get(const unsigned char *at, int bytes)
{
    uint64_t value = 0;
    for (int i = 0; i < bytes; i++) value = value << 8 | at[i];
    return value;
}

static inline void kn_hand_put_doubles(unsigned char *at, const double *values, int count)
{
    for (int i = 0; i < count; i++) {
        uint64_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        kn_hand_put(at + 8 * i, bits, 8);
    }
}

static inline bool kn_hand_open(kn_hand *h, const char *tool)
{
    const int on = 1;
    const char *url = getenv("LCM_DEFAULT_URL");
    char address[16] = "239.255.76.67";
    unsigned port = 7667, hops = 0;
    struct ip_mreq member;
    if (url) sscanf(url, "udpm://%15[0-9.]:%u?ttl=%u", address, &port, &hops);
    const unsigned char ttl = (unsigned char)hops;
    memset(h, 0, sizeof *h);
    memset(&member, 0, sizeof member);
    snprintf(h->pose, sizeof h->pose, "KNEAD_POSE_%.40s", tool);
    snprintf(h->force, sizeof h->force, "KNEAD_FORCE_%.40s", tool);
    h->trouble = "";
    h->session = kn_hand_now(CLOCK_REALTIME);
    h->next_ns = kn_hand_now(CLOCK_MONOTONIC);
    h->wall_ns = kn_hand_now(CLOCK_REALTIME) - h->next_ns; // read once: a clock that is set back would end the session
    h->group.sin_family = AF_INET;
    h->group.sin_port = htons((uint16_t)port);
    member.imr_multiaddr.s_addr = h->group.sin_addr.s_addr = inet_addr(address);
    h->socket = socket(AF_INET, SOCK_DGRAM, 0);
    if (h->socket >= 0 && setsockopt(h->socket, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) == 0 &&
        setsockopt(h->socket, SOL_SOCKET, SO_REUSEPORT, &on, sizeof on) == 0 &&
        bind(h->socket, (const struct sockaddr *)&h->group, sizeof h->group) == 0 &&
        setsockopt(h->socket, IPPROTO_IP, IP_ADD_MEMBERSHIP, &member, sizeof member) == 0 &&
        setsockopt(h->socket, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl) == 0)
        return true;
    if (h->socket >= 0) close(h->socket);
    h->socket = -1;
    return false;
}

static inline void kn_hand_send(kn_hand *h, const double position_m[3], const double velocity_m_s[3], int32_t buttons)
{
    unsigned char data[8 + 64 + KN_HAND_POSE] = {0}, *p;
    const double upright[4] = {1, 0, 0, 0};
    memmove(h->last_m, position_m, sizeof h->last_m);
    memmove(h->last_m_s, velocity_m_s, sizeof h->last_m_s);
    const int64_t now_ns = kn_hand_now(CLOCK_MONOTONIC);
    kn_hand_put(data, 0x4c433032, 4); // "LC02", a message of one datagram
    kn_hand_put(data + 4, (uint64_t)++h->count, 4);
    memcpy(data + 8, h->pose, strlen(h->pose));
    p = data + 8 + strlen(h->pose) + 1;
    kn_hand_put(p, 0xedade4a5caa88ff7, 8); // fingerprint of probe_pose_t
    kn_hand_put(p + 8, (uint64_t)((h->wall_ns + now_ns) / 1000), 8);
    kn_hand_put(p + 16, (uint64_t)h->session, 8);
    kn_hand_put(p + 24, (uint64_t)++h->seq, 8);
    kn_hand_put(p + 32, (uint64_t)now_ns, 8);
    kn_hand_put_doubles(p + 40, position_m, 3);
    kn_hand_put_doubles(p + 64, upright, 4);
    kn_hand_put_doubles(p + 96, velocity_m_s, 3);
    kn_hand_put(p + 120, (uint32_t)buttons, 4);
    // a pose that is not sent is a pose lost: the watchdogs of both sides see to it
    (void)!sendto(h->socket, data, (size_t)(p - data) + KN_HAND_POSE, 0, (const struct sockaddr *)&h->group,
                  sizeof h->group);
}

static inline void kn_hand_receive(kn_hand *h)
{
    unsigned char data[2048];
    const size_t name = strlen(h->force) + 1;
    ssize_t size;
    while ((size = recv(h->socket, data, sizeof data, MSG_DONTWAIT)) >= 0) {
        const unsigned char *p = data + 8 + name;
        if ((size_t)size < 8 + name + KN_HAND_FORCE || kn_hand_get(data, 4) != 0x4c433032) continue;
        if (memcmp(data + 8, h->force, name) != 0 || kn_hand_get(p, 8) != 0x75bbe2590573aa90) continue;
        const int64_t session = (int64_t)kn_hand_get(p + 16, 8), tick = (int64_t)kn_hand_get(p + 40, 8);
        // a force for another session is for another hand; a repeated force does not reset its age
        if (session != h->session || (h->heard_ns && tick <= h->tick)) continue;
        h->tick = tick;
        h->heard_ns = kn_hand_now(CLOCK_MONOTONIC);
        h->flags = (int32_t)kn_hand_get(p + 240, 4);
        for (int k = 0; k < 3; k++) {
            const uint64_t contact = kn_hand_get(p + 56 + 8 * k, 8), force = kn_hand_get(p + 104 + 8 * k, 8);
            memcpy(&h->contact_n[k], &contact, sizeof contact);
            memcpy(&h->force_n[k], &force, sizeof force);
        }
    }
}

// Wait for the next millisecond, send a pose, and store the force to give to the hand.
static inline void kn_hand_move(kn_hand *h, const double position_m[3], const double velocity_m_s[3], double force_n[3])
{
    const int64_t ms = 1000000, hold = 3 * ms, zero = 20 * ms;
    int64_t now_ns = kn_hand_now(CLOCK_MONOTONIC);
    h->next_ns = h->next_ns + ms > now_ns - ms ? h->next_ns + ms : now_ns; // if late, do not catch up
    struct timespec until = {h->next_ns / 1000000000, h->next_ns % 1000000000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
    now_ns = kn_hand_now(CLOCK_MONOTONIC);
    if (h->silent_ns && now_ns >= h->silent_ns) // begin a new session
        h->session = kn_hand_now(CLOCK_REALTIME), h->silent_ns = h->heard_ns = 0;
    if (!h->silent_ns) kn_hand_send(h, position_m, velocity_m_s, 0);
    kn_hand_receive(h);
    const int64_t age = h->heard_ns ? kn_hand_now(CLOCK_MONOTONIC) - h->heard_ns : zero;
    if (h->heard_ns && age >= zero && !h->silent_ns) h->silent_ns = now_ns + 1200 * ms;
    double factor = age < hold ? 1 : (double)(zero - age) / (double)(zero - hold);
    if (h->silent_ns || age >= zero) factor = 0;
    for (int k = 0; k < 3; k++) force_n[k] = factor * h->force_n[k];
    h->trouble = factor == 0                  ? "no force from kneadd: is it running?"
                 : h->flags & KN_HAND_LATCHED ? "latched: lift the tool"
                                              : "";
}

static inline void kn_hand_close(kn_hand *h)
{
    if (h->socket < 0) return;
    if (h->heard_ns && !h->silent_ns) kn_hand_send(h, h->last_m, h->last_m_s, 1 << 30); // leaving, from where it is
    close(h->socket);
    h->socket = -1;
}

#endif

#include "clients/knead/join.h"
#include "server/auth.h"
#include "server/bus.h"
#include "server/daemon.h"
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static kn_auth auth;
static bool keyed;

static int buffer_bytes(void)
{
    int most = 4 << 20, allowed = most; // 4 MiB: 1 s of meshes; asking for more than allowed makes liblcm complain
    FILE *f = fopen("/proc/sys/net/core/rmem_max", "r");
    if (f) {
        if (fscanf(f, "%d", &allowed) != 1) allowed = most;
        fclose(f);
    }
    return allowed < most ? allowed : most;
}

static const char *lan(void)
{
    const char *name = getenv("KNEAD_LAN");
    return name && *name ? name : NULL;
}

static const char *choose(const char *url, const char *otherwise)
{
    bool meshes = strcmp(otherwise, KN_FORCE_URL) != 0;
    const char *set = meshes ? NULL : getenv("LCM_DEFAULT_URL");
    if (!url) url = set && *set ? set : lan() ? meshes ? KN_MESH_LAN_URL : KN_LCM_LAN_URL : otherwise;
    return url;
}

static bool take_key(char *error, size_t error_size)
{
    const char *key = getenv("KNEAD_KEY");
    return !key || !*key || keyed || (keyed = kn_auth_load(&auth, key, error, error_size));
}

static bool parse(kn_bus *bus, const char *url, char *error, size_t error_size)
{
    return take_key(error, error_size) && kn_bus_parse(bus, url, lan(), error, error_size);
}

bool kn_join_check(const char *url, const char *otherwise, char *error, size_t error_size)
{
    return parse(&(kn_bus){0}, choose(url, otherwise), error, error_size);
}

lcm_t *kn_join(const char *url, const char *otherwise, char *error, size_t error_size)
{
    char full[256];
    kn_bus bus;
    url = choose(url, otherwise);
    if (!strcmp(url, KN_MEMORY_URL)) return take_key(error, error_size) ? lcm_create(url) : NULL;
    if (!parse(&bus, url, error, error_size) || !kn_bus_check_route(&bus, error, error_size)) return NULL;
    snprintf(full, sizeof full, strstr(url, "recv_buf_size=") ? "%s" : strchr(url, '?') ? "%s&recv_buf_size=%d" :
             "%s?recv_buf_size=%d", url, buffer_bytes());
    lcm_t *lcm = lcm_create(full);
    if (!lcm) snprintf(error, error_size, "%s: LCM cannot join the group", url);
    return lcm;
}

int kn_join_send(lcm_t *lcm, const char *channel, uint8_t *bytes, int size)
{
    if (keyed) size = (int)kn_auth_sign(&auth, channel, bytes, (size_t)size);
    return lcm_publish(lcm, channel, bytes, (unsigned)size);
}

bool kn_join_heard(const lcm_recv_buf_t *buf, const char *channel)
{
    return !keyed || kn_auth_check(&auth, channel, buf->data, buf->data_size);
}

int kn_join_priority(int priority)
{
    return pthread_setschedparam(pthread_self(), priority > 0 ? SCHED_FIFO : SCHED_OTHER,
                                 &(struct sched_param){.sched_priority = priority});
}

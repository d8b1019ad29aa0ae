#include "clients/knead/join.h"
#include "server/bus.h"
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

static const char *choose(const char *url, const char *otherwise)
{
    const char *set = strcmp(otherwise, KN_FORCE_URL) ? NULL : getenv("LCM_DEFAULT_URL");
    return url ? url : set && *set ? set : otherwise;
}

bool kn_join_check(const char *url, const char *otherwise, char *error, size_t error_size)
{
    return kn_bus_parse(&(kn_bus){0}, choose(url, otherwise), error, error_size);
}

lcm_t *kn_join(const char *url, const char *otherwise, char *error, size_t error_size)
{
    char full[256];
    kn_bus bus;
    url = choose(url, otherwise);
    if (!kn_bus_parse(&bus, url, error, error_size) || !kn_bus_check_route(&bus, error, error_size)) return NULL;
    snprintf(full, sizeof full, strstr(url, "recv_buf_size=") ? "%s" : strchr(url, '?') ? "%s&recv_buf_size=%d" :
             "%s?recv_buf_size=%d", url, buffer_bytes());
    lcm_t *lcm = lcm_create(full);
    if (!lcm) snprintf(error, error_size, "%s: LCM cannot join the group", url);
    return lcm;
}

int kn_join_priority(int priority)
{
    return pthread_setschedparam(pthread_self(), priority > 0 ? SCHED_FIFO : SCHED_OTHER,
                                 &(struct sched_param){.sched_priority = priority});
}

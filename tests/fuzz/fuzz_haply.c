// libFuzzer target: any bytes from an Inverse Service are a state with usable numbers, a missing arm, or one line of
// error. For any name of the arm, the answer is shorter than a message may be.
#include "clients/tactile/haply.h"
#include "tests/fuzz/fuzz.h"
#include <math.h>
#include <string.h>

static void judge(const uint8_t *data, size_t size, const char *device_id)
{
    char error[100] = "", text[KN_HAPLY_MESSAGE];
    kn_haply_state s;
    kn_haply_heard heard = kn_haply_read((const char *)data, size, device_id, &s, error, sizeof error);
    for (const char *c = error; *c; c++) require(*c >= ' ' && *c <= '~');
    if (heard == KN_HAPLY_MALFORMED) require(*error);
    if (heard != KN_HAPLY_STATE) return;
    require(kn_haply_id_known(s.device_id) && (!*device_id || !strcmp(device_id, s.device_id)));
    double *q = s.pose.orientation_wxyz, length = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    require(fabs(length - 1.0) < 1e-9 && (s.pose.buttons & ~7) == 0);
    for (int i = 0; i < 3; i++) require(fabs(s.pose.position_m[i]) <= 1.0 && fabs(s.pose.velocity_m_s[i]) <= 100.0);
    require(kn_haply_push(text, s.device_id, s.pose.velocity_m_s) < KN_HAPLY_MESSAGE);
    require(kn_haply_greet(text, s.device_id, s.device_id) < KN_HAPLY_MESSAGE);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    judge(data, size, "");
    judge(data, size, "049D");
    return 0;
}

// libFuzzer target: for any sequence of datagrams, a client's receiver passes on only messages of channels that it
// listens to, whole and within bounds. The code that assembles meshes and scenes accepts or drops them.
//
// A record of the input is a control byte, then a datagram. Bits 0-1: as it is, LC02, LC03 with valid bounds, LC03
// with any bounds. Bits 2-4: the channel. Bits 5-7: the part; for LC02, 4 and above: signed, 6: as an answer to a
// hello.
#include "clients/hand/bus_client.h"
#include "clients/knead_mesh.h"
#include "proto/knead_contact_force_t.h"
#include "server/wire.h"
#include "tests/fuzz/fuzz.h"
#include "tests/server/datagram.h"
#include <unistd.h>

static const char *const channels[] = {"KNEAD_FORCE_a", "KNEAD_SCENE",      "KNEAD_MESH_INIT", "KNEAD_MESH_UPDATE",
                                       "KNEAD_STATUS",  "KNEAD_FORCE_\x1b", "KNEAD_FORCE_",    "KNEAD_POSE_b"};
static kn_mesh mesh;
static int handed;
static kn_auth auth;

static void on_message(const lcm_recv_buf_t *buf, const char *channel, void *user)
{
    const uint8_t *bytes = buf->data;
    unsigned sum = 0;
    knead_contact_force_t force;
    (void)user;
    handed++;
    require(strncmp(channel, "KNEAD_", 6) == 0 && buf->data_size <= KN_BUS_CLIENT_LARGEST);
    require(strcmp(channel, channels[5]) != 0 && strcmp(channel, channels[6]) != 0);
    for (uint32_t i = 0; i < buf->data_size; i++) sum += bytes[i]; // read every byte, so that a sanitizer checks it
    if (sum == 1) handed++;
    knead_contact_force_t_decode(buf->data, 0, (int)buf->data_size, &force);
    kn_wire_scene_fits(buf->data, buf->data_size);
    kn_mesh_init(&mesh, buf->data, buf->data_size);
    kn_mesh_update(&mesh, buf->data, buf->data_size);
}

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    char path[] = "/tmp/fuzz-key-XXXXXX", error[200];
    int fd = mkstemp(path);
    (void)argc, (void)argv;
    for (int i = 0; i < KN_AUTH_KEY; i++) dprintf(fd, "%02x", i);
    close(fd);
    setenv("KNEAD_KEY", path, 1);
    require(kn_auth_load(&auth, path, error, sizeof error) &&
            kn_bus_client_check(NULL, KN_FORCE_URL, error, sizeof error));
    unlink(path);
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static unsigned char bytes[2048];
    char error[200];
    kn_bus_client *join[2]; // the first ignores tags
    for (int n = 0; n < 2; n++) {
        join[n] = kn_bus_client_open(KN_MEMORY_URL, KN_FORCE_URL, error, sizeof error);
        require(join[n] != NULL);
        kn_bus_client_hear(join[n], "KNEAD_FORCE_*", on_message, NULL);
        for (int i = 1; i < 5; i++) kn_bus_client_hear(join[n], channels[i], on_message, NULL);
    }
    kn_bus_client_trust(join[0]);
    uint32_t offset = 0;
    for (const uint8_t *at = data, *end = data + size; end - at > 3;) {
        unsigned control = *at++, count = *at++, part = control >> 5;
        const char *channel = channels[control >> 2 & 7];
        size_t n = count < (size_t)(end - at) ? count : (size_t)(end - at), whole = 0;
        uint32_t any = (uint32_t)at[0] << 24 | count;
        if (part == 0) offset = 0;
        if ((control & 3) == 0) memcpy(bytes, at, whole = n);
        if ((control & 3) == 1) whole = kn_lc02(bytes, sizeof bytes, part == 6 ? KN_LIFE_CHANNEL : channel, at, n);
        if ((control & 3) == 1 && part >= 4)
            whole = kn_sign_datagram(bytes, whole, part == 6 ? KN_LIFE_CHANNEL : channel, &auth,
                                     (kn_auth_stamp){at[0] & 3, at[1]});
        if ((control & 3) == 2) whole = kn_lc03(bytes, 7, 3 * count, offset, (uint16_t)part, 3, channel, n);
        if ((control & 3) == 3)
            whole = kn_lc03(bytes, any, any, any >> part, (uint16_t)part, (uint16_t)any, channel, n);
        if ((control & 3) == 2) offset += (uint32_t)n;
        // allocated with exactly that size, so that an access beyond is found
        unsigned char *copy = malloc(whole ? whole : 1);
        memcpy(copy, bytes, whole);
        for (int i = 0; i < 2; i++) kn_bus_client_take(join[i], copy, whole);
        free(copy);
        at += n;
    }
    for (int i = 0; i < 2; i++) kn_bus_client_close(join[i]);
    kn_mesh_free(&mesh);
    return 0;
}

#include "server/publisher.h"
#include "server/wire.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// room for a message of any type of fixed size, bytes; the largest type, status_t, has about 1 kB
#define ROOM_FIXED 2048
_Static_assert(sizeof(knead_status_t) + 64 <= ROOM_FIXED, "a status fits");

bool kn_publisher_open(kn_publisher *p, const char *url, const kn_scene *scene, uint64_t initial_hash, char *error,
                       size_t error_size)
{
    *p = (kn_publisher){.scene = scene, .initial_hash = initial_hash};
    // format the channel names once, not for every force
    for (int i = 0; i < scene->model.probe_count; i++) {
        snprintf(p->force_channel[i], sizeof p->force_channel[i], "KNEAD_FORCE_%s", scene->model.probe[i].name);
        snprintf(p->touch_channel[i], sizeof p->touch_channel[i], "KNEAD_TOUCH_%s", scene->model.probe[i].name);
        snprintf(p->contact_channel[i], sizeof p->contact_channel[i], "KNEAD_CONTACT_%s", scene->model.probe[i].name);
    }
    p->lcm = kn_publisher_go_over(p, scene) ? lcm_create(url) : NULL;
    if (p->lcm) return true;
    snprintf(error, error_size, "%s: %s", url, p->bytes ? "LCM refused this URL" : "out of memory");
    kn_publisher_close(p);
    return false;
}

bool kn_publisher_go_over(kn_publisher *p, const kn_scene *scene)
{
    knead_scene_t message;
    // the scene is the only message whose size varies: allocate room for it now, not while publishing
    kn_wire_scene(&message, scene, p->initial_hash, 0);
    int room = ROOM_FIXED + knead_scene_t_encoded_size(&message);
    if (room > p->room) {
        uint8_t *bytes = realloc(p->bytes, (size_t)room + KN_AUTH_TRAILER);
        if (!bytes) return false;
        p->bytes = bytes;
        p->room = room;
    }
    p->scene = scene;
    return true;
}

void kn_publisher_close(kn_publisher *p)
{
    if (p->lcm) lcm_destroy(p->lcm);
    free(p->bytes);
    p->lcm = NULL;
    p->bytes = NULL;
}

// Sign and send the message that is encoded in p->bytes. `size` <= 0: encoding has failed.
static void send_bytes(kn_publisher *p, const char *channel, int size)
{
    if (size > 0 && p->auth)
        size = (int)kn_auth_sign(p->auth, channel, p->bytes, (size_t)size, kn_auth_now(p->auth, &p->signed_us));
    // a message that does not fit or is refused counts as failed; later messages are not affected
    bool sent = size > 0 && lcm_publish(p->lcm, channel, p->bytes, (unsigned)size) == 0;
    p->published += sent;
    p->failed += !sent;
}

void kn_publisher_answer(kn_publisher *p, const unsigned char nonce[KN_AUTH_NONCE])
{
    memcpy(p->bytes, nonce, KN_AUTH_NONCE);
    send_bytes(p, KN_LIFE_CHANNEL, KN_AUTH_NONCE);
}

void kn_publisher_record(kn_publisher *p, const kn_record *record)
{
    for (int i = 0; i < record->out.event_count; i++) {
        knead_event_t message;
        kn_wire_event(&message, &record->out.event[i], record->utime);
        send_bytes(p, "KNEAD_EVENT", knead_event_t_encode(p->bytes, 0, p->room, &message));
    }
    for (int i = 0; i < record->out.probes; i++) {
        if (!record->out.force[i].live) continue;
        // publish the force first, because a hand waits for it
        knead_contact_force_t message;
        kn_wire_force(&message, &record->out, i, record->utime, record->execution_ns);
        send_bytes(p, p->force_channel[i], knead_contact_force_t_encode(p->bytes, 0, p->room, &message));
        if (!record->out.local) continue;
        // send one datagram per contact unit; for a probe that touches nothing, send one datagram with contact_count 0
        const kn_contact_unit *unit = record->out.contact[i];
        for (int c = 0; c == 0 || c < unit->contact_count; c++) {
            knead_contact_model_t contact;
            kn_wire_contact(&contact, &unit[c], record->utime);
            send_bytes(p, p->contact_channel[i], knead_contact_model_t_encode(p->bytes, 0, p->room, &contact));
        }
    }
}

void kn_publisher_touch(kn_publisher *p, const kn_touched *touched)
{
    knead_touch_patch_t message;
    kn_wire_touch(&message, &touched->touch, touched->session, touched->pose_seq, touched->utime);
    send_bytes(p, p->touch_channel[touched->probe], knead_touch_patch_t_encode(p->bytes, 0, p->room, &message));
}

void kn_publisher_scene(kn_publisher *p, int64_t utime)
{
    knead_scene_t message;
    kn_wire_scene(&message, p->scene, p->initial_hash, utime);
    send_bytes(p, "KNEAD_SCENE", knead_scene_t_encode(p->bytes, 0, p->room, &message));
}

void kn_publisher_status(kn_publisher *p, const knead_status_t *status)
{
    send_bytes(p, "KNEAD_STATUS", knead_status_t_encode(p->bytes, 0, p->room, status));
}

void kn_publisher_health(kn_publisher *p, const knead_health_t *health)
{
    send_bytes(p, "KNEAD_HEALTH", knead_health_t_encode(p->bytes, 0, p->room, health));
}

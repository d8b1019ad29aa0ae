#include "server/operator.h"
#include <inttypes.h>
#include <math.h>
#include <string.h>
#include <time.h>

#define PATIENCE_MS 500 // for a tick or the main thread: longer, and this is no running server

void kn_operator_init(kn_operator *o, const kn_scene *scene, kn_loop *loop)
{
    *o = (kn_operator){.scene = scene, .loop = loop};
    kn_mailbox_init(&o->health, o->health_slots, sizeof o->health_slots[0]);
}

static void rest(void)
{
    nanosleep(&(struct timespec){.tv_nsec = 500000}, NULL);
}

// --- status ---

static json_t *names_of(int32_t bits, const char *const names[], int count)
{
    json_t *array = json_array();
    for (int i = 0; i < count; i++)
        if (bits >> i & 1) json_array_append_new(array, json_string(names[i]));
    return array;
}

// Upper bounds of the buckets, us: what share of the ticks took less.
static json_t *histogram(const int64_t count[KN_HISTOGRAM])
{
    static const struct {
        const char *name;
        double share;
    } wanted[] = {{"p50", 0.5}, {"p99", 0.99}, {"p999", 0.999}, {"max", 1.0}};
    json_t *object = json_object();
    int64_t all = 0;
    for (int i = 0; i < KN_HISTOGRAM; i++) all += count[i];
    for (size_t w = 0; w < sizeof wanted / sizeof *wanted; w++) {
        int64_t least = (int64_t)ceil(wanted[w].share * (double)all), seen = 0;
        int bucket = 0;
        while (bucket < KN_HISTOGRAM - 1 && (seen += count[bucket]) < least) bucket++;
        json_object_set_new(object, wanted[w].name, json_integer((json_int_t)1 << bucket));
    }
    return object;
}

static json_t *rejections(const knead_status_t *s)
{
    json_t *object = json_object();
    for (int i = 0; i < KN_REJECT_COUNT; i++)
        json_object_set_new(object, kn_verdict_name((kn_verdict)i), json_integer(s->rejected[i]));
    return object;
}

static json_t *probes(const kn_operator *o, const kn_health *h)
{
    json_t *array = json_array();
    for (int p = 0; p < o->scene->model.probe_count; p++) {
        const kn_force *f = &h->force[p];
        char session[24];
        snprintf(session, sizeof session, "%" PRId64, f->session); // JSON's numbers have 53 bits
        kn_fault fault = (kn_fault)f->fault;
        json_t *probe =
            json_pack("{s:s, s:b, s:s, s:b, s:f, s:[f,f,f], s:s}", "name", o->scene->model.probe[p].name, "live",
                      f->live, "session", f->live ? session : "0", "in_contact", f->contacts > 0, "gain", f->gain,
                      "force_n", f->force_n[0], f->force_n[1], f->force_n[2], "fault", kn_fault_name(fault));
        if (fault != KN_FAULT_NONE) json_object_set_new(probe, "way_back", json_string(kn_fault_remedy(fault)));
        json_array_append_new(array, probe);
    }
    return array;
}

static json_t *status_of(const kn_operator *o, const kn_health *h)
{
    static const char *const modes[] = {"IDLE", "RUNNING", "FAULT", "BRAKE", "ESTOP", "STOPPING", "RECOVERING"},
                             *const degraded[] = {"no_fifo", "no_mlock", "no_fma", "reduced"},
                             *const errors[] = {"comm_lost",      "force_limit",  "force_impulse_limit",
                                                "velocity_limit", "pose_invalid", "overrun",
                                                "physics"};
    const knead_status_t *s = &h->status;
    kn_account *a = &o->loop->account;
    json_t *status = json_pack("{s:b, s:s, s:s, s:I, s:f, s:I, s:s, s:o, s:o, s:o}", "ok", 1, "version", KN_VERSION,
                               "scene", o->scene->name, "time_us", (json_int_t)s->utime, "uptime_s",
                               1e-3 * (double)s->uptime_ms, "tick", (json_int_t)s->tick, "mode", modes[s->mode],
                               "degraded", names_of(s->degraded, degraded, 4), "current_errors",
                               names_of(h->error_bits, errors, 7), "last_errors", names_of(s->last_errors, errors, 7));
    json_object_set_new(status, "loop",
                        json_pack("{s:I, s:I, s:I, s:o, s:o, s:I}", "missed_cycles", (json_int_t)s->missed_cycles,
                                  "missed_explained", (json_int_t)s->missed_explained, "num_overruns",
                                  (json_int_t)s->overruns, "wakeup_us_below", histogram(s->wakeup_hist),
                                  "execution_us_below", histogram(s->execution_hist), "solver_capped",
                                  (json_int_t)s->solver_capped));
    json_object_set_new(status, "link",
                        json_pack("{s:f, s:I, s:I, s:o, s:I, s:I, s:I}", "control_command_success_rate",
                                  s->success_rate, "received", (json_int_t)s->received, "accepted",
                                  (json_int_t)s->accepted, "rejected", rejections(s), "kernel_drops",
                                  (json_int_t)s->kernel_drops, "published", (json_int_t)s->published, "publish_drops",
                                  (json_int_t)s->publish_drops));
    json_object_set_new(status, "force",
                        json_pack("{s:f, s:f, s:I, s:I, s:I}", "force_max_n", s->force_max_n, "force_step_max_n",
                                  s->force_step_max_n, "clamps", (json_int_t)s->clamps, "guards", (json_int_t)s->guards,
                                  "faults", (json_int_t)s->faults));
    json_object_set_new(status, "quality",
                        json_pack("{s:s, s:s}", "in_force", kn_quality_name((kn_quality)atomic_load(&a->quality)),
                                  "asked", kn_quality_name((kn_quality)atomic_load(&a->asked))));
    json_object_set_new(status, "state",
                        json_pack("{s:I, s:i}", "snapshot_age_ms", (json_int_t)s->snapshot_age_ms, "snapshot_errors",
                                  (int)s->snapshot_errors));
    json_object_set_new(status, "probes", probes(o, h));
    return status;
}

static json_t *tell_status(kn_operator *o)
{
    bool fresh = false;
    const kn_health *h = kn_mailbox_latest(&o->health, &fresh); // that of an earlier question
    o->ask(o->arg);
    for (int i = 0; i < 2 * PATIENCE_MS; i++) {
        h = kn_mailbox_latest(&o->health, &fresh);
        if (fresh) return status_of(o, h);
        rest();
    }
    return kn_control_error("the server's main thread did not answer for %d ms", PATIENCE_MS);
}

// --- changes ---

static json_t *order(kn_operator *o, kn_order kind, kn_quality quality)
{
    int64_t tick, number = kn_loop_order(o->loop, kind, quality);
    for (int i = 0; i < 2 * PATIENCE_MS; i++) {
        if (kn_loop_obeyed(o->loop, number, &tick)) return json_pack("{s:b, s:I}", "ok", 1, "tick", (json_int_t)tick);
        rest();
    }
    return kn_control_error("no tick came for %d ms", PATIENCE_MS);
}

static json_t *take_quality(kn_operator *o, const char *name)
{
    for (kn_quality q = 0; q < KN_QUALITIES; q++) {
        if (strcmp(name, kn_quality_name(q)) != 0) continue;
        if (o->scene->point[q].live) return order(o, KN_ORDER_QUALITY, q);
        if (!o->scene->point[q].defined) return kn_control_error("quality %s: the scene does not name it", name);
        return kn_control_error("quality %s: another lattice or precision, expected --quality %s at the start", name,
                                name);
    }
    return kn_control_error("quality '%s': expected %s", name, kn_quality_names);
}

json_t *kn_operator_answer(void *op, const json_t *request, bool *audit)
{
    static const struct {
        const char *name, *argument; // the one string that it takes, NULL: none
        kn_order order;
    } commands[] = {{"status", NULL, 0},
                    {"reset", NULL, KN_ORDER_RESET},
                    {"quality", "name", KN_ORDER_QUALITY},
                    {"recover", NULL, KN_ORDER_RECOVER},
                    {"estop", NULL, KN_ORDER_ESTOP},
                    {"stop", NULL, 0}};
    kn_operator *o = op;
    const char *name = json_string_value(json_object_get(request, "command")), *argument = NULL;
    size_t c = 0, count = sizeof commands / sizeof *commands;
    *audit = true;
    while (c < count && !(name && strcmp(name, commands[c].name) == 0)) c++;
    if (c == count) {
        char names[256] = "";
        for (c = 0; c < count; c++)
            snprintf(names + strlen(names), sizeof names - strlen(names), "%s%s", c ? ", " : "", commands[c].name);
        return kn_control_error("command '%s': expected one of %s", name ? name : "", names);
    }
    if (commands[c].argument) {
        argument = json_string_value(json_object_get(request, commands[c].argument));
        if (!argument) return kn_control_error("%s: expected \"%s\", a string", name, commands[c].argument);
    }
    if (json_object_size(request) != (argument ? 2 : 1)) {
        return argument ? kn_control_error("%s: expected nothing but \"%s\"", name, commands[c].argument)
                        : kn_control_error("%s: expected nothing else", name);
    }
    if (strcmp(name, "stop") == 0) {
        o->stop(o->arg);
        return json_pack("{s:b}", "ok", 1);
    }
    if (argument) return take_quality(o, argument);
    if (strcmp(name, "status") != 0) return order(o, commands[c].order, 0);
    *audit = false;
    return tell_status(o);
}

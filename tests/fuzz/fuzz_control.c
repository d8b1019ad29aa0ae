// Any line on the control socket: answered by one JSON object that says ok or an error, never by a crash, and an order
// is given only by a line that is one.
#include "server/control.h"
#include "server/operator.h"
#include <stdlib.h>
#include <string.h>

static kn_scene scene = {.name = "fuzz.yaml", .model = {.probe_count = 1, .probe = {{.name = "plate"}}},
                         .point = {{.defined = true, .live = true}, {.defined = true}}};
static kn_loop loop;
static kn_keeper keeper = {.store.dir = -1};
static kn_operator operator;
static kn_control_def def;
static int stops;

static void ask(void *arg)
{
    (void)arg;
    memset(kn_mailbox_back(&operator.health), 0, sizeof(kn_health));
    kn_mailbox_post(&operator.health);
}

static void stop(void *arg) { (void)arg, stops++; }

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    (void)argc, (void)argv;
    kn_operator_init(&operator, &scene, &loop, &keeper);
    operator.ask = ask;
    operator.stop = stop;
    def = kn_operator_control(&operator);
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size >= KN_CONTROL_LINE) return 0; // refused before
    atomic_store(&loop.orders, 0);
    atomic_store(&loop.obeyed, INT64_MAX); // a tick comes at once
    atomic_store(&loop.restored, 1);
    stops = 0;
    json_t *request, *answer = kn_control_judge(&def, (const char *)data, size, &request);
    const json_t *ok = json_object_get(answer, "ok");
    char *text = json_dumps(answer, JSON_COMPACT | JSON_ENSURE_ASCII);
    bool done = json_is_true(ok), changed = atomic_load(&loop.orders) != 0 || stops > 0;
    if (!json_is_boolean(ok) || !text || strchr(text, '\n')) abort();
    if (done == (json_object_get(answer, "error") != NULL)) abort();
    if (changed && !(done && request && def.audits(def.self, request))) abort(); // every change is audited
    free(text);
    json_decref(request);
    json_decref(answer);
    return 0;
}

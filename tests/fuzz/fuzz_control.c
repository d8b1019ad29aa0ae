// libFuzzer target: any line on the control socket is answered by one JSON object with ok or an error, and never by a
// crash. Only a valid order gives an order.
#include "server/control.h"
#include "server/operator.h"
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char text_of_it[] = "version: 1\nobject: {size: [2 cm, 2 cm, 2 cm], spacing: 1 cm}\ndensity: 1000 kg/m^3\n"
                                 "material: {k1: 50 kPa, c1: 3 kPa*s, damper: constant, c2: 9 kPa*s}\n"
                                 "support: bonded\ndevice: bench\nquality: {fast: {iterations: 2}}\n"
                                 "probes: [{name: plate, shape: plate, size: [1 cm, 1 cm]}]\n";
static kn_scene *scene;
static kn_model *model;
static kn_backend backend;
static kn_served_object served;
static kn_loop loop;
static kn_keeper keeper;
static kn_servo servo;
static kn_skin skin; // a skin without measures
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
static bool goes_on(void *arg) { return (void)arg, false; }
static void load(void *arg, const char *path, const kn_scene *next) { (void)arg, (void)path, (void)next, stops++; }
static const kn_rt rt; // locks nothing

// The ticks: they fill the copies of the object that are asked for.
static void *tick(void *none)
{
    for (kn_wake wake = {.tick = 1};; usleep(100)) kn_keeper_tick(&keeper, &servo, &wake, 0);
    return none;
}

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    (void)argc, (void)argv;
    char error[256] = "";
    scene = kn_scene_parse("fuzz.yaml", text_of_it, strlen(text_of_it), NULL, 0, error, sizeof error);
    model = scene ? kn_model_build(&scene->model, error, sizeof error) : NULL;
    if (!model || !kn_backend_cpu(&backend, model)) fprintf(stderr, "%s\n", error), abort();
    served = (kn_served_object){.base = scene, .scene = scene, .model = model, .backend = backend};
    static const kn_served_object_def how = {.scene_path = "fuzz.yaml"};
    kn_operator_init(&operator, &(kn_operator_def){.served = &served,
                                                   .def = &how,
                                                   .limits = &scene->limits,
                                                   .loop = &loop,
                                                   .keeper = &keeper,
                                                   .rt = &rt,
                                                   .skin = &skin,
                                                   .ask = ask,
                                                   .goes_on = goes_on,
                                                   .stop = stop,
                                                   .load = load});
    def = kn_operator_control(&operator);
    kn_servo_init(&servo, scene, model, &backend);
    pthread_t ticks;
    if (kn_keeper_open(&keeper, NULL, scene, model, error, sizeof error) || pthread_create(&ticks, NULL, tick, NULL))
        abort();
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size >= KN_CONTROL_LINE) return 0; // refused before
    atomic_store(&loop.orders.given, 0);
    atomic_store(&loop.orders.obeyed, INT64_MAX); // obey at once, as if a tick came
    atomic_store(&loop.orders.restored, 1);
    atomic_store(&operator.told, operator.now);
    stops = 0;
    json_t *request, *answer = kn_control_judge(&def, (const char *)data, size, &request);
    const json_t *ok = json_object_get(answer, "ok");
    char *text = json_dumps(answer, JSON_COMPACT | JSON_ENSURE_ASCII);
    bool done = json_is_true(ok), changed = atomic_load(&loop.orders.given) != 0 || stops > 0;
    if (!json_is_boolean(ok) || !text || strchr(text, '\n')) abort();
    if (done == (json_object_get(answer, "error") != NULL)) abort();
    if (changed && !(done && request && def.audits(def.self, request))) abort(); // every change is audited
    const json_t *handed = json_object_get(answer, "descriptor");
    if (handed) close((int)json_integer_value(handed));
    free(text);
    json_decref(request);
    json_decref(answer);
    return 0;
}

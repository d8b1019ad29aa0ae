// Time to draw a picture and read it back: the block of dough with its lattice lines, a plate and a force arrow. cpu:
// processor time of all threads of this process. wall: time until the caller has the picture, which on a busy machine
// includes the work of other programs.
#include "bench/bench.h"
#include "clients/viewer/renderer.h"
#include "core/algebra/algebra.h"
#include "core/surface.h"
#include <string.h>
#include <sys/utsname.h>

// WARM_UP: number of pictures that are drawn before the timing starts. During these pictures, Mesa compiles its
// shaders.
enum { PICTURES = 60, WARM_UP = 3 };

static double clock_ms(clockid_t clock) { return clock_us(clock) * 1e-3; }

// Time one kind of picture and print a row.
static void bench(int per_cm, int width, int height, int samples)
{
    char error[300];
    kn_model_def def = kn_model_def_default();
    memcpy(def.nodes, (int[]){5 * per_cm + 1, 5 * per_cm + 1, 3 * per_cm + 1}, sizeof def.nodes);
    def.spacing_m = 0.01 / per_cm;
    kn_model *model = kn_model_build(&def, error, sizeof error);
    kn_state *state = model ? kn_state_create(model) : NULL;
    kn_surface *s = state ? kn_surface_create(model) : NULL;
    kn_renderer *r = s ? kn_renderer_open(width, height, samples, error, sizeof error) : NULL;
    if (!r) {
        fprintf(stderr, "bench_view: %s\n", error);
        exit(3);
    }
    float(*xyz)[3] = calloc((size_t)s->vertex_count, sizeof *xyz);
    uint8_t *rgba = malloc((size_t)width * (size_t)height * 4);
    if (!xyz || !rgba) exit(3);
    kn_surface_positions(s, model, state, xyz[0]);
    kn_renderer_mesh(r, s->vertex_count, (const float(*)[3])xyz, s->triangle_count, (const int(*)[3])s->triangle);
    kn_view_scene scene = kn_view_scene_default();
    scene.xyz = (const float(*)[3])xyz;
    scene.probe_count = 1;
    scene.probe[0] = (kn_view_probe){
        .def = {.shape = KN_PROBE_PLATE, .size_m = {0.01, 0.06}}, .position_m = {0, 0, 0.03}, .force_n = {0, 0, 10}};
    double cpu[PICTURES], wall[PICTURES];
    for (int i = -WARM_UP; i < PICTURES; i++) {
        double cpu_ms = clock_ms(CLOCK_PROCESS_CPUTIME_ID), wall_ms = clock_ms(CLOCK_MONOTONIC);
        kn_renderer_draw(r, &scene, rgba);
        if (i < 0) continue;
        cpu[i] = clock_ms(CLOCK_PROCESS_CPUTIME_ID) - cpu_ms;
        wall[i] = clock_ms(CLOCK_MONOTONIC) - wall_ms;
    }
    qsort(cpu, PICTURES, sizeof *cpu, kn_ascending);
    qsort(wall, PICTURES, sizeof *wall, kn_ascending);
    printf("| %5d | %4d x %-4d | %7d | %6.1f | %6.1f | %6.1f | %6.1f |\n", model->grid.nodes, width, height, samples,
           cpu[PICTURES / 2], cpu[PICTURES * 9 / 10], wall[PICTURES / 2], wall[PICTURES * 9 / 10]);
    fflush(stdout);
    kn_renderer_close(r);
    free(xyz);
    free(rgba);
    kn_surface_destroy(s);
    kn_state_destroy(state);
    kn_model_destroy(model);
}

int main(void)
{
    struct utsname machine;
    uname(&machine);
    setenv("LP_NUM_THREADS", "1", 0);
    printf("%s %s, compiler %s, LP_NUM_THREADS=%s\n\n", machine.sysname, machine.machine, __VERSION__,
           getenv("LP_NUM_THREADS"));
    printf("| nodes | picture     | samples | cpu ms | p90    | wall   | p90    |\n|---|---|---|---|---|---|---|\n");
    bench(1, 1280, 720, 4);
    bench(2, 640, 360, 4);
    bench(2, 1280, 720, 4);
    bench(2, 800, 450, 1); // a picture for a page without WebGL
    bench(3, 1280, 720, 4);
    return 0;
}

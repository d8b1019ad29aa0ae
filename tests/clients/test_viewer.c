// Pictures of a block: 5 x 5 x 3 cm in cells of 5 mm, at rest and with a dent of 1 cm across its top.
// gate in release: arithmetic, ten times slower with the sanitizers
#include "clients/viewer/beside.h"
#include "clients/viewer/image.h"
#include "clients/viewer/offscreen.h"
#include "clients/viewer/renderer.h"
#include "clients/viewer/label.h"
#include "clients/viewer/shading.h"
#include "core/surface.h"
#include "core/shape.h"
#include "tests/clients/heard.h"
#include "tests/clients/pictured.h"
#include "tests/core/surface_of.h"
#include <errno.h>
#include <png.h>
#include <sys/stat.h>

OWNS(kn_shaded_mesh, kn_shaded_mesh_destroy)

TEST("the skin of a block has six smooth faces with sharp edges, and lines around its quads")
{
    static float corner[100000];
    begin_block();
    OWN(kn_shaded_mesh) *s = kn_shaded_mesh_create(surface->vertex_count, rest, surface->triangle_count, triangles);
    CHECK(s && s->triangle_count < 5000);
    CHECK(s->group_count == 2 * (11 * 11 + 11 * 7 + 11 * 7)); // a normal per node and face
    kn_shaded_mesh_corners(s, rest, corner);
    int diagonals = 0, axis_aligned = 0, outward = 0, sloped = 0;
    for (int i = 0; i < 3 * s->triangle_count; i++) {
        float *p = corner + 6 * i, *n = p + 3;
        diagonals += !s->line[i];
        axis_aligned += fabsf(fabsf(n[0]) + fabsf(n[1]) + fabsf(n[2]) - 1) < 1e-5f;
        outward += p[0] * n[0] + p[1] * n[1] + (p[2] - 0.015f) * n[2] > 0;
    }
    CHECK(diagonals == s->triangle_count); // each triangle has one side inside its quad
    CHECK(axis_aligned == 3 * s->triangle_count && outward == 3 * s->triangle_count);
    kn_shaded_mesh_corners(s, dented, corner);
    for (int i = 0; i < 3 * s->triangle_count; i++) sloped += corner[6 * i + 5] > 0.3f && corner[6 * i + 5] < 0.95f;
    CHECK(sloped > 0); // the flanks of the dent, which stay one surface with the top
}

TEST("a mesh with a corner out of range, without triangles or with too many vertices is refused")
{
    static const float xyz[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    static const int good[1][3] = {{0, 1, 2}}, beyond[1][3] = {{0, 1, 3}}, negative[1][3] = {{0, -1, 2}};
    OWN(kn_shaded_mesh) *s = kn_shaded_mesh_create(3, xyz, 1, good);
    CHECK(s != NULL);
    CHECK(!kn_shaded_mesh_create(3, xyz, 1, beyond) && !kn_shaded_mesh_create(3, xyz, 1, negative));
    CHECK(!kn_shaded_mesh_create(3, xyz, 0, good) && !kn_shaded_mesh_create(2, xyz, 1, good));
    CHECK(!kn_shaded_mesh_create(KN_SHADED_VERTICES_MAX + 1, xyz, 1, good));
}

TEST("a picture size outside 16 to 4096 is refused with this range")
{
    static const int size[][2] = {{0, 720}, {1280, 0}, {-1, 720}, {15, 16}, {4097, 16}, {1280, 1 << 30}};
    for (size_t i = 0; i < sizeof size / sizeof *size; i++) {
        char error[300] = "";
        CHECK(!kn_renderer_open(size[i][0], size[i][1], 4, error, sizeof error) && strstr(error, "16..4096"));
    }
}

TEST("a PNG holds the exact pixels, leaves no temporary file, and a write error is reported")
{
    static uint8_t rgba[PIXELS * 4], back[PIXELS * 4];
    for (size_t i = 0; i < sizeof rgba; i++) rgba[i] = i % 4 == 3 ? 255 : (uint8_t)(i * 2654435761u >> 24);
    char error[300] = "";
    CHECK(kn_image_write_png("a.png", WIDTH, HEIGHT, rgba, error, sizeof error) && access("a.png.tmp", F_OK) != 0);
    png_image image = {.version = PNG_IMAGE_VERSION};
    CHECK(png_image_begin_read_from_file(&image, "a.png") && image.width == WIDTH && image.height == HEIGHT);
    image.format = PNG_FORMAT_RGBA;
    CHECK(png_image_finish_read(&image, NULL, back, 0, NULL) && equal(rgba, back));
    CHECK(!kn_image_write_png("viewer.missing/a.png", WIDTH, HEIGHT, rgba, error, sizeof error));
    CHECK(strstr(error, "viewer.missing/a.png: No such file"));
    CHECK(!kn_image_write_png("/dev/null/a.png", WIDTH, HEIGHT, rgba, error, sizeof error));
}

// Write a text with kn_beside_write, and keep or drop it. Return the text that `path` then holds.
static const char *written(const char *path, const char *text, bool kept)
{
    static char held[40];
    char error[300];
    kn_beside out;
    CHECK(kn_beside_write(&out, path));
    fputs(text, out.file);
    if (kept) CHECK(kn_beside_keep(&out, error, sizeof error));
    else kn_beside_drop(&out);
    kn_read(path, held, sizeof held);
    return held;
}

TEST("a file of results is replaced as a whole; links, second names and devices are written where they are")
{
    char error[300];
    kn_beside out;
    struct stat is;
    CHECK(mkdir("beside", 0700) == 0 && chdir("beside") == 0);
    CHECK_STR(written("a", "one", true), "one");
    CHECK(chmod("a", 0640) == 0 && stat("a", &is) == 0);
    const ino_t first = is.st_ino;
    CHECK_STR(written("a", "two", false), "one");
    CHECK_STR(written("a", "three", true), "three");
    CHECK(stat("a", &is) == 0 && is.st_ino != first && (is.st_mode & 07777) == 0640);
    CHECK(symlink("a", "link") == 0 && link("a", "name") == 0);
    CHECK_STR(written("link", "four", true), "four");
    CHECK_STR(written("a", "five", true), "five");
    CHECK(lstat("link", &is) == 0 && S_ISLNK(is.st_mode) && stat("name", &is) == 0 && is.st_size == 4 &&
          is.st_nlink == 2);
    if (access("/dev/full", W_OK) == 0) {
        CHECK(kn_beside_write(&out, "/dev/full"));
        fputs("six", out.file);
        CHECK(!kn_beside_keep(&out, error, sizeof error) && strstr(error, "/dev/full: No space left"));
    }
    CHECK(!kn_beside_write(&out, "missing/a") && errno == ENOENT);
    unlink("a"), unlink("link"), unlink("name");
    CHECK(chdir("..") == 0 && rmdir("beside") == 0); // no other file is left
}

static bool is_opaque(const uint8_t *p) { return p[3] == 255; }

// Count the pixels of dough that are closer to the border than this.
static int at_border(const uint8_t *rgba, int wide)
{
    int n = 0;
    for (int i = 0, x, y; i < PIXELS; i++) {
        x = i % WIDTH, y = i / WIDTH;
        n += (x < wide || y < wide || x >= WIDTH - wide || y >= HEIGHT - wide) && is_dough(rgba + 4 * i);
    }
    return n;
}

TEST("the block fills 12 to 45 % of an opaque picture, clear of the border, and a dent across its top changes the "
     "middle of the picture and its profile from the front")
{
    begin_view();
    const uint8_t *level = draw(rest), *bent = draw(dented);
    CHECK_NEAR((double)count(level, is_dough) / PIXELS, 0.285, 0.165);
    CHECK(at_border(level, 8) == 0 && count(level, is_opaque) == PIXELS);
    int all = changed(level, bent);
    CHECK(all > count(level, is_dough) / 10);
    CHECK(changed_in(level, bent, WIDTH / 4, HEIGHT / 5, 3 * WIDTH / 4, HEIGHT) > all * 9 / 10);
    // In the level front view the groove removes dough from the silhouette: 1 cm deep, between 1 and 2 cm wide.
    scene.azimuth_deg = scene.elevation_deg = 0;
    CHECK_NEAR((double)count(draw(dented), is_dough) / count(draw(rest), is_dough), 1 - 1.5 * 1.0 / (5 * 3), 0.04);
}

TEST("pictures with one and four samples per pixel differ in under 2 % of the pixels, in every frame")
{
    begin_view();
    OWN(kn_renderer) *coarse = open_with(1);
    show_tool((kn_view_probe){.def = {.shape = KN_PROBE_SPHERE, .radius_m = 0.015}, .force_n = {0, 0, 8}});
    for (int i = 0; i < 4; i++) { // nothing of an earlier picture may remain
        scene.probe[0].position_m[0] = 0.02 * (i - 1.5);
        scene.probe[0].position_m[2] = 0.045 + 0.01 * (i % 2);
        CHECK(changed(draw(i % 2 ? dented : rest), draw_by(coarse, i % 2 ? dented : rest)) < PIXELS / 50);
    }
}

static bool is_low(const uint8_t *p) { return p[2] > p[1] + 30 && p[0] > p[1] + 20; }   // the scale's violet, lit
static bool is_high(const uint8_t *p) { return p[0] > p[2] + 110 && p[1] > p[2] + 90; } // the scale's yellow

TEST("the skin shows the colours of its values in every style, and its own colour for NaN")
{
    static float value[1000], edge[2000][2][3], edge_value[2000][2];
    begin_view();
    const uint8_t *plain = draw(rest);
    scene.value = value;
    for (int v = 0; v < surface->vertex_count; v++) value[v] = NAN;
    CHECK(equal(draw(rest), plain));
    CHECK(surface->triangle_count < 2000);
    scene.edge_count = surface->triangle_count;
    scene.edge = (const float(*)[2][3])edge;
    scene.edge_value = (const float(*)[2])edge_value;
    for (int style = KN_VIEW_LINED; style <= KN_VIEW_EDGES; style++)
        for (int high = 0; high < 2; high++) {
            for (int v = 0; v < surface->vertex_count; v++) value[v] = (float)high;
            for (int i = 0; i < 2 * surface->triangle_count; i++) {
                memcpy(edge[i / 2][i % 2], rest[triangles[i / 2][i % 2]], sizeof edge[0][0]);
                edge_value[i / 2][i % 2] = (float)high;
            }
            scene.style = (kn_view_style)style;
            const uint8_t *picture = draw(rest);
            const int right = count(picture, high ? is_high : is_low), wrong = count(picture, high ? is_low : is_high);
            printf("     style %d, value %d: %d pixels of its colour, %d of the other end's\n", style, high, right,
                   wrong);
            CHECK(right > 200 && wrong < right / 20);
        }
}

TEST("a colour scale ends at 1, 2 or 5 times a power of ten, in a unit that keeps its labels short")
{
    static const struct {
        double most;
        const char *unit;
        double top;
        const char *title, *last;
        int ticks;
    } all[] = {{3217, "Pa", 5000, "strain, kPa", "5", 5}, {0.0093, "m", 0.01, "strain, mm", "10", 5},
               {0.13, "", 0.2, "strain, %", "20", 4},     {1000, "Pa", 1000, "strain, kPa", "1", 5},
               {999, "Pa", 1000, "strain, kPa", "1", 5},  {2e-5, "m", 2e-5, "strain, \u00b5m", "20", 4},
               {0, "Pa", 1e-9, "strain, nPa", "1", 5}};
    char text[64];
    for (double most = 1e-6; most < 1e7; most *= 1.07) { // the text is as short as possible
        const kn_scale scale = {"stress", "Pa", kn_scale_top(most)};
        CHECK(scale.top >= most && scale.top <= 5.0 / 3 * most);
        int ticks = 0;
        while (kn_scale_tick(&scale, ticks, text, sizeof text) >= 0) {
            CHECK(strlen(text) <= 4);
            ticks++;
        }
        CHECK(ticks >= 4 && ticks <= 6);
    }
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        const kn_scale scale = {"strain", all[i].unit, kn_scale_round(all[i].most)};
        CHECK_NEAR(scale.top, all[i].top, 1e-9 * all[i].top);
        kn_scale_title(&scale, text, sizeof text);
        CHECK_STR(text, all[i].title);
        CHECK_NEAR(kn_scale_tick(&scale, all[i].ticks, text, sizeof text), 1, 1e-12);
        CHECK_STR(text, all[i].last);
        CHECK(kn_scale_tick(&scale, all[i].ticks + 1, text, sizeof text) < 0);
    }
}

TEST("the same input gives the same bytes, in a later picture and in another renderer")
{
    begin_view();
    show_tool((kn_view_probe){
        .def = {.shape = KN_PROBE_SPHERE, .radius_m = 0.01}, .position_m = {0, 0, 0.04}, .force_n = {1, 0, 3}});
    OWN(kn_renderer) *other = open_with(4);
    const uint8_t *first = draw(dented);
    CHECK(equal(first, draw_by(other, dented)));
    const kn_view_scene same = scene;
    scene.azimuth_deg = -40; // another camera as well
    CHECK(!equal(first, draw(rest)));
    scene = same;
    CHECK(equal(first, draw(dented)));
}

TEST("a plate hides dough; its force arrow grows with the force and vanishes at 0 N")
{
    int arrow[3];
    begin_view();
    const uint8_t *bare = draw(rest);
    show_tool((kn_view_probe){.def = {.shape = KN_PROBE_PLATE, .size_m = {0.01, 0.05}}, .position_m = {0, 0, 0.03}});
    CHECK(count(draw(rest), is_dough) < count(bare, is_dough) * 95 / 100);
    for (int i = 0; i < 3; i++) {
        scene.probe[0].force_n[2] = 5 * i;
        arrow[i] = count(draw(rest), is_arrow);
    }
    CHECK(arrow[0] == 0 && arrow[1] > 100 && arrow[2] > arrow[1] * 3 / 2);
}

// Return the area of a tool in front of the block in a level front view, scaled by the area of the block's front.
static double shown_m2(const kn_probe_def *def, bool over)
{
    scene.azimuth_deg = scene.elevation_deg = 0;
    show_tool((kn_view_probe){.def = *def, .position_m = {0, -0.03, 0.01}});
    if (over) // turns z to x
        memcpy(scene.probe[0].orientation_wxyz, (double[]){0.70710678, 0, 0.70710678, 0}, 4 * sizeof(double));
    const uint8_t *picture = draw(rest);
    int tool = count(picture, is_tool), dough = count(picture, is_dough);
    return tool * (0.05 * 0.03) / (tool + dough);
}

TEST("every tool shape has its outline in the picture and turns with its pose")
{
    static const kn_probe_def capsule = {.shape = KN_PROBE_CAPSULE, .radius_m = 0.004, .length_m = 0.008},
                              cylinder = {.shape = KN_PROBE_CYLINDER, .radius_m = 0.006, .length_m = 0.012},
                              box = {.shape = KN_PROBE_BOX, .size_m = {0.006, 0.002, 0.012}},
                              cross = {.shape = KN_PROBE_CROSS, .size_m = {0.012, 0.003, 0.004}};
    kn_shape of_parts = {0}, of_file = {0};
    kn_solid lying = kn_solid_capsule(0.004, 0.008), stamp;
    lying.turned = true, lying.at_m[0] = -0.004; // z axis along x
    memcpy(lying.turn, (double[3][3]){{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}}, sizeof lying.turn);
    stamp = kn_solid_field(surface_field(surface_box(box.size_m, 0, 2), 0.001));
    CHECK(kn_shape_add(&of_parts, &lying) && kn_shape_add(&of_file, &stamp));
    const kn_probe_def parts = {.shape = KN_PROBE_UNION, .parts = &of_parts},
                       mesh = {.shape = KN_PROBE_MESH, .parts = &of_file};
    const double rod = 0.008 * 0.008 + 3.14159 * 0.004 * 0.004;
    const struct {
        const kn_probe_def *tool;
        bool over;
        double m2, bound;
    } all[] = {{&box, true, 0.006 * 0.012, 0.1},   {&cylinder, false, 0.012 * 0.012, 0.1}, {&capsule, false, rod, 0.1},
               {&capsule, true, rod, 0.1},         {&cross, false, 0.012 * 0.004, 0.15},   {&parts, false, rod, 0.1},
               {&cross, true, 0.012 * 0.004, 0.15}};
    begin_view();
    double scale = shown_m2(&box, false) / (0.006 * 0.012); // the tool is 5 mm nearer than the block's front
    CHECK(scale > 1 && scale < 1.2);
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        CHECK_NEAR(shown_m2(all[i].tool, all[i].over) / scale / all[i].m2, 1, all[i].bound);
    for (int over = 0; over < 2; over++) CHECK_NEAR(shown_m2(&mesh, over), shown_m2(&box, over), 1e-6);
    kn_shape_drop(&of_file);
}

TEST("the force arrow of a turned tool begins at the back of the tool")
{
    begin_view();
    scene.azimuth_deg = scene.elevation_deg = 0;
    show_tool((kn_view_probe){.def = {.shape = KN_PROBE_CAPSULE, .radius_m = 0.004, .length_m = 0.006},
                              .position_m = {0.029, 0, 0.015},
                              .force_n = {5, 0, 0},
                              .orientation_wxyz = {0.70710678, 0, 0.70710678, 0}});
    const uint8_t *picture = draw(rest);
    int tool = 0, arrow = WIDTH;
    for (int i = 0; i < PIXELS; i++) {
        if (is_tool(picture + 4 * i) && i % WIDTH > tool) tool = i % WIDTH;
        if (is_arrow(picture + 4 * i) && i % WIDTH < arrow) arrow = i % WIDTH;
    }
    CHECK(arrow < WIDTH && abs(arrow - tool) <= 4);
}

TEST("a lifted object leaves a fixed picture, and a following camera keeps it inside")
{
    begin_view();
    const uint8_t *fixed = draw(dented);
    scene.follow = true;
    CHECK(equal(fixed, draw(dented)));
    for (int v = 0; v < surface->vertex_count; v++) rest[v][2] += 0.05f;
    CHECK(at_border(draw(rest), 1) == 0);
    scene.follow = false;
    CHECK(at_border(draw(rest), 1) > 0);
}

TEST("objects and tools that move far away are redrawn completely, without remains of the previous picture")
{
    begin_view();
    const int before = count(draw(rest), is_dough);
    for (int v = 0; v < surface->vertex_count; v++) dented[v][0] += 0.04f; // moved to the right
    show_tool((kn_view_probe){
        .def = {.shape = KN_PROBE_SPHERE, .radius_m = 0.01}, .position_m = {-0.06, 0, 0.02}, .force_n = {-20, 0, 5}});
    OWN(kn_renderer) *fresh = open_with(4);
    const uint8_t *after = draw(dented);
    CHECK(equal(after, draw_by(fresh, dented)));
    CHECK(abs(count(after, is_dough) - before) < before / 4);
    CHECK(count(after, is_arrow) > 100);
}

TEST("tools inside a flat object do not show through its sides")
{
    begin_view();
    scene.thickness_m = 0.05; // thickness of the block
    const uint8_t *bare = draw(rest);
    for (int plate = 0; plate < 2; plate++) {
        show_tool((kn_view_probe){
            .def = {.shape = plate ? KN_PROBE_PLATE : KN_PROBE_SPHERE, .radius_m = 0.01, .size_m = {0.01, 0.01}},
            .position_m = {0, 0, 0.015}});
        CHECK(changed(bare, draw(rest)) == 0);
    }
}

TEST("vertices at NaN or infinite positions leave a hole and change under 2 % of the picture")
{
    begin_view();
    const uint8_t *whole = draw(rest);
    int vertex = surface->vertex_count - 1; // a corner of the top
    rest[vertex][0] = NAN;
    rest[vertex - 1][2] = INFINITY;
    int lost = changed(whole, draw(rest));
    CHECK(lost > 0 && lost < PIXELS / 50);
}

TESTS_MAIN

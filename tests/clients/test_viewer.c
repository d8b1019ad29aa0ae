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
#include "tests/clients/pictured.h"
#include "tests/core/surface_of.h"
#include <errno.h>
#include <png.h>
#include <sys/stat.h>
#include <unistd.h>

OWNS(kn_shaded_mesh, kn_shaded_mesh_destroy)

TEST("the skin of a block has six smooth faces with sharp edges, and lines around its quads")
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_shaded_mesh) *s = kn_shaded_mesh_create(b.surface->vertex_count, (const float(*)[3])b.rest,
                                                   b.surface->triangle_count, triangles(&b));
    CHECK(s != NULL);
    CHECK(s->group_count == 2 * (11 * 11 + 11 * 7 + 11 * 7)); // a normal per node and face
    int diagonals = 0;
    for (int i = 0; i < 3 * s->triangle_count; i++) diagonals += !s->line[i];
    CHECK(diagonals == s->triangle_count); // each triangle has one side inside its quad

    float *corner = malloc((size_t)s->triangle_count * 18 * sizeof *corner);
    kn_shaded_mesh_corners(s, (const float(*)[3])b.rest, corner);
    int axis_aligned = 0, outward = 0;
    for (int i = 0; i < 3 * s->triangle_count; i++) {
        float *p = corner + 6 * i, *n = p + 3;
        axis_aligned += fabsf(fabsf(n[0]) + fabsf(n[1]) + fabsf(n[2]) - 1) < 1e-5f;
        outward += p[0] * n[0] + p[1] * n[1] + (p[2] - 0.015f) * n[2] > 0;
    }
    CHECK(axis_aligned == 3 * s->triangle_count);
    CHECK(outward == 3 * s->triangle_count);

    kn_shaded_mesh_corners(s, (const float(*)[3])b.dented, corner);
    int sloped = 0;
    for (int i = 0; i < 3 * s->triangle_count; i++) sloped += corner[6 * i + 5] > 0.3f && corner[6 * i + 5] < 0.95f;
    CHECK(sloped > 0); // the flanks of the dent, which stay one surface with the top
    free(corner);
}

TEST("a mesh with a corner out of range, without triangles or with too many vertices is refused")
{
    static const float xyz[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    static const int good[1][3] = {{0, 1, 2}}, beyond[1][3] = {{0, 1, 3}}, negative[1][3] = {{0, -1, 2}};
    OWN(kn_shaded_mesh) *s = kn_shaded_mesh_create(3, xyz, 1, good);
    CHECK(s != NULL);
    CHECK(kn_shaded_mesh_create(3, xyz, 1, beyond) == NULL);
    CHECK(kn_shaded_mesh_create(3, xyz, 1, negative) == NULL);
    CHECK(kn_shaded_mesh_create(3, xyz, 0, good) == NULL);
    CHECK(kn_shaded_mesh_create(2, xyz, 1, good) == NULL);
    CHECK(kn_shaded_mesh_create(KN_SHADED_VERTICES_MAX + 1, xyz, 1, good) == NULL);
}

TEST("a picture size outside 16 to 4096 is refused with this range")
{
    static const int size[][2] = {{0, 720}, {1280, 0}, {-1, 720}, {15, 16}, {4097, 16}, {1280, 1 << 30}};
    for (size_t i = 0; i < sizeof size / sizeof *size; i++) {
        char error[300] = "";
        CHECK(kn_renderer_open(size[i][0], size[i][1], 4, error, sizeof error) == NULL);
        CHECK(strstr(error, "16..4096") != NULL);
    }
}

TEST("a PNG holds the exact pixels, leaves no temporary file, and a write error is reported")
{
    static uint8_t rgba[PIXELS * 4], back[PIXELS * 4];
    for (size_t i = 0; i < sizeof rgba; i++) rgba[i] = i % 4 == 3 ? 255 : (uint8_t)(i * 2654435761u >> 24);
    char error[300] = "", folder[] = "viewer.XXXXXX", path[64], tmp[80];
    CHECK(mkdtemp(folder) != NULL);
    snprintf(path, sizeof path, "%s/a.png", folder);
    snprintf(tmp, sizeof tmp, "%s.tmp", path);
    CHECK(kn_image_write_png(path, WIDTH, HEIGHT, rgba, error, sizeof error));
    CHECK(access(tmp, F_OK) != 0);

    png_image image = {.version = PNG_IMAGE_VERSION};
    CHECK(png_image_begin_read_from_file(&image, path));
    CHECK(image.width == WIDTH && image.height == HEIGHT);
    image.format = PNG_FORMAT_RGBA;
    CHECK(png_image_finish_read(&image, NULL, back, 0, NULL));
    CHECK(memcmp(rgba, back, sizeof rgba) == 0);

    CHECK(!kn_image_write_png("viewer.missing/a.png", WIDTH, HEIGHT, rgba, error, sizeof error));
    CHECK(strstr(error, "viewer.missing/a.png: No such file") != NULL);
    CHECK(!kn_image_write_png("/dev/null/a.png", WIDTH, HEIGHT, rgba, error, sizeof error));
    unlink(path);
    rmdir(folder);
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
    FILE *in = fopen(path, "r");
    held[in ? fread(held, 1, sizeof held - 1, in) : 0] = '\0';
    if (in) fclose(in);
    return held;
}

TEST("a file of results is replaced as a whole; links, second names and devices are written where they are")
{
    char folder[] = "beside.XXXXXX", error[300];
    kn_beside out;
    struct stat is;
    CHECK(mkdtemp(folder) != NULL && chdir(folder) == 0);
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
    CHECK(chdir("..") == 0 && rmdir(folder) == 0); // no other file is left
}

TEST("the block fills 12 to 45 % of the picture and stays clear of the border")
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *r = open_renderer(&b);
    uint8_t *rest = draw(r, kn_view_scene_default(), b.rest);
    double share = (double)count(rest, is_dough) / PIXELS;
    CHECK(share > 0.12 && share < 0.45);
    int border = 0;
    for (int i = 0; i < PIXELS; i++) {
        int x = i % WIDTH, y = i / WIDTH;
        if (x < 8 || y < 8 || x >= WIDTH - 8 || y >= HEIGHT - 8) border += is_dough(rest + 4 * i);
    }
    CHECK(border == 0);
    int opaque = 0;
    for (int i = 0; i < PIXELS; i++) opaque += rest[4 * i + 3] == 255;
    CHECK(opaque == PIXELS);
    free(rest);
}

TEST("pictures with one and four samples per pixel differ in under 2 % of the pixels, in every frame")
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *fine = open_with(&b, 4), *coarse = open_with(&b, 1);
    kn_view_scene scene = kn_view_scene_default();
    scene.probe_count = 1;
    scene.probe[0] = (kn_view_probe){.def = {.shape = KN_PROBE_SPHERE, .radius_m = 0.015}, .force_n = {0, 0, 8}};
    for (int i = 0; i < 4; i++) { // nothing of an earlier picture may remain
        scene.probe[0].position_m[0] = 0.02 * (i - 1.5);
        scene.probe[0].position_m[2] = 0.045 + 0.01 * (i % 2);
        uint8_t *a = draw(fine, scene, i % 2 ? b.dented : b.rest), *z = draw(coarse, scene, i % 2 ? b.dented : b.rest);
        CHECK(changed(a, z, 0, 0, WIDTH, HEIGHT) < PIXELS / 50);
        free(a);
        free(z);
    }
}

static bool is_low(const uint8_t *p) { return p[2] > p[1] + 30 && p[0] > p[1] + 20; }   // the scale's violet, lit
static bool is_high(const uint8_t *p) { return p[0] > p[2] + 110 && p[1] > p[2] + 90; } // the scale's yellow

// Count the pixels of the scale's low end and of its high end, with the same value at all vertices.
static void paint(kn_renderer *r, const block *b, kn_view_style style, float all, int *low, int *high)
{
    const int edges = b->surface->triangle_count, vertices = b->surface->vertex_count;
    kn_view_scene scene = kn_view_scene_default();
    float *value = calloc((size_t)vertices, sizeof *value);
    float(*edge)[2][3] = calloc((size_t)edges, sizeof *edge),
    (*edge_value)[2] = calloc((size_t)edges, sizeof *edge_value);
    for (int v = 0; v < vertices; v++) value[v] = all;
    for (int t = 0; t < edges; t++)
        for (int end = 0; end < 2; end++) {
            memcpy(edge[t][end], b->rest[b->surface->triangle[3 * t + end]], sizeof edge[t][end]);
            edge_value[t][end] = all;
        }
    scene.style = style;
    scene.value = value;
    scene.edge_count = edges;
    scene.edge = (const float(*)[2][3])edge;
    scene.edge_value = (const float(*)[2])edge_value;
    uint8_t *rgba = draw(r, scene, b->rest);
    *low = count(rgba, is_low), *high = count(rgba, is_high);
    free(rgba);
    free(value);
    free(edge);
    free(edge_value);
}

TEST("the skin shows the colours of its values in every style, and its own colour for NaN")
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *r = open_renderer(&b);
    for (int style = KN_VIEW_LINED; style <= KN_VIEW_EDGES; style++) {
        int low[2], high[2];
        paint(r, &b, (kn_view_style)style, 0, &low[0], &high[0]);
        paint(r, &b, (kn_view_style)style, 1, &low[1], &high[1]);
        printf("     style %d: at 0 %d pixels low, %d high; at 1 %d, %d\n", style, low[0], high[0], low[1], high[1]);
        CHECK(low[0] > 200 && high[0] < low[0] / 20);
        CHECK(high[1] > 200 && low[1] < high[1] / 20);
    }
    float *value = calloc((size_t)b.surface->vertex_count, sizeof *value);
    for (int v = 0; v < b.surface->vertex_count; v++) value[v] = NAN;
    kn_view_scene scene = kn_view_scene_default();
    uint8_t *plain = draw(r, scene, b.rest);
    scene.value = value;
    uint8_t *unknown = draw(r, scene, b.rest);
    CHECK(memcmp(unknown, plain, PIXELS * 4) == 0);
    free(unknown);
    free(plain);
    free(value);
}

static void check_scale(double most, const char *unit, double top, const char *title, const char *last, int ticks)
{
    char text[64];
    const kn_scale scale = {"strain", unit, kn_scale_round(most)};
    CHECK_NEAR(scale.top, top, 1e-9 * top);
    kn_scale_title(&scale, text, sizeof text);
    CHECK_STR(text, title);
    CHECK_NEAR(kn_scale_tick(&scale, ticks, text, sizeof text), 1, 1e-12);
    CHECK_STR(text, last);
    CHECK(kn_scale_tick(&scale, ticks + 1, text, sizeof text) < 0);
}

TEST("a colour scale ends at 1, 2 or 5 times a power of ten, in a unit that keeps its labels short")
{
    for (double most = 1e-6; most < 1e7; most *= 1.07) { // the text is as short as possible
        const kn_scale scale = {"stress", "Pa", kn_scale_top(most)};
        char text[64];
        CHECK(scale.top >= most && scale.top <= 5.0 / 3 * most);
        int ticks = 0;
        while (kn_scale_tick(&scale, ticks, text, sizeof text) >= 0) {
            CHECK(strlen(text) <= 4);
            ticks++;
        }
        CHECK(ticks >= 4 && ticks <= 6);
    }
    check_scale(3217, "Pa", 5000, "strain, kPa", "5", 5);
    check_scale(0.0093, "m", 0.01, "strain, mm", "10", 5);
    check_scale(0.13, "", 0.2, "strain, %", "20", 4);
    check_scale(1000, "Pa", 1000, "strain, kPa", "1", 5);
    check_scale(999, "Pa", 1000, "strain, kPa", "1", 5);
    check_scale(2e-5, "m", 2e-5, "strain, \u00b5m", "20", 4);
    check_scale(0, "Pa", 1e-9, "strain, nPa", "1", 5);
}

TEST("a dent across the top changes the middle of the picture, and its profile shows from the front")
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *r = open_renderer(&b);
    kn_view_scene scene = kn_view_scene_default();
    uint8_t *rest = draw(r, scene, b.rest), *dented = draw(r, scene, b.dented);
    int all = changed(rest, dented, 0, 0, WIDTH, HEIGHT);
    CHECK(all > count(rest, is_dough) / 10);
    CHECK(changed(rest, dented, WIDTH / 4, HEIGHT / 5, 3 * WIDTH / 4, HEIGHT) > all * 9 / 10);
    free(rest);
    free(dented);

    // In the level front view the groove removes dough from the silhouette: 1 cm deep, between 1 and 2 cm wide.
    scene.azimuth_deg = scene.elevation_deg = 0;
    rest = draw(r, scene, b.rest), dented = draw(r, scene, b.dented);
    double left = (double)count(dented, is_dough) / count(rest, is_dough);
    CHECK_NEAR(left, 1 - 1.5 * 1.0 / (5 * 3), 0.04);
    free(rest);
    free(dented);
}

TEST("the same input gives the same bytes, in a later picture and in another renderer")
{
    AT_END(block_destroy) block b = block_create();
    kn_view_scene scene = kn_view_scene_default();
    scene.probe_count = 1;
    scene.probe[0] = (kn_view_probe){
        .def = {.shape = KN_PROBE_SPHERE, .radius_m = 0.01}, .position_m = {0, 0, 0.04}, .force_n = {1, 0, 3}};
    OWN(kn_renderer) *r = open_renderer(&b), *other = open_renderer(&b);
    kn_view_scene elsewhere = kn_view_scene_default(); // another camera as well: the backdrop is drawn anew
    elsewhere.azimuth_deg = -40;
    uint8_t *first = draw(r, scene, b.dented), *between = draw(r, elsewhere, b.rest);
    uint8_t *second = draw(r, scene, b.dented), *third = draw(other, scene, b.dented);
    CHECK(memcmp(first, between, PIXELS * 4) != 0);
    CHECK(memcmp(first, second, PIXELS * 4) == 0);
    CHECK(memcmp(first, third, PIXELS * 4) == 0);
    free(first);
    free(between);
    free(second);
    free(third);
}

TEST("a plate hides dough; its force arrow grows with the force and vanishes at 0 N")
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *r = open_renderer(&b);
    kn_view_scene scene = kn_view_scene_default();
    uint8_t *bare = draw(r, scene, b.rest);
    scene.probe_count = 1;
    scene.probe[0] =
        (kn_view_probe){.def = {.shape = KN_PROBE_PLATE, .size_m = {0.01, 0.05}}, .position_m = {0, 0, 0.03}};
    int arrow[3];
    for (int i = 0; i < 3; i++) {
        scene.probe[0].force_n[2] = 5 * i;
        uint8_t *picture = draw(r, scene, b.rest);
        arrow[i] = count(picture, is_arrow);
        if (i == 0) CHECK(count(picture, is_dough) < count(bare, is_dough) * 95 / 100);
        free(picture);
    }
    CHECK(arrow[0] == 0);
    CHECK(arrow[1] > 100 && arrow[2] > arrow[1] * 3 / 2);
    free(bare);
}

// Return the area of a tool in front of the block in a level front view, scaled by the area of the block's front.
static double shown_m2(kn_renderer *r, const block *b, const kn_probe_def *def, const double turn[4])
{
    kn_view_scene scene = kn_view_scene_default();
    scene.azimuth_deg = scene.elevation_deg = 0;
    scene.probe_count = 1;
    scene.probe[0] = (kn_view_probe){.def = *def, .position_m = {0, -0.03, 0.01}};
    memcpy(scene.probe[0].orientation_wxyz, turn, sizeof scene.probe[0].orientation_wxyz);
    uint8_t *picture = draw(r, scene, b->rest);
    int tool = count(picture, is_tool), dough = count(picture, is_dough);
    free(picture);
    return tool * (0.05 * 0.03) / (tool + dough);
}

TEST("every tool shape has its outline in the picture and turns with its pose")
{
    static const double level[4] = {0}, over[4] = {0.70710678, 0, 0.70710678, 0}; // turns z to x
    static const kn_probe_def capsule = {.shape = KN_PROBE_CAPSULE, .radius_m = 0.004, .length_m = 0.008},
                              cylinder = {.shape = KN_PROBE_CYLINDER, .radius_m = 0.006, .length_m = 0.012},
                              box = {.shape = KN_PROBE_BOX, .size_m = {0.006, 0.002, 0.012}},
                              cross = {.shape = KN_PROBE_CROSS, .size_m = {0.012, 0.003, 0.004}};
    const double ball = 3.14159 * 0.004 * 0.004;
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *r = open_renderer(&b);
    double scale = shown_m2(r, &b, &box, level) / (0.006 * 0.012); // the tool is 5 mm nearer than the block's front
    CHECK(scale > 1 && scale < 1.2);
    CHECK_NEAR(shown_m2(r, &b, &box, over) / scale, 0.006 * 0.012, 0.1 * 0.006 * 0.012);
    CHECK_NEAR(shown_m2(r, &b, &cylinder, level) / scale, 0.012 * 0.012, 0.1 * 0.012 * 0.012);
    CHECK_NEAR(shown_m2(r, &b, &capsule, level) / scale, 0.008 * 0.008 + ball, 0.1 * (0.008 * 0.008 + ball));
    CHECK_NEAR(shown_m2(r, &b, &capsule, over) / scale, 0.008 * 0.008 + ball, 0.1 * (0.008 * 0.008 + ball));
    CHECK_NEAR(shown_m2(r, &b, &cross, level) / scale, 0.012 * 0.004, 0.15 * 0.012 * 0.004);
    CHECK_NEAR(shown_m2(r, &b, &cross, over) / scale, 0.012 * 0.004, 0.15 * 0.012 * 0.004);
    kn_shape of_parts = {0}, of_file = {0};
    kn_solid lying = kn_solid_capsule(0.004, 0.008), stamp;
    lying.turned = true, lying.at_m[0] = -0.004; // z axis along x
    memcpy(lying.turn, (double[3][3]){{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}}, sizeof lying.turn);
    stamp = kn_solid_field(surface_field(surface_box(box.size_m, 0, 2), 0.001));
    CHECK(kn_shape_add(&of_parts, &lying) && kn_shape_add(&of_file, &stamp));
    const kn_probe_def parts = {.shape = KN_PROBE_UNION, .parts = &of_parts},
                       mesh = {.shape = KN_PROBE_MESH, .parts = &of_file};
    CHECK_NEAR(shown_m2(r, &b, &parts, level) / scale, 0.008 * 0.008 + ball, 0.1 * (0.008 * 0.008 + ball));
    CHECK_NEAR(shown_m2(r, &b, &mesh, level), shown_m2(r, &b, &box, level), 1e-6);
    CHECK_NEAR(shown_m2(r, &b, &mesh, over), shown_m2(r, &b, &box, over), 1e-6);
    kn_shape_drop(&of_file);
}

TEST("the force arrow of a turned tool begins at the back of the tool")
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *r = open_renderer(&b);
    kn_view_scene scene = kn_view_scene_default();
    scene.azimuth_deg = scene.elevation_deg = 0;
    scene.probe_count = 1;
    scene.probe[0] = (kn_view_probe){.def = {.shape = KN_PROBE_CAPSULE, .radius_m = 0.004, .length_m = 0.006},
                                     .position_m = {0.029, 0, 0.015},
                                     .force_n = {5, 0, 0},
                                     .orientation_wxyz = {0.70710678, 0, 0.70710678, 0}};
    uint8_t *picture = draw(r, scene, b.rest);
    int tool = 0, arrow = WIDTH;
    for (int i = 0; i < PIXELS; i++) {
        if (is_tool(picture + 4 * i) && i % WIDTH > tool) tool = i % WIDTH;
        if (is_arrow(picture + 4 * i) && i % WIDTH < arrow) arrow = i % WIDTH;
    }
    CHECK(arrow < WIDTH && abs(arrow - tool) <= 4);
    free(picture);
}

TEST("a lifted object leaves a fixed picture, and a following camera keeps it inside")
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *r = open_renderer(&b);
    kn_view_scene fixed = kn_view_scene_default(), follow = fixed;
    follow.follow = true;
    uint8_t *rest = draw(r, fixed, b.dented), *same = draw(r, follow, b.dented);
    CHECK(memcmp(rest, same, PIXELS * 4) == 0);
    for (int v = 0; v < b.surface->vertex_count; v++) b.rest[v][2] += 0.05f;
    uint8_t *cut = draw(r, fixed, b.rest), *whole = draw(r, follow, b.rest);
    int border[2] = {0};
    for (int x = 0; x < WIDTH; x++) border[0] += is_dough(cut + 4 * x), border[1] += is_dough(whole + 4 * x);
    CHECK(border[0] > 0 && border[1] == 0);
    free(rest);
    free(same);
    free(cut);
    free(whole);
}

TEST("objects and tools that move far away are redrawn completely, without remains of the previous picture")
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *r = open_renderer(&b), *fresh = open_renderer(&b);
    kn_view_scene scene = kn_view_scene_default();
    for (int v = 0; v < b.surface->vertex_count; v++) b.dented[v][0] += 0.04f; // moved to the right
    scene.probe_count = 1;
    scene.probe[0] = (kn_view_probe){
        .def = {.shape = KN_PROBE_SPHERE, .radius_m = 0.01}, .position_m = {-0.06, 0, 0.02}, .force_n = {-20, 0, 5}};
    uint8_t *before = draw(r, kn_view_scene_default(), b.rest);
    uint8_t *after = draw(r, scene, b.dented), *at_once = draw(fresh, scene, b.dented);
    CHECK(memcmp(after, at_once, PIXELS * 4) == 0);
    CHECK(abs(count(after, is_dough) - count(before, is_dough)) < count(before, is_dough) / 4);
    CHECK(count(after, is_arrow) > 100);
    free(before);
    free(after);
    free(at_once);
}

TEST("tools inside a flat object do not show through its sides")
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *r = open_renderer(&b);
    kn_view_scene scene = kn_view_scene_default();
    scene.thickness_m = 0.05; // thickness of the block
    uint8_t *bare = draw(r, scene, b.rest);
    scene.probe_count = 1;
    for (int plate = 0; plate < 2; plate++) {
        scene.probe[0] = (kn_view_probe){
            .def = {.shape = plate ? KN_PROBE_PLATE : KN_PROBE_SPHERE, .radius_m = 0.01, .size_m = {0.01, 0.01}},
            .position_m = {0, 0, 0.015}};
        uint8_t *with = draw(r, scene, b.rest);
        CHECK(changed(bare, with, 0, 0, WIDTH, HEIGHT) == 0);
        free(with);
    }
    free(bare);
}

TEST("vertices at NaN or infinite positions leave a hole and change under 2 % of the picture")
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *r = open_renderer(&b);
    uint8_t *whole = draw(r, kn_view_scene_default(), b.rest);
    int vertex = b.surface->vertex_count - 1; // a corner of the top
    b.rest[vertex][0] = NAN;
    b.rest[vertex - 1][2] = INFINITY;
    uint8_t *holed = draw(r, kn_view_scene_default(), b.rest);
    int lost = changed(whole, holed, 0, 0, WIDTH, HEIGHT);
    CHECK(lost > 0 && lost < PIXELS / 50);
    free(whole);
    free(holed);
}

TESTS_MAIN

#include "clients/knead/shot.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct kn_shot {
    kn_renderer *renderer;
    int width, height;
    int vertex_count, triangle_count; // numbers of vertices and triangles in the mesh that the renderer holds
    float (*rest)[3];
    int (*triangle)[3];
};

kn_shot *kn_shot_open(int width, int height, int samples, char *error, size_t error_size)
{
    kn_shot *shot = calloc(1, sizeof *shot);
    if (!shot) return snprintf(error, error_size, "out of memory"), NULL;
    shot->width = width;
    shot->height = height;
    shot->renderer = kn_renderer_open(width, height, samples, error, error_size);
    if (shot->renderer) return shot;
    kn_shot_close(shot);
    return NULL;
}

// Return true if the renderer already holds this mesh.
static bool same_mesh(const kn_shot *shot, const kn_still *s)
{
    return shot->vertex_count == s->vertex_count && shot->triangle_count == s->triangle_count &&
           memcmp(shot->rest, s->rest, (size_t)s->vertex_count * sizeof *s->rest) == 0 &&
           memcmp(shot->triangle, s->triangle, (size_t)s->triangle_count * sizeof *s->triangle) == 0;
}

static void forget_mesh(kn_shot *shot)
{
    free(shot->rest);
    free(shot->triangle);
    shot->vertex_count = shot->triangle_count = 0;
    shot->rest = NULL;
    shot->triangle = NULL;
}

// Give the mesh to the renderer, which then computes skin, creases and camera. In a film of one object this happens
// only once.
static bool load_mesh(kn_shot *shot, const kn_still *s)
{
    if (same_mesh(shot, s)) return true;
    forget_mesh(shot);
    if (!kn_renderer_mesh(shot->renderer, s->vertex_count, (const float(*)[3])s->rest, s->triangle_count,
                          (const int(*)[3])s->triangle))
        return false;
    shot->rest = malloc((size_t)s->vertex_count * sizeof *s->rest);
    shot->triangle = malloc((size_t)s->triangle_count * sizeof *s->triangle);
    // If memory for these copies is short, the next picture loads the mesh again.
    if (!shot->rest || !shot->triangle) return true;
    shot->vertex_count = s->vertex_count;
    shot->triangle_count = s->triangle_count;
    memcpy(shot->rest, s->rest, (size_t)s->vertex_count * sizeof *s->rest);
    memcpy(shot->triangle, s->triangle, (size_t)s->triangle_count * sizeof *s->triangle);
    return true;
}

// Write caption, scale bar and legend on the picture.
static bool write_on(const kn_shot *shot, const kn_still *s, const kn_scale *scale, uint8_t *rgba, char *error,
                     size_t error_size)
{
    char bar[32];
    kn_label label = {.caption = s->caption, .scale = s->view.value ? scale : NULL};
    const double bar_m = kn_renderer_bar(shot->renderer, label.bar_at);
    kn_label_bar(&label, bar, bar_m, shot->width, shot->height);
    return kn_label_draw(&label, shot->width, shot->height, rgba, error, error_size);
}

bool kn_shot_take(kn_shot *shot, kn_still *s, const kn_scale *scale, kn_shot_words words, uint8_t *rgba, char *error,
                  size_t error_size)
{
    if (!load_mesh(shot, s)) {
        snprintf(error, error_size, "a mesh of %d vertices and %d triangles cannot be drawn", s->vertex_count,
                 s->triangle_count);
        return false;
    }
    kn_still_scale(s, scale ? scale->top : 1);
    s->view.xyz = (const float(*)[3])s->now;
    kn_renderer_draw(shot->renderer, &s->view, rgba);
    return words == KN_SHOT_PLAIN || write_on(shot, s, words == KN_SHOT_LEGEND ? scale : NULL, rgba, error, error_size);
}

void kn_shot_close(kn_shot *shot)
{
    if (!shot) return;
    kn_renderer_close(shot->renderer);
    forget_mesh(shot);
    free(shot);
}

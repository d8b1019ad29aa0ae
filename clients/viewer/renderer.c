#include "clients/viewer/renderer.h"
#include "clients/viewer/shading.h"
#include "clients/viewer/label.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Side of the shadow map, texels. On a block of 5 cm, a texel is 0.16 mm, or 0.32 mm with one sample per pixel.
#define SHADOW_SIZE(r) ((r)->samples > 1 ? 1024 : 512)
// Shadows are drawn within this radius around the middle of the object. The radius is a multiple of the object's
// longest side.
#define LIT_RADIUS 1.6f
// When the shadow map is read, points are moved off the surface by this distance, in half texels.
#define SHADOW_BIAS 3.0f
#define HAND_LINE 0.008f // width of a hand's outline, as a fraction of half the picture's height

// Colour of the table, and of the background into which the table fades.
static const float table_color[3] = {0.925f, 0.93f, 0.935f};
static const float tool_color[3] = {0.45f, 0.52f, 0.60f};
static const float outside_color[3] = {0.74f, 0.77f, 0.80f};
static const float hand_color[3] = {0.42f, 0.58f, 0.88f};
static const float arrow_color[3] = {0.86f, 0.30f, 0.12f};

struct kn_renderer {
    kn_offscreen *screen;
    const kn_gl *gl;
    kn_shader_programs program;
    GLuint shadow_frame, shadow_map;
    kn_drawn_shapes tools;
    kn_gl_mesh square, object, edges;
    kn_shaded_mesh *mesh;
    float *corners; // [triangle_count][3][6] position and normal of each corner
    int width, height, samples;
    kn_camera camera;
    int side; // side of the object that is at the left of the picture: 0 front, 1 right, 2 back, 3 left
    float key[3], light[16];
    float square_m;
};

// ---- open, mesh, close

static void create_shapes(kn_renderer *r)
{
    static const float square[] = {-1, -1, 0, 0, 0, 1, 1, -1, 0, 0, 0, 1, 1,  1, 0, 0, 0, 1,
                                   -1, -1, 0, 0, 0, 1, 1, 1,  0, 0, 0, 1, -1, 1, 0, 0, 0, 1};
    r->tools = kn_drawn_shapes_create(r->gl);
    r->square = kn_gl_mesh_create(r->gl);
    kn_gl_mesh_upload(r->gl, &r->square, 6, square, GL_STATIC_DRAW);
    r->object = kn_gl_mesh_create(r->gl);
    r->gl->GenVertexArrays(1, &r->edges.array); // edges of the lattice have positions only, without normals
    r->gl->BindVertexArray(r->edges.array);
    r->gl->GenBuffers(1, &r->edges.buffer);
    r->gl->GenBuffers(1, &r->edges.values);
    r->gl->EnableVertexAttribArray(0);
}

// Return the longest side of the object.
static float scale_of(const kn_shaded_mesh *s)
{
    float longest = 1e-6f;
    for (int i = 0; i < 3; i++) longest = fmaxf(longest, s->rest_high[i] - s->rest_low[i]);
    return longest;
}

// Create the shadow map: a depth texture whose sampler compares depths, drawn through a frame buffer without colour.
static bool create_shadow_map(kn_renderer *r)
{
    const kn_gl *gl = r->gl;
    gl->GenTextures(1, &r->shadow_map);
    gl->BindTexture(GL_TEXTURE_2D, r->shadow_map);
    gl->TexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT24, SHADOW_SIZE(r), SHADOW_SIZE(r), 0, GL_DEPTH_COMPONENT,
                   GL_FLOAT, NULL);
    gl->TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    gl->TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    gl->TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    gl->TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    gl->TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
    gl->GenFramebuffers(1, &r->shadow_frame);
    gl->BindFramebuffer(GL_FRAMEBUFFER, r->shadow_frame);
    gl->FramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, r->shadow_map, 0);
    gl->DrawBuffer(GL_NONE);
    gl->ReadBuffer(GL_NONE);
    return gl->CheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
}

static bool create(kn_renderer *r, char *error, size_t error_size)
{
    r->screen = kn_offscreen_open(r->width, r->height, r->samples, error, error_size);
    if (!r->screen) return false;
    r->gl = kn_offscreen_begin(r->screen);
    if (!kn_shader_programs_create(r->gl, &r->program, error, error_size)) return false;
    create_shapes(r);
    if (create_shadow_map(r)) return true;
    snprintf(error, error_size, "OpenGL cannot create a shadow map of %d x %d", SHADOW_SIZE(r), SHADOW_SIZE(r));
    return false;
}

kn_renderer *kn_renderer_open(int width, int height, int samples, char *error, size_t error_size)
{
    kn_renderer *r = calloc(1, sizeof *r);
    if (!r) {
        snprintf(error, error_size, "out of memory");
        return NULL;
    }
    r->width = width;
    r->height = height;
    r->samples = samples;
    if (create(r, error, error_size)) return r;
    kn_renderer_close(r);
    return NULL;
}

void kn_renderer_close(kn_renderer *r)
{
    if (!r) return;
    kn_offscreen_close(r->screen);
    kn_shaded_mesh_destroy(r->mesh);
    free(r->corners);
    free(r);
}

bool kn_renderer_mesh(kn_renderer *r, int vertex_count, const float (*rest)[3], int triangle_count,
                      const int (*triangle)[3])
{
    const kn_gl *gl = kn_offscreen_begin(r->screen);
    kn_shaded_mesh_destroy(r->mesh);
    free(r->corners);
    r->corners = NULL;
    r->mesh = kn_shaded_mesh_create(vertex_count, rest, triangle_count, triangle);
    if (!r->mesh) return false;
    size_t corners = 3 * (size_t)triangle_count;
    r->corners = calloc(corners, 6 * sizeof *r->corners);
    if (!r->corners) return false;
    // Choose the side of the table's squares: the power of ten that gives 2 to 20 squares along the object's longest
    // side.
    r->square_m = powf(10, floorf(log10f(scale_of(r->mesh) / 2)));
    // Compute the barycentric distance of each corner from each side. A side that is not drawn as a line gets the
    // distance 1 from every corner.
    for (size_t i = 0; i < corners; i++)
        for (size_t side = 0; side < 3; side++)
            r->corners[3 * i + side] = i % 3 == side || !r->mesh->line[i - i % 3 + side];
    gl->BindVertexArray(r->object.array);
    gl->BindBuffer(GL_ARRAY_BUFFER, r->object.sides);
    gl->BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(corners * 3 * sizeof *r->corners), r->corners, GL_STATIC_DRAW);
    gl->VertexAttribPointer(2, 3, GL_FLOAT, GL_FALSE, 0, NULL);
    gl->EnableVertexAttribArray(2);
    return true;
}

// ---- camera and light

// Aim the camera at the place of the undeformed object. If scene->follow is set and the object has moved beyond this
// place by more than a quarter of its longest side, show both the place and the object.
static void aim(kn_renderer *r, const kn_view_scene *scene)
{
    const kn_shaded_mesh *s = r->mesh;
    float low[3], high[3], beyond = 0;
    for (int i = 0; i < 3; i++) {
        low[i] = s->rest_low[i], high[i] = s->rest_high[i];
        for (int v = 0; v < s->vertex_count && scene->follow; v++) {
            if (!isfinite(scene->xyz[v][i])) continue;
            low[i] = fminf(low[i], scene->xyz[v][i]), high[i] = fmaxf(high[i], scene->xyz[v][i]);
        }
        beyond = fmaxf(beyond, fmaxf(s->rest_low[i] - low[i], high[i] - s->rest_high[i]));
    }
    bool left = beyond > 0.25f * scale_of(s);
    const float *box[2] = {left ? low : s->rest_low, left ? high : s->rest_high};
    if (scene->frame) box[0] = scene->frame[0], box[1] = scene->frame[1];
    kn_camera_look(&r->camera, box[0], box[1],
                   &(kn_camera_view){scene->azimuth_deg, scene->elevation_deg, scene->zoom, scene->turns,
                                     (float)r->width / (float)r->height});
    r->side = (int)floor(scene->azimuth_deg / 90 + 1e-9) & 3;
}

static void orthographic_matrix(float out[16], float half, float near, float far)
{
    for (int i = 0; i < 16; i++) out[i] = 0;
    out[0] = out[5] = 1 / half;
    out[10] = 2 / (near - far);
    out[14] = (far + near) / (near - far);
    out[15] = 1;
}

// Place the light at the upper left of the viewer, whatever the azimuth.
static void light_up(kn_renderer *r, const kn_view_scene *scene)
{
    float right[3], up[3], back[3], eye[3], view[16], box[16], radius = LIT_RADIUS * scale_of(r->mesh);
    kn_camera_axes(scene->azimuth_deg - 52, 48, right, up, back);
    memcpy(r->key, back, sizeof r->key);
    for (int i = 0; i < 3; i++) eye[i] = 0.5f * (r->mesh->rest_low[i] + r->mesh->rest_high[i]) + 2 * radius * back[i];
    kn_mat_view(view, right, up, back, eye);
    orthographic_matrix(box, radius, 0.5f * radius, 4 * radius);
    kn_mat_mul(r->light, box, view);
}

// ---- drawing

static void set_matrix(const kn_gl *gl, GLuint program, const char *name, const float m[16])
{
    gl->UniformMatrix4fv(gl->GetUniformLocation(program, name), 1, GL_FALSE, m);
}

static void set_vector(const kn_gl *gl, GLuint program, const char *name, const float v[3])
{
    gl->Uniform3fv(gl->GetUniformLocation(program, name), 1, v);
}

// Set a colour. Square its components to convert them to linear light, because the shaders use a gamma of 2.
static void set_color(const kn_gl *gl, GLuint program, const float color[3])
{
    set_vector(gl, program, "u_color", (float[]){color[0] * color[0], color[1] * color[1], color[2] * color[2]});
}

static void set_scale(const kn_renderer *r, GLuint program)
{
    float linear[KN_SCALE_COLORS][3];
    for (int i = 0; i < KN_SCALE_COLORS; i++)
        for (int k = 0; k < 3; k++) linear[i][k] = kn_scale_color[i][k] * kn_scale_color[i][k];
    r->gl->Uniform3fv(r->gl->GetUniformLocation(program, "u_scale"), KN_SCALE_COLORS, linear[0]);
}

static void set_number(const kn_gl *gl, GLuint program, const char *name, float value)
{
    gl->Uniform1f(gl->GetUniformLocation(program, name), value);
}

// Compute the matrix that places a unit shape in the world. The z axis of the shape points along `direction` (a unit
// vector). sx, sy, sz: factors by which the shape is scaled.
static void place(float m[16], const float at[3], const float direction[3], float sx, float sy, float sz)
{
    float x[3] = {1, 0, 0}, y[3];
    if (fabsf(direction[0]) > 0.9f) memcpy(x, (float[]){0, 1, 0}, sizeof x);
    kn_crossf(y, direction, x);
    kn_normalizef(y);
    kn_crossf(x, y, direction);
    for (int i = 0; i < 3; i++) {
        m[i] = sx * x[i];
        m[4 + i] = sy * y[i];
        m[8 + i] = sz * direction[i];
        m[12 + i] = at[i];
        m[4 * i + 3] = 0;
    }
    m[15] = 1;
}

// Draw a shape with the depth program or the program for solids. The depth program draws the shadow map; it needs only
// the matrix that places the shape.
static void draw_shape(const kn_renderer *r, GLuint program, const kn_gl_mesh *s, const float model[16],
                       const float color[3], float gloss, float lines)
{
    const kn_gl *gl = r->gl;
    if (s->corners == 0) return;
    set_matrix(gl, program, "u_model", model);
    if (program == r->program.solid) {
        set_color(gl, program, color);
        set_number(gl, program, "u_gloss", gloss);
        set_number(gl, program, "u_lines", lines);
    }
    gl->BindVertexArray(s->array);
    gl->DrawArrays(GL_TRIANGLES, 0, s->corners);
}

// ---- tools

static void draw_arrow(const kn_renderer *r, GLuint program, const kn_drawn_arrow *a)
{
    float m[16], at[3];
    // A short arrow is thinner, so that its head keeps its shape.
    float width = fminf(0.08f * r->square_m, a->length / 4.5f), head = 3 * width;
    place(m, a->tail, a->direction, width, width, a->length - head);
    draw_shape(r, program, &r->tools.rod, m, arrow_color, 0.1f, 0);
    for (int i = 0; i < 3; i++) at[i] = a->tail[i] + (a->length - head) * a->direction[i];
    place(m, at, a->direction, 2 * width, 2 * width, head);
    draw_shape(r, program, &r->tools.cone, m, arrow_color, 0.1f, 0);
}

// Draw the outline of a hand, in front of everything. First draw only the depth of the hand. Then draw the back faces
// of a slightly larger hand behind the first one, so that only a rim is visible.
static void draw_hand(const kn_renderer *r, const kn_view_probe *hand)
{
    const kn_gl *gl = r->gl;
    const double *x = hand->position_m;
    const float *eye = r->camera.eye;
    const float away = hypotf(hypotf((float)x[0] - eye[0], (float)x[1] - eye[1]), (float)x[2] - eye[2]);
    kn_drawn_solid s[KN_DRAWN_SOLIDS_MAX];
    const int count = kn_drawn_probe_solids(&r->tools, hand, s);
    gl->Clear(GL_DEPTH_BUFFER_BIT);
    for (int outline = 0; outline < 2; outline++) {
        const GLboolean seen = outline ? GL_TRUE : GL_FALSE;
        gl->ColorMask(seen, seen, seen, seen);
        gl->CullFace(outline ? GL_FRONT : GL_BACK);
        set_number(gl, r->program.solid, "u_grow", (float)outline * HAND_LINE * r->camera.tan_half * away);
        set_number(gl, r->program.solid, "u_flat", (float)outline);
        for (int i = 0; i < count; i++) draw_shape(r, r->program.solid, s[i].shape, s[i].place, hand_color, 0, 0);
    }
    gl->CullFace(GL_BACK);
    set_number(gl, r->program.solid, "u_grow", 0);
    set_number(gl, r->program.solid, "u_flat", 0);
}

// Draw all hands. They come last, because each of them clears the depth buffer.
static void draw_hands(const kn_renderer *r, const kn_view_scene *scene)
{
    kn_view_probe hand;
    r->gl->UseProgram(r->program.solid);
    for (int i = 0; i < scene->probe_count && i < KN_PROBES_MAX; i++)
        if (kn_drawn_probe_hand(scene, &scene->probe[i], &hand)) draw_hand(r, &hand);
}

// Draw a probe with its arrow. A probe that does not act on the object is pale and casts no shadow.
static void draw_probe(const kn_renderer *r, GLuint program, const kn_view_probe *p)
{
    if (p->outside && program == r->program.depth) return;
    kn_drawn_solid s[KN_DRAWN_SOLIDS_MAX];
    for (int i = 0, n = kn_drawn_probe_solids(&r->tools, p, s); i < n; i++)
        draw_shape(r, program, s[i].shape, s[i].place, p->outside ? outside_color : tool_color,
                   s[i].shape == &r->tools.box ? 0.25f : 0.5f, 0);
    kn_drawn_arrow a = kn_drawn_probe_arrow(p, r->square_m);
    if (a.length > 0) draw_arrow(r, program, &a);
}

static void draw_edges(const kn_renderer *r, const kn_view_scene *scene)
{
    const kn_gl *gl = r->gl;
    gl->UseProgram(r->program.edge);
    set_matrix(gl, r->program.edge, "u_camera", r->camera.matrix);
    set_color(gl, r->program.edge, scene->color);
    set_scale(r, r->program.edge);
    set_number(gl, r->program.edge, "u_scaled", scene->edge_value != NULL);
    gl->BindVertexArray(r->edges.array);
    gl->DrawArrays(GL_LINES, 0, r->edges.corners);
    gl->UseProgram(r->program.solid);
}

// Draw the object in the style of the scene. In every style, the surface of the object casts the shadow.
static void draw_object(const kn_renderer *r, GLuint program, const kn_view_scene *scene)
{
    static const float here[3] = {0, 0, 0}, up[3] = {0, 0, 1};
    const kn_gl *gl = r->gl;
    const bool seen = program == r->program.solid, wire = scene->style == KN_VIEW_WIRE;
    float m[16];
    if (seen && scene->style == KN_VIEW_EDGES) {
        draw_edges(r, scene);
        return;
    }
    place(m, here, up, 1, 1, 1);
    if (seen && scene->value) set_scale(r, program), set_number(gl, program, "u_scaled", 1);
    // In the wire style, the far side is visible through the surface, so draw back faces as well.
    if (seen && wire) set_number(gl, program, "u_wire", 0.5f), gl->Disable(GL_CULL_FACE);
    draw_shape(r, program, &r->object, m, scene->color, 0.06f, scene->style == KN_VIEW_LINED ? 0.30f : 0);
    if (seen && wire) gl->Enable(GL_CULL_FACE);
    if (seen) set_number(gl, program, "u_wire", 0), set_number(gl, program, "u_scaled", 0);
}

static void draw_solids(const kn_renderer *r, GLuint program, const kn_view_scene *scene)
{
    draw_object(r, program, scene);
    for (int i = 0; i < scene->probe_count && i < KN_PROBES_MAX; i++)
        if (kn_drawn_probe_is_finite(&scene->probe[i])) draw_probe(r, program, &scene->probe[i]);
}

// Clear the shadow map and make it the target of all drawing.
static void clear_shadow_map(const kn_renderer *r)
{
    const kn_gl *gl = r->gl;
    gl->BindFramebuffer(GL_FRAMEBUFFER, r->shadow_frame);
    gl->Viewport(0, 0, SHADOW_SIZE(r), SHADOW_SIZE(r));
    gl->Clear(GL_DEPTH_BUFFER_BIT);
}

static void draw_shadow_map(const kn_renderer *r, const kn_view_scene *scene)
{
    const kn_gl *gl = r->gl;
    clear_shadow_map(r);
    gl->UseProgram(r->program.depth);
    set_matrix(gl, r->program.depth, "u_light", r->light);
    gl->Enable(GL_POLYGON_OFFSET_FILL);
    gl->PolygonOffset(3, 4); // shift the depths away from the light, so that no surface casts a shadow on itself
    draw_solids(r, r->program.depth, scene);
    gl->Disable(GL_POLYGON_OFFSET_FILL);
}

// Set the uniforms that the programs for the solids and for the table need: camera, eye, light, shadow map.
static void use_lit(const kn_renderer *r, GLuint program)
{
    // Matrix that maps the range -1..1 of each coordinate to 0..1.
    static const float half[16] = {0.5f, 0, 0, 0, 0, 0.5f, 0, 0, 0, 0, 0.5f, 0, 0.5f, 0.5f, 0.5f, 1};
    const kn_gl *gl = r->gl;
    float shadow[16];
    kn_mat_mul(shadow, half, r->light);
    gl->UseProgram(program);
    gl->BindTexture(GL_TEXTURE_2D, r->shadow_map);
    gl->Uniform1i(gl->GetUniformLocation(program, "u_shadow"), 0);
    set_matrix(gl, program, "u_camera", r->camera.matrix);
    set_matrix(gl, program, "u_light", shadow);
    set_vector(gl, program, "u_eye", r->camera.eye);
    set_vector(gl, program, "u_key", r->key);
    set_number(gl, program, "u_height", r->mesh->rest_high[2] - r->mesh->rest_low[2]);
}

// Find the footprint of the object on the table: the rectangle around the vertices of its lowest quarter. Return the
// radius with which the corners of the rectangle are rounded. The radius is computed from the largest sum |x| + |y| of
// these vertices, where x and y are measured from the middle in half sides of the rectangle. If the vertices fill the
// rectangle, the sum is 2 and the radius is 0. If they form an ellipse, the sum is sqrt 2 and the radius is half the
// shorter side.
static float footprint(const kn_shaded_mesh *s, const float (*xyz)[3], float foot[4])
{
    float quarter = s->rest_low[2] + 0.25f * (s->rest_high[2] - s->rest_low[2]);
    memcpy(foot, (float[]){INFINITY, INFINITY, -INFINITY, -INFINITY}, 4 * sizeof *foot);
    for (int v = 0; v < s->vertex_count; v++) {
        if (!(xyz[v][2] <= quarter)) continue;
        for (int i = 0; i < 2; i++) {
            foot[i] = fminf(foot[i], xyz[v][i]);
            foot[2 + i] = fmaxf(foot[2 + i], xyz[v][i]);
        }
    }
    float half[2] = {0.5f * (foot[2] - foot[0]), 0.5f * (foot[3] - foot[1])}, most = 0;
    for (int v = 0; v < s->vertex_count && half[0] > 0 && half[1] > 0; v++)
        if (xyz[v][2] <= quarter)
            most = fmaxf(most, fabsf(xyz[v][0] - foot[0] - half[0]) / half[0] +
                                   fabsf(xyz[v][1] - foot[1] - half[1]) / half[1]);
    return most > 0 ? fminf(fmaxf((2 - most) / (2 - 1.4142136f), 0), 1) * fminf(half[0], half[1]) : 0;
}

// Return the height of the table. It is slightly below the object, so that table and underside do not flicker.
static float level_of(const kn_renderer *r) { return r->mesh->rest_low[2] - 1e-3f * scale_of(r->mesh); }

// Put the rectangle of the bar on the table into `bar`: low x, low y, high x, high y. The bar lies in front of the
// object's side that is at the left of the picture.
static void bar_of(const kn_renderer *r, float bar[4])
{
    const float *low = r->mesh->rest_low, *high = r->mesh->rest_high, s = r->square_m;
    const float away = 1.5f * s, wide = 0.12f * s;
    const float place[4][4] = {
        {low[0], low[1] - away, low[0] + s, low[1] - away + wide},
        {high[0] + away - wide, low[1], high[0] + away, low[1] + s},
        {high[0] - s, high[1] + away - wide, high[0], high[1] + away},
        {low[0] - away, high[1] - s, low[0] - away + wide, high[1]},
    };
    memcpy(bar, place[r->side], 4 * sizeof *bar);
}

double kn_renderer_bar(const kn_renderer *r, float at[2])
{
    const float *m = r->camera.matrix;
    float bar[4];
    bar_of(r, bar);
    // Find the middle of the bar's edge that is farther from the object and so nearer to the camera.
    float p[3] = {0.5f * (bar[0] + bar[2]), 0.5f * (bar[1] + bar[3]), level_of(r)};
    const int across = r->side % 2 == 0; // axis across the edge: 0 is x, 1 is y
    p[across] = bar[across + (r->side == 1 || r->side == 2 ? 2 : 0)];
    // Project the edge's middle into the picture.
    const float w = m[3] * p[0] + m[7] * p[1] + m[11] * p[2] + m[15];
    for (int i = 0; i < 2; i++) at[i] = (m[i] * p[0] + m[4 + i] * p[1] + m[8 + i] * p[2] + m[12 + i]) / w;
    at[0] = 0.5f * (1 + at[0]) * (float)r->width;
    at[1] = 0.5f * (1 - at[1]) * (float)r->height;
    return r->square_m;
}

// Draw the table, as a square that fills the picture.
static void draw_table(const kn_renderer *r, const float foot[4], float corner)
{
    const kn_gl *gl = r->gl;
    const GLuint program = r->program.table;
    const float tan_half = r->camera.tan_half, tan_half_x = tan_half * r->camera.aspect;
    float s = r->square_m, bar[4], sight[3][3];
    bar_of(r, bar);
    for (int i = 0; i < 3; i++) {
        sight[0][i] = tan_half_x * r->camera.right[i];
        sight[1][i] = tan_half * r->camera.up[i];
        sight[2][i] = -r->camera.back[i];
    }
    use_lit(r, program);
    set_color(gl, program, table_color);
    set_vector(gl, program, "u_right", sight[0]);
    set_vector(gl, program, "u_up", sight[1]);
    set_vector(gl, program, "u_forward", sight[2]);
    gl->Uniform4fv(gl->GetUniformLocation(program, "u_foot"), 1, foot);
    set_number(gl, program, "u_corner", corner);
    gl->Uniform4fv(gl->GetUniformLocation(program, "u_bar"), 1, bar);
    set_number(gl, program, "u_square", s);
    set_number(gl, program, "u_reach", 4 * scale_of(r->mesh));
    set_number(gl, program, "u_level", level_of(r));
    gl->BindVertexArray(r->square.array);
    gl->DrawArrays(GL_TRIANGLES, 0, r->square.corners);
}

static void set_values(const kn_gl *gl, const kn_gl_mesh *s, const float *value, int count)
{
    gl->BindVertexArray(s->array);
    gl->BindBuffer(GL_ARRAY_BUFFER, s->values);
    gl->BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)((size_t)count * sizeof *value), value, GL_STREAM_DRAW);
    gl->VertexAttribPointer(3, 1, GL_FLOAT, GL_FALSE, 0, NULL);
    gl->EnableVertexAttribArray(3);
}

// Detach the buffer of values, because it may belong to an earlier, smaller mesh.
static void unset_values(const kn_gl *gl, const kn_gl_mesh *s)
{
    gl->BindVertexArray(s->array);
    gl->DisableVertexAttribArray(3);
}

// Upload the values on the colour scale. r->corners serves as scratch memory, because the corners have already been
// uploaded.
static void upload_values(kn_renderer *r, const kn_view_scene *scene)
{
    const kn_shaded_mesh *s = r->mesh;
    for (int i = 0; i < 3 * s->triangle_count; i++) r->corners[i] = scene->value[s->triangle[i]];
    set_values(r->gl, &r->object, r->corners, 3 * s->triangle_count);
}

static void upload_edges(kn_renderer *r, const kn_view_scene *scene)
{
    const kn_gl *gl = r->gl;
    kn_gl_mesh *s = &r->edges;
    s->corners = 2 * scene->edge_count;
    gl->BindVertexArray(s->array);
    gl->BindBuffer(GL_ARRAY_BUFFER, s->buffer);
    gl->BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)((size_t)scene->edge_count * sizeof *scene->edge), scene->edge,
                   GL_STREAM_DRAW);
    gl->VertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, 0, NULL);
    if (scene->edge_value) set_values(gl, s, scene->edge_value[0], s->corners);
    else unset_values(gl, s);
}

// Upload the positions, values and edges of this picture.
static void upload(kn_renderer *r, const kn_view_scene *scene)
{
    kn_shaded_mesh_corners(r->mesh, scene->xyz, r->corners);
    kn_gl_mesh_upload(r->gl, &r->object, 3 * r->mesh->triangle_count, r->corners, GL_STREAM_DRAW);
    if (scene->value) upload_values(r, scene);
    else unset_values(r->gl, &r->object);
    if (scene->style == KN_VIEW_EDGES) upload_edges(r, scene);
}

void kn_renderer_draw(kn_renderer *r, const kn_view_scene *scene, uint8_t *rgba)
{
    const kn_gl *gl = kn_offscreen_begin(r->screen);
    const kn_gl_target *target = kn_offscreen_target(r->screen);
    float foot[4];
    kn_drawn_shapes_load(&r->tools, scene);
    aim(r, scene);
    light_up(r, scene);
    float corner = footprint(r->mesh, scene->xyz, foot);
    upload(r, scene);

    // Draw the shadow map, then the solids.
    gl->Enable(GL_DEPTH_TEST);
    draw_shadow_map(r, scene);
    kn_gl_target_solids(gl, target);
    gl->Enable(GL_CULL_FACE);
    use_lit(r, r->program.solid);
    set_number(gl, r->program.solid, "u_bias", SHADOW_BIAS * LIT_RADIUS * scale_of(r->mesh) / (float)SHADOW_SIZE(r));
    draw_solids(r, r->program.solid, scene);
    const bool soft = r->samples > 1; // with several samples per pixel, the solids cover edge pixels only partly
    if (soft) draw_hands(r, scene);
    gl->Disable(GL_CULL_FACE);

    // Resolve the solids, and draw the table behind them.
    kn_gl_target_picture(gl, target);
    if (soft) gl->Disable(GL_DEPTH_TEST);
    if (soft) gl->Enable(GL_BLEND);
    // Let the table fill the fraction of each pixel that the solids leave free. This fraction is 1 - alpha.
    gl->BlendFunc(GL_ONE_MINUS_DST_ALPHA, GL_ONE);
    draw_table(r, foot, corner);
    gl->Disable(GL_BLEND);
    gl->Enable(GL_CULL_FACE);
    // With one sample per pixel, draw the hands after the table, because the hands clear the depth buffer that the
    // table needs.
    if (!soft) draw_hands(r, scene);
    gl->Disable(GL_CULL_FACE);
    gl->Disable(GL_DEPTH_TEST);
    kn_offscreen_read_rgba(r->screen, rgba);
}

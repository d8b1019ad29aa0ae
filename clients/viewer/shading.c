#include "clients/viewer/shading.h"
#include "clients/viewer/camera.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---- normals and lines of a mesh

// Cosine of 40 degrees, the smallest angle between two triangles that meet in a crease. The angle is 90 degrees at the
// edges of a block, and 22 degrees between the facets of a cylinder with 16 sides.
#define CREASE_COS 0.766f
#define COPLANAR_COS 0.9999f // cosine of 0.8 degrees, the largest angle between two triangles that count as coplanar

typedef struct half_edge { // a side of a triangle
    // Vertices of the side in ascending order, so that the half edges of two neighbours compare equal.
    int low, high;
    int triangle, corner; // triangle: index of the triangle; corner: index of its corner opposite the side
} half_edge;

// Compare two half edges by their vertices, so that after sorting the half edges of neighbours are adjacent. If the
// vertices are equal, compare the indices of the triangles, so that the order is unique.
static int compare(const void *pa, const void *pb)
{
    const half_edge *a = pa, *b = pb;
    if (a->low != b->low) return a->low < b->low ? -1 : 1;
    if (a->high != b->high) return a->high < b->high ? -1 : 1;
    return a->triangle < b->triangle ? -1 : a->triangle > b->triangle;
}

static void subtract(float out[3], const float a[3], const float b[3])
{
    for (int i = 0; i < 3; i++) out[i] = a[i] - b[i];
}

static void face_normal(const int t[3], const float (*xyz)[3], float normal[3])
{
    float u[3], v[3];
    subtract(u, xyz[t[1]], xyz[t[0]]);
    subtract(v, xyz[t[2]], xyz[t[0]]);
    kn_crossf(normal, u, v);
    kn_normalizef(normal);
}

// Return the squared length of the side opposite this corner.
static float side_squared(const int t[3], const float (*xyz)[3], int corner)
{
    float d[3];
    subtract(d, xyz[t[(corner + 1) % 3]], xyz[t[(corner + 2) % 3]]);
    return kn_dotf(d, d);
}

// Return whether the side opposite this corner is clearly the longest of the triangle.
static bool longest(const int t[3], const float (*xyz)[3], int corner)
{
    float own = 0.999f * side_squared(t, xyz, corner);
    return own > side_squared(t, xyz, (corner + 1) % 3) && own > side_squared(t, xyz, (corner + 2) % 3);
}

// Return the representative of the set that contains `i` (union-find with path halving).
static int root(int *parent, int i)
{
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

// Let two neighbouring triangles share normals: at both ends of their common side, join the corners of the two
// triangles into one group.
static void join_corners(kn_shaded_mesh *s, const half_edge *a, const half_edge *b)
{
    for (int i = 1; i < 3; i++) {
        for (int j = 1; j < 3; j++) {
            int corner_a = 3 * a->triangle + (a->corner + i) % 3, corner_b = 3 * b->triangle + (b->corner + j) % 3;
            if (s->triangle[corner_a] == s->triangle[corner_b])
                s->group[root(s->group, corner_a)] = root(s->group, corner_b);
        }
    }
}

// Compare two neighbouring triangles at rest. If their common side is smooth, let them share normals. If the side is
// the diagonal of a quad, do not draw it as a line.
static void meet(kn_shaded_mesh *s, const float (*rest)[3], const half_edge *a, const half_edge *b)
{
    const int *ta = s->triangle + 3 * a->triangle, *tb = s->triangle + 3 * b->triangle;
    float na[3], nb[3];
    face_normal(ta, rest, na);
    face_normal(tb, rest, nb);
    float cosine = kn_dotf(na, nb);
    if (cosine > CREASE_COS) join_corners(s, a, b);
    // The diagonal of a quad is the longest side of both of its triangles.
    if (cosine > COPLANAR_COS && longest(ta, rest, a->corner) && longest(tb, rest, b->corner))
        s->line[3 * a->triangle + a->corner] = s->line[3 * b->triangle + b->corner] = false;
}

// Number the groups of corners that share a normal 0, 1, 2 ..., in the order of their root corners.
static void number_groups(kn_shaded_mesh *s)
{
    int corners = 3 * s->triangle_count, *number = s->group;
    for (int i = 0; i < corners; i++) number[i] = root(number, i);
    // Every corner now refers to the root of its group. Each root gets the number n of its group, stored as ~n, which
    // is not a valid index. The other corners of the group then read n from the root.
    for (int i = 0; i < corners; i++)
        if (number[i] == i) number[i] = ~s->group_count++;
    for (int i = 0; i < corners; i++)
        if (number[i] >= 0) number[i] = ~number[number[i]];
    for (int i = 0; i < corners; i++)
        if (number[i] < 0) number[i] = ~number[i];
}

// Find the neighbours of all triangles, and determine groups and lines.
static bool find_neighbours(kn_shaded_mesh *s, const float (*rest)[3])
{
    int count = 3 * s->triangle_count;
    half_edge *edge = malloc((size_t)count * sizeof *edge);
    if (!edge) return false;
    // Each corner starts as a group of its own, and each side as a line.
    for (int i = 0; i < count; i++) {
        const int *t = s->triangle + i - i % 3;
        int p = t[(i + 1) % 3], q = t[(i + 2) % 3];
        edge[i] = (half_edge){p < q ? p : q, p < q ? q : p, i / 3, i % 3};
        s->group[i] = i;
        s->line[i] = true;
    }
    qsort(edge, (size_t)count, sizeof *edge, compare);
    // After sorting, the half edges of a shared side are adjacent.
    for (int i = 0; i + 1 < count; i++)
        if (edge[i].low == edge[i + 1].low && edge[i].high == edge[i + 1].high) meet(s, rest, &edge[i], &edge[i + 1]);
    free(edge);
    number_groups(s);
    return true;
}

static bool fill(kn_shaded_mesh *s, const float (*rest)[3], const int (*triangle)[3])
{
    size_t corners = 3 * (size_t)s->triangle_count;
    s->triangle = malloc(corners * sizeof *s->triangle);
    s->group = malloc(corners * sizeof *s->group);
    s->line = malloc(corners * sizeof *s->line);
    if (!s->triangle || !s->group || !s->line) return false;
    memcpy(s->triangle, triangle, corners * sizeof *s->triangle);
    if (!find_neighbours(s, rest)) return false;
    s->normal = malloc(3 * (size_t)s->group_count * sizeof *s->normal);
    for (int i = 0; i < 3; i++) {
        s->rest_low[i] = s->rest_high[i] = rest[0][i];
        for (int v = 1; v < s->vertex_count; v++) {
            s->rest_low[i] = fminf(s->rest_low[i], rest[v][i]);
            s->rest_high[i] = fmaxf(s->rest_high[i], rest[v][i]);
        }
    }
    return s->normal != NULL;
}

kn_shaded_mesh *kn_shaded_mesh_create(int vertex_count, const float (*rest)[3], int triangle_count,
                                      const int (*triangle)[3])
{
    if (vertex_count < 3 || vertex_count > KN_SHADED_VERTICES_MAX) return NULL;
    if (triangle_count < 1 || triangle_count > 2 * KN_SHADED_VERTICES_MAX) return NULL;
    // Triangles may come from the bus, so check the indices of their vertices.
    for (int i = 0; i < 3 * triangle_count; i++)
        if (triangle[i / 3][i % 3] < 0 || triangle[i / 3][i % 3] >= vertex_count) return NULL;
    kn_shaded_mesh *s = calloc(1, sizeof *s);
    if (!s) return NULL;
    s->vertex_count = vertex_count;
    s->triangle_count = triangle_count;
    if (fill(s, rest, triangle)) return s;
    kn_shaded_mesh_destroy(s);
    return NULL;
}

void kn_shaded_mesh_destroy(kn_shaded_mesh *s)
{
    if (!s) return;
    free(s->triangle);
    free(s->group);
    free(s->line);
    free(s->normal);
    free(s);
}

// Return the angle of the triangle at this corner. atan2 is accurate for flat and for thin triangles.
static float corner_angle(const int t[3], const float (*xyz)[3], int corner)
{
    float u[3], v[3], c[3];
    subtract(u, xyz[t[(corner + 1) % 3]], xyz[t[corner]]);
    subtract(v, xyz[t[(corner + 2) % 3]], xyz[t[corner]]);
    kn_crossf(c, u, v);
    return atan2f(sqrtf(kn_dotf(c, c)), kn_dotf(u, v));
}

// Return whether all positions of the triangle are finite.
static bool whole(const int t[3], const float (*xyz)[3])
{
    float sum = 0;
    // A finite coordinate adds 0 to the sum. An infinite coordinate or a NaN makes the sum NaN.
    for (int i = 0; i < 9; i++) sum += 0 * xyz[t[i / 3]][i % 3];
    return sum == 0;
}

void kn_shaded_mesh_corners(kn_shaded_mesh *s, const float (*xyz)[3], float *out)
{
    // Sum the face normals of each group, weighted by the angle of the corner.
    memset(s->normal, 0, 3 * (size_t)s->group_count * sizeof *s->normal);
    for (int t = 0; t < s->triangle_count; t++) {
        const int *triangle = s->triangle + 3 * t;
        if (!whole(triangle, xyz)) continue;
        float n[3];
        face_normal(triangle, xyz, n);
        for (int corner = 0; corner < 3; corner++) {
            float angle = corner_angle(triangle, xyz, corner), *sum = s->normal + 3 * s->group[3 * t + corner];
            for (int i = 0; i < 3; i++) sum[i] += angle * n[i];
        }
    }
    for (int g = 0; g < s->group_count; g++) kn_normalizef(s->normal + 3 * g);
    // Move all corners of a triangle with a position that is not finite to one point, so that it is not visible.
    for (int i = 0; i < 3 * s->triangle_count; i++) {
        const float *at = whole(s->triangle + i - i % 3, xyz) ? xyz[s->triangle[i]] : s->rest_low;
        memcpy(out + 6 * i, at, 3 * sizeof *out);
        memcpy(out + 6 * i + 3, s->normal + 3 * s->group[i], 3 * sizeof *out);
    }
}

// ---- triangles in OpenGL's memory

kn_gl_mesh kn_gl_mesh_create(const kn_gl *gl)
{
    kn_gl_mesh s = {0};
    gl->GenVertexArrays(1, &s.array);
    gl->BindVertexArray(s.array);
    gl->GenBuffers(1, &s.buffer);
    gl->BindBuffer(GL_ARRAY_BUFFER, s.buffer);
    // Define vertex attributes 0 and 1: position and normal, interleaved in one buffer.
    for (GLuint i = 0; i < 2; i++) {
        gl->VertexAttribPointer(i, 3, GL_FLOAT, GL_FALSE, 6 * sizeof(float), (const void *)(i * 3 * sizeof(float)));
        gl->EnableVertexAttribArray(i);
    }
    gl->GenBuffers(1, &s.sides);
    gl->GenBuffers(1, &s.values);
    return s;
}

void kn_gl_mesh_upload(const kn_gl *gl, kn_gl_mesh *s, int corners, const float *data, GLenum usage)
{
    s->corners = corners;
    gl->BindBuffer(GL_ARRAY_BUFFER, s->buffer);
    gl->BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)((size_t)corners * 6 * sizeof *data), data, usage);
}

// Build rings of vertices along the profile, and join neighbouring rings by two triangles per segment.
kn_gl_mesh kn_gl_mesh_revolve(const kn_gl *gl, int count, const float (*profile)[2], int segments)
{
    enum { RINGS = 17, SEGMENTS = 32 };
    float xyz[RINGS * SEGMENTS][3], corners[2 * RINGS * SEGMENTS * 18];
    int triangle[2 * RINGS * SEGMENTS][3], triangles = 0;
    for (int i = 0; i < count; i++) {
        for (int j = 0; j < segments; j++) {
            float angle = 6.2831853f * ((float)j + 0.5f) / (float)segments;
            int next = (j + 1) % segments, a = i * segments + j, b = i * segments + next;
            xyz[a][0] = profile[i][0] * cosf(angle);
            xyz[a][1] = profile[i][0] * sinf(angle);
            xyz[a][2] = profile[i][1];
            if (i + 1 == count) continue;
            // A ring of radius 0 is a single point. Leave out the triangle that would have no area at this ring.
            int c = b + segments, d = a + segments;
            if (profile[i][0] > 0) memcpy(triangle[triangles++], (int[]){a, b, c}, sizeof *triangle);
            if (profile[i + 1][0] > 0) memcpy(triangle[triangles++], (int[]){a, c, d}, sizeof *triangle);
        }
    }
    kn_gl_mesh s = kn_gl_mesh_create(gl);
    s.low = profile[0][1];
    s.high = profile[count - 1][1];
    // Store the extent of the solid. The region of a picture that the solid covers is computed from this extent.
    for (int i = 0; i < count * segments; i++) s.half = fmaxf(s.half, fmaxf(fabsf(xyz[i][0]), fabsf(xyz[i][1])));
    // Compute the normals as for the surface of an object: smooth, except at creases.
    kn_shaded_mesh *mesh =
        kn_shaded_mesh_create(count * segments, (const float(*)[3])xyz, triangles, (const int(*)[3])triangle);
    if (!mesh) return s; // memory is short, so return an empty mesh
    kn_shaded_mesh_corners(mesh, (const float(*)[3])xyz, corners);
    kn_shaded_mesh_destroy(mesh);
    kn_gl_mesh_upload(gl, &s, 3 * triangles, corners, GL_STATIC_DRAW);
    return s;
}

// ---- shaders
//
// Shaders per vertex and per pixel, in GLSL 3.30. Light is summed in linear space and encoded with a gamma of 2 (sqrt)
// at the end. This is close to the gamma of 2.2 of sRGB, and saves 7 ms per 720p picture in software.
#define KN_GLSL "#version 330 core\n"

// Fraction of the key light that reaches a point: the mean of two samples of the shadow map. The sampler compares
// depths and interpolates. Four samples would cost 9 ms more per 720p picture in software.
#define KN_GLSL_SHADOW                                                                                                 \
    "uniform sampler2DShadow u_shadow;\n"                                                                              \
    "float lit(vec3 at)\n"                                                                                             \
    "{\n"                                                                                                              \
    "    vec3 d = vec3(0.6, 0.3, 0.0) / float(textureSize(u_shadow, 0).x);\n"                                          \
    "    return 0.5 * (texture(u_shadow, at + d) + texture(u_shadow, at - d));\n"                                      \
    "}\n"

static const char *const shader_depth_vertex =
    KN_GLSL "layout(location = 0) in vec3 a_position;\n"
            "uniform mat4 u_model, u_light;\n"
            "void main() { gl_Position = u_light * u_model * vec4(a_position, 1.0); }\n";

static const char *const shader_depth_fragment = KN_GLSL "void main() {}\n";

// u_light maps world coordinates to coordinates 0..1 of the shadow map. The shaded point is moved off the surface by
// u_bias, so that rounding errors do not cover a surface with specks of its own shadow.
static const char *const shader_solid_vertex = KN_GLSL "layout(location = 0) in vec3 a_position;\n"
                                                       "layout(location = 1) in vec3 a_normal;\n"
                                                       "layout(location = 2) in vec3 a_side;\n"
                                                       "layout(location = 3) in float a_value;\n"
                                                       "uniform mat4 u_model, u_camera, u_light;\n"
                                                       "uniform float u_bias, u_grow;\n"
                                                       "out vec3 v_position, v_normal, v_side, v_shadow;\n"
                                                       "out float v_value;\n"
                                                       "void main()\n"
                                                       "{\n"
                                                       "    v_value = a_value;\n"
                                                       "    vec4 p = u_model * vec4(a_position, 1.0);\n"
                                                       "    v_position = p.xyz;\n"
                                                       "    v_normal = normalize(mat3(u_model) * a_normal);\n"
                                                       "    v_side = a_side;\n"
                                                       "    v_shadow = (u_light * vec4(p.xyz + u_bias * v_normal, "
                                                       "1.0)).xyz;\n" // u_bias moves the point off the surface
                                                       "    gl_Position = u_camera * (p + vec4(u_grow * v_normal, "
                                                       "0.0));\n"
                                                       "}\n";

// Colour of a value (0..1) on the colour scale: interpolated linearly between the scale's colours, in linear light.
#define KN_GLSL_SCALE                                                                                                  \
    "uniform vec3 u_scale[9], u_color;\n"                                                                              \
    "uniform float u_scaled;\n"                                                                                        \
    "vec3 colored(float value)\n"                                                                                      \
    "{\n"                                                                                                              \
    "    if (u_scaled < 0.5 || !(value >= 0.0)) return u_color;\n"                                                     \
    "    float x = min(value, 1.0) * 8.0;\n"                                                                           \
    "    int i = int(min(x, 7.0));\n"                                                                                  \
    "    return mix(u_scale[i], u_scale[i + 1], x - float(i));\n"                                                      \
    "}\n"

// v_side holds the distances from the sides of the triangle that are drawn as lines, in barycentric units. Division by
// their screen derivatives gives the distances in pixels.
static const char *const shader_solid_fragment = KN_GLSL KN_GLSL_SHADOW KN_GLSL_SCALE
    "in vec3 v_position, v_normal, v_side, v_shadow;\n"
    "in float v_value;\n"
    "uniform vec3 u_eye, u_key;\n"
    "uniform float u_gloss, u_lines, u_wire, u_height, u_flat;\n"
    "out vec4 o_color;\n"
    "void main()\n"
    "{\n"
    "    vec3 n = normalize(v_normal), eye = normalize(u_eye - v_position), h = normalize(eye + u_key);\n"
    "    vec3 d = v_side / max(fwidth(v_side), vec3(1e-7));\n"
    "    float line = 1.0 - smoothstep(0.35, 1.25, min(d.x, min(d.y, d.z)));\n"
    "    if (line < u_wire) discard;\n"
    "    vec3 color = colored(v_value) * (1.0 - u_lines * line);\n"
    "    float key = max(dot(n, u_key), 0.0) * lit(v_shadow);\n"
    "    float near_table = mix(0.72, 1.0, smoothstep(0.0, 0.4, v_position.z / u_height));\n"
    "    vec3 sky = mix(vec3(0.24, 0.22, 0.20), vec3(0.40, 0.44, 0.50), 0.5 + 0.5 * n.z) * near_table;\n"
    "    vec3 light = sky + key * vec3(0.84, 0.80, 0.74);\n"
    "    float shine = pow(max(dot(n, h), 0.0), 40.0) * key * u_gloss;\n"
    "    o_color = vec4(sqrt(mix(color * light + shine, u_color, u_flat)), 1.0);\n"
    "}\n";

// Edges of the lattice: unlit lines.
static const char *const shader_edge_vertex =
    KN_GLSL "layout(location = 0) in vec3 a_position;\n"
            "layout(location = 3) in float a_value;\n"
            "uniform mat4 u_camera;\n"
            "out float v_value;\n"
            "void main() { v_value = a_value; gl_Position = u_camera * vec4(a_position, 1.0); }\n";

static const char *const shader_edge_fragment =
    KN_GLSL KN_GLSL_SCALE "in float v_value;\n"
                          "out vec4 o_color;\n"
                          "void main() { o_color = vec4(sqrt(0.8 * colored(v_value)), 1.0); }\n";

// The table fills the pixels that the solids left free. Each pixel shows the point where its line of sight meets the
// height u_level. The table is drawn behind the resolved solids, with one sample per pixel. One sample is enough,
// because the shader softens the edges of the table's lines. Four samples would cost 20 ms more.
static const char *const shader_table_vertex =
    KN_GLSL "layout(location = 0) in vec3 a_position;\n"
            "uniform vec3 u_right, u_up, u_forward;\n" // line of sight through a corner of the picture
            "out vec3 v_sight;\n"
            "void main()\n"
            "{\n"
            "    v_sight = u_forward + a_position.x * u_right + a_position.y * u_up;\n"
            // Depth just below 1: behind everything else in the picture.
            "    gl_Position = vec4(a_position.xy, 0.999999, 1.0);\n"
            "}\n";

// Table with a grid of squares and a bar. The side of a square is u_square metres, and the bar is as long as one side.
// Every fifth line of the grid is stronger. Grid and bar fade into the background. dim(): fraction of the light that
// reaches the table beside the object.
#define KN_GLSL_TABLE                                                                                                  \
    "in vec3 v_sight;\n"                                                                                               \
    "uniform vec3 u_color, u_eye;\n"                                                                                   \
    "uniform vec4 u_bar;\n"                                                                                            \
    "uniform float u_square, u_reach, u_level;\n"                                                                      \
    "out vec4 o_color;\n"                                                                                              \
    "float grid(vec2 p, vec2 pixel, float width)\n"                                                                    \
    "{\n"                                                                                                              \
    "    vec2 d = abs(fract(p - 0.5) - 0.5) / pixel;\n"                                                                \
    "    vec2 strength = clamp(width + 0.5 - d, 0.0, 1.0) * clamp(0.25 / pixel, 0.0, 1.0);\n"                          \
    "    return max(strength.x, strength.y);\n"                                                                        \
    "}\n"                                                                                                              \
    "float away(vec2 p, vec4 box) { return length(max(max(box.xy - p, p - box.zw), 0.0)); }\n"                         \
    "float dim(vec3 p);\n"                                                                                             \
    "void main()\n"                                                                                                    \
    "{\n"                                                                                                              \
    "    vec3 p = u_eye + v_sight * (u_level - u_eye.z) / min(v_sight.z, -1e-4);\n" /* beyond the horizon: far away */ \
    "    vec2 pixel = fwidth(p.xy) / u_square;\n"                                                                      \
    "    float fade = 1.0 - smoothstep(0.35, 1.0, length(p.xy) / u_reach);\n"                                          \
    "    float lines = max(0.16 * grid(p.xy / u_square, pixel, 0.6), 0.30 * grid(p.xy / (5.0 * u_square), pixel / "    \
    "5.0, 0.8));\n"                                                                                                    \
    "    float shade = (1.0 - lines) * dim(p);\n"                                                                      \
    "    float bar = clamp(1.0 - away(p.xy, u_bar) / (u_square * max(pixel.x, pixel.y)), 0.0, 1.0);\n"                 \
    "    o_color = vec4(sqrt(u_color * mix(1.0, mix(shade, 0.03, bar), fade)), 1.0);\n"                                \
    "}\n"

// The object, u_height tall, hides part of the sky from the table beside it. So the table is darker near the footprint
// u_foot (low x, low y, high x, high y), whose corners are rounded by u_corner.
static const char *const shader_table_fragment = KN_GLSL KN_GLSL_SHADOW KN_GLSL_TABLE
    "uniform mat4 u_light;\n"
    "uniform vec4 u_foot;\n"
    "uniform float u_corner, u_height;\n"
    "float dim(vec3 p)\n"
    "{\n"
    "    vec4 inner = u_foot + vec4(u_corner, u_corner, -u_corner, -u_corner);\n"
    "    float near = max(1.0 - max(away(p.xy, inner) - u_corner, 0.0) / (0.6 * u_height), 0.0);\n"
    "    return (1.0 - 0.45 * near * near * near) * mix(0.62, 1.0, lit((u_light * vec4(p, 1.0)).xyz));\n"
    "}\n";

// Table for the part of the picture where no shadow falls and the object does not darken the table: dim() is 1.
static const char *const shader_bare_fragment = KN_GLSL KN_GLSL_TABLE "float dim(vec3 p) { return 1.0; }\n";

// Compile and link a program. On failure return 0 and put the compiler's message in error.
static GLuint create_program(const kn_gl *gl, const char *vertex, const char *fragment, char *error, size_t error_size)
{
    const char *source[2] = {vertex, fragment};
    const GLenum kind[2] = {GL_VERTEX_SHADER, GL_FRAGMENT_SHADER};
    GLuint program = gl->CreateProgram();
    for (int i = 0; i < 2; i++) {
        GLuint shader = gl->CreateShader(kind[i]);
        gl->ShaderSource(shader, 1, &source[i], NULL);
        gl->CompileShader(shader);
        gl->AttachShader(program, shader);
        gl->DeleteShader(shader); // OpenGL keeps the shader until the program is deleted
    }
    gl->LinkProgram(program); // if a shader did not compile, linking fails and the log contains the shader's error
    GLint linked = 0;
    gl->GetProgramiv(program, GL_LINK_STATUS, &linked);
    if (linked) return program;
    char log[256] = "";
    gl->GetProgramInfoLog(program, sizeof log, NULL, log);
    snprintf(error, error_size, "the shaders do not compile on this OpenGL: %s", log);
    gl->DeleteProgram(program);
    return 0;
}

bool kn_shader_programs_create(const kn_gl *gl, kn_shader_programs *p, char *error, size_t error_size)
{
    p->depth = create_program(gl, shader_depth_vertex, shader_depth_fragment, error, error_size);
    p->solid = create_program(gl, shader_solid_vertex, shader_solid_fragment, error, error_size);
    p->table = create_program(gl, shader_table_vertex, shader_table_fragment, error, error_size);
    p->bare = create_program(gl, shader_table_vertex, shader_bare_fragment, error, error_size);
    p->edge = create_program(gl, shader_edge_vertex, shader_edge_fragment, error, error_size);
    return p->depth && p->solid && p->table && p->bare && p->edge;
}

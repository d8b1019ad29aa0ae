#ifndef KN_CLIENTS_VIEWER_SHADERS_H
#define KN_CLIENTS_VIEWER_SHADERS_H
// Shaders per vertex and per pixel, in GLSL 3.30. Light is summed in linear space and encoded with a gamma of 2 (sqrt)
// at the end. This is close to sRGB's 2.2, and saves 7 ms per 720p picture in software.

#define KN_GLSL "#version 330 core\n"

// Key light: two samples of a shadow map whose sampler compares and interpolates. Four samples cost 9 ms more per 720p
// picture in software.
#define KN_GLSL_SHADOW                                                                                                 \
    "uniform sampler2DShadow u_shadow;\n"                                                                              \
    "float lit(vec3 at)\n"                                                                                             \
    "{\n"                                                                                                              \
    "    vec3 d = vec3(0.6, 0.3, 0.0) / float(textureSize(u_shadow, 0).x);\n"                                          \
    "    return 0.5 * (texture(u_shadow, at + d) + texture(u_shadow, at - d));\n"                                      \
    "}\n"

static const char *const kn_shader_depth_vertex =
    KN_GLSL "layout(location = 0) in vec3 a_position;\n"
            "uniform mat4 u_model, u_light;\n"
            "void main() { gl_Position = u_light * u_model * vec4(a_position, 1.0); }\n";

static const char *const kn_shader_depth_fragment = KN_GLSL "void main() {}\n";

// u_light maps the world to the shadow map's 0..1. The shaded point is moved off the surface by u_bias, so that
// rounding errors do not cover a surface with specks of its own shadow.
static const char *const kn_shader_solid_vertex = KN_GLSL "layout(location = 0) in vec3 a_position;\n"
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
static const char *const kn_shader_solid_fragment = KN_GLSL KN_GLSL_SHADOW KN_GLSL_SCALE
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
static const char *const kn_shader_edge_vertex =
    KN_GLSL "layout(location = 0) in vec3 a_position;\n"
            "layout(location = 3) in float a_value;\n"
            "uniform mat4 u_camera;\n"
            "out float v_value;\n"
            "void main() { v_value = a_value; gl_Position = u_camera * vec4(a_position, 1.0); }\n";

static const char *const kn_shader_edge_fragment =
    KN_GLSL KN_GLSL_SCALE "in float v_value;\n"
                          "out vec4 o_color;\n"
                          "void main() { o_color = vec4(sqrt(0.8 * colored(v_value)), 1.0); }\n";

// The table fills the pixels that the solids left free. Each pixel shows the point where its line of sight meets the
// height u_level. The table is drawn behind the resolved solids with one sample per pixel: its lines have their own
// soft edges, and four samples per pixel cost 20 ms more.
static const char *const kn_shader_table_vertex =
    KN_GLSL "layout(location = 0) in vec3 a_position;\n"
            "uniform vec3 u_right, u_up, u_forward;\n" // line of sight through a corner of the picture
            "out vec3 v_sight;\n"
            "void main()\n"
            "{\n"
            "    v_sight = u_forward + a_position.x * u_right + a_position.y * u_up;\n"
            // Depth just below 1: behind everything else in the picture.
            "    gl_Position = vec4(a_position.xy, 0.999999, 1.0);\n"
            "}\n";

// Squares of u_square metres, with every fifth line stronger, and a bar as long as one square. All fade into the
// background. dim(): fraction of the light that the object beside leaves on the table.
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
static const char *const kn_shader_table_fragment = KN_GLSL KN_GLSL_SHADOW KN_GLSL_TABLE
    "uniform mat4 u_light;\n"
    "uniform vec4 u_foot;\n"
    "uniform float u_corner, u_height;\n"
    "float dim(vec3 p)\n"
    "{\n"
    "    vec4 inner = u_foot + vec4(u_corner, u_corner, -u_corner, -u_corner);\n"
    "    float near = max(1.0 - max(away(p.xy, inner) - u_corner, 0.0) / (0.6 * u_height), 0.0);\n"
    "    return (1.0 - 0.45 * near * near * near) * mix(0.62, 1.0, lit((u_light * vec4(p, 1.0)).xyz));\n"
    "}\n";

// Table with the same colours, for the part of the picture that the object does not darken and where no shadow falls.
static const char *const kn_shader_bare_fragment = KN_GLSL KN_GLSL_TABLE "float dim(vec3 p) { return 1.0; }\n";

#endif

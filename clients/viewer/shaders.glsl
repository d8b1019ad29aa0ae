// The programs that OpenGL runs per vertex and per pixel, for the viewer (OpenGL 3.3) and for the live page (WebGL 2). A
// program's name is defined before this text is compiled, and selects its main function.
//
// Light is summed in linear space and encoded with a gamma of 2 (sqrt) at the end. This is close to the gamma of 2.2 of
// sRGB, and saves 7 ms per 720p picture in software.
#ifdef GL_ES
precision highp float;
precision highp int;
precision highp sampler2DShadow;
#endif

#if defined SOLID_FRAGMENT || defined TABLE_FRAGMENT
// Fraction of the key light that reaches a point: the mean of two samples of the shadow map. The sampler compares
// depths and interpolates. Four samples would cost 9 ms more per 720p picture in software. A browser that draws in
// software is slower, and draws no shadows.
uniform sampler2DShadow u_shadow;
float lit(vec3 at)
{
#ifdef MODEST
    return 1.0;
#else
    vec3 d = vec3(0.6, 0.3, 0.0) / float(textureSize(u_shadow, 0).x);
    return 0.5 * (texture(u_shadow, at + d) + texture(u_shadow, at - d));
#endif
}
#endif

#if defined SOLID_FRAGMENT || defined EDGE_FRAGMENT
// Colour of a value (0..1) on the colour scale: interpolated linearly between the scale's colours, in linear light.
uniform vec3 u_scale[9], u_color;
uniform float u_scaled;
vec3 colored(float value)
{
    if (u_scaled < 0.5 || !(value >= 0.0)) return u_color;
    float x = min(value, 1.0) * 8.0;
    int i = int(min(x, 7.0));
    return mix(u_scale[i], u_scale[i + 1], x - float(i));
}
#endif

#ifdef DEPTH_VERTEX
layout(location = 0) in vec3 a_position;
uniform mat4 u_model, u_light;
void main() { gl_Position = u_light * (u_model * vec4(a_position, 1.0)); }
#endif

#ifdef DEPTH_FRAGMENT
void main() {}
#endif

#ifdef SOLID_VERTEX
layout(location = 0) in vec3 a_position;
layout(location = 1) in vec3 a_normal;
layout(location = 2) in vec3 a_side;
layout(location = 3) in float a_value;
// u_light maps world coordinates to coordinates 0..1 of the shadow map. The shaded point is moved off the surface by
// u_bias, so that rounding errors do not cover a surface with specks of its own shadow.
uniform mat4 u_model, u_camera, u_light;
uniform float u_bias, u_grow;
out vec3 v_position, v_normal, v_side, v_shadow;
out float v_value;
void main()
{
    v_value = a_value;
    vec4 p = u_model * vec4(a_position, 1.0);
    v_position = p.xyz;
    v_normal = normalize(mat3(u_model) * a_normal);
    v_side = a_side;
    v_shadow = (u_light * vec4(p.xyz + u_bias * v_normal, 1.0)).xyz;
    gl_Position = u_camera * (p + vec4(u_grow * v_normal, 0.0));
}
#endif

#ifdef SOLID_FRAGMENT
in vec3 v_position, v_normal, v_side, v_shadow;
in float v_value;
uniform vec3 u_eye, u_key;
uniform float u_gloss, u_lines, u_wire, u_height, u_flat;
// Contact patch: where the surface is within u_near of a tool, it has the colour u_touched. Each tool consists of unit
// solids: u_solid converts world coordinates to those of the unit solid, u_size is its kind (1 box, 2 rod, 3 ball) and
// the lengths of its axes.
uniform int u_solids;
uniform mat4 u_solid[6];
uniform vec4 u_size[6];
uniform float u_near;
uniform vec3 u_touched;
// Ghost: within the radius u_ghost.w of the line of sight to u_ghost.xyz, a tool is transparent, so that it does not
// hide its dent. 0: no ghost.
uniform vec4 u_ghost;
uniform float u_alpha; // opacity of the whole solid, less 1
out vec4 o_color;

float outside(int i, vec3 p)
{
    vec3 q = (u_solid[i] * vec4(p, 1.0)).xyz, s = u_size[i].yzw;
    if (u_size[i].x > 2.5) return (length(q) - 1.0) * s.x;
    float away = max(-q.z, q.z - 1.0) * s.z;
    if (u_size[i].x > 1.5) return max((length(q.xy) - 1.0) * s.x, away);
    vec2 d = (abs(q.xy) - 0.5) * s.xy;
    return max(max(d.x, d.y), away);
}

float touched()
{
    float least = u_near;
    for (int i = 0; i < u_solids; i++) least = min(least, outside(i, v_position));
    return u_solids > 0 ? 1.0 - smoothstep(0.4 * u_near, u_near, least) : 0.0;
}

float ghost()
{
    if (u_ghost.w <= 0.0) return 1.0;
    float away = length(cross(normalize(u_ghost.xyz - u_eye), v_position - u_eye));
    return mix(0.25, 1.0, smoothstep(0.8, 1.3, away / u_ghost.w));
}

void main()
{
    vec3 n = normalize(v_normal), eye = normalize(u_eye - v_position), h = normalize(eye + u_key);
    // v_side holds the distances from the sides of the triangle that are drawn as lines, in barycentric units. Division
    // by their screen derivatives gives the distances in pixels.
    vec3 d = v_side / max(fwidth(v_side), vec3(1e-7));
    float line = 1.0 - smoothstep(0.35, 1.25, min(d.x, min(d.y, d.z)));
#ifndef OPAQUE // without `discard`, hidden pixels need not be shaded
    if (line < u_wire) discard;
#endif
    vec3 color = mix(colored(v_value), u_touched, 0.75 * touched()) * (1.0 - u_lines * line);
    float key = max(dot(n, u_key), 0.0) * lit(v_shadow);
    float near_table = mix(0.72, 1.0, smoothstep(0.0, 0.4, v_position.z / u_height));
    vec3 sky = mix(vec3(0.24, 0.22, 0.20), vec3(0.40, 0.44, 0.50), 0.5 + 0.5 * n.z) * near_table;
    vec3 light = sky + key * vec3(0.84, 0.80, 0.74);
    float shine = pow(max(dot(n, h), 0.0), 40.0) * key * u_gloss;
    o_color = vec4(sqrt(mix(color * light + shine, u_color, u_flat)), (1.0 + u_alpha) * ghost());
}
#endif

#ifdef EDGE_VERTEX
// Edges of the lattice: unlit lines.
layout(location = 0) in vec3 a_position;
layout(location = 3) in float a_value;
uniform mat4 u_camera;
out float v_value;
void main() { v_value = a_value; gl_Position = u_camera * vec4(a_position, 1.0); }
#endif

#ifdef EDGE_FRAGMENT
in float v_value;
out vec4 o_color;
void main() { o_color = vec4(sqrt(0.8 * colored(v_value)), 1.0); }
#endif

#ifdef TABLE_VERTEX
// The table fills the pixels that the solids left free. Each pixel shows the point where its line of sight meets the
// height u_level. The table is drawn behind the resolved solids, with one sample per pixel. One sample is enough,
// because the shader softens the edges of the table's lines. Four samples would cost 20 ms more.
layout(location = 0) in vec3 a_position;
uniform vec3 u_right, u_up, u_forward; // line of sight through a corner of the picture
out vec3 v_sight;
void main()
{
    v_sight = u_forward + a_position.x * u_right + a_position.y * u_up;
    gl_Position = vec4(a_position.xy, 0.999999, 1.0); // depth just below 1: behind everything else in the picture
}
#endif

#ifdef TABLE_FRAGMENT
// Table with a grid of squares and a bar. The side of a square is u_square metres, and the bar is as long as one side.
// Every fifth line of the grid is stronger. Grid and bar have the colour u_ink, and fade into the background.
in vec3 v_sight;
uniform vec3 u_color, u_ink, u_eye;
uniform vec4 u_bar;
uniform float u_square, u_reach, u_level;
// The object, u_height tall, hides part of the sky from the table beside it. So the table is darker near the footprint
// u_foot (low x, low y, high x, high y), whose corners are rounded by u_corner.
uniform mat4 u_light;
uniform vec4 u_foot;
uniform float u_corner, u_height;
out vec4 o_color;

float grid(vec2 p, vec2 pixel, float width)
{
    vec2 d = abs(fract(p - 0.5) - 0.5) / pixel;
    vec2 strength = clamp(width + 0.5 - d, 0.0, 1.0) * clamp(0.25 / pixel, 0.0, 1.0);
    return max(strength.x, strength.y);
}

float away(vec2 p, vec4 box) { return length(max(max(box.xy - p, p - box.zw), 0.0)); }

// Fraction of the light that reaches the table at p.
float dim(vec3 p)
{
    vec4 inner = u_foot + vec4(u_corner, u_corner, -u_corner, -u_corner);
    float near = max(1.0 - max(away(p.xy, inner) - u_corner, 0.0) / (0.6 * u_height), 0.0);
    return (1.0 - 0.45 * near * near * near) * mix(0.62, 1.0, lit((u_light * vec4(p, 1.0)).xyz));
}

void main()
{
    vec3 p = u_eye + v_sight * (u_level - u_eye.z) / min(v_sight.z, -1e-4); // beyond the horizon: far away
    vec2 pixel = fwidth(p.xy) / u_square;
    float fade = 1.0 - smoothstep(0.35, 1.0, length(p.xy) / u_reach);
    float lines = max(0.16 * grid(p.xy / u_square, pixel, 0.6), 0.30 * grid(p.xy / (5.0 * u_square), pixel / 5.0, 0.8));
    float bar = clamp(1.0 - away(p.xy, u_bar) / (u_square * max(pixel.x, pixel.y)), 0.0, 1.0);
    vec3 table = mix(u_color, u_ink, lines) * dim(p);
    o_color = vec4(sqrt(mix(u_color, mix(table, mix(u_color, u_ink, 0.97), bar), fade)), 1.0);
}
#endif

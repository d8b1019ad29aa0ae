#include "clients/viewer/form.h"
#include "clients/viewer/skin.h"
#include <math.h>
#include <string.h>

kn_form kn_form_create(const kn_gl *gl)
{
    kn_form s = {0};
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

void kn_form_corners(const kn_gl *gl, kn_form *s, int corners, const float *data, GLenum usage)
{
    s->corners = corners;
    gl->BindBuffer(GL_ARRAY_BUFFER, s->buffer);
    gl->BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)((size_t)corners * 6 * sizeof *data), data, usage);
}

// Build rings of vertices along the profile, and join neighbouring rings by two triangles per segment.
kn_form kn_form_turn(const kn_gl *gl, int count, const float (*profile)[2], int segments)
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
            // A ring of radius 0 is a single point, so one of the two triangles would be empty.
            int c = b + segments, d = a + segments;
            if (profile[i][0] > 0) memcpy(triangle[triangles++], (int[]){a, b, c}, sizeof *triangle);
            if (profile[i + 1][0] > 0) memcpy(triangle[triangles++], (int[]){a, c, d}, sizeof *triangle);
        }
    }
    kn_form s = kn_form_create(gl);
    s.low = profile[0][1];
    s.high = profile[count - 1][1];
    // Store the extent of the solid, from which the region of a picture that it covers is computed.
    for (int i = 0; i < count * segments; i++) s.half = fmaxf(s.half, fmaxf(fabsf(xyz[i][0]), fabsf(xyz[i][1])));
    // Let kn_skin compute the normals: smooth ones, but sharp ones at creases.
    kn_skin *skin = kn_skin_create(count * segments, (const float(*)[3])xyz, triangles, (const int(*)[3])triangle);
    if (!skin) return s; // memory is short, so return an empty form
    kn_skin_corners(skin, (const float(*)[3])xyz, corners);
    kn_skin_destroy(skin);
    kn_form_corners(gl, &s, 3 * triangles, corners, GL_STATIC_DRAW);
    return s;
}

// The object, the tools and the table, drawn by the browser itself (WebGL 2), as clients/viewer draws them: the same
// camera, the same shaders (shaders.glsl). DEVELOPING.md of this folder has the layout of the surface and of the shape.
'use strict';

// ---- vectors, and matrices in columns, as OpenGL reads them

const dot3 = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross3 = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const along = (a, length, b) => a.map((x, i) => x + length * b[i]); // a + length b
const unit = (a) => { const length = Math.hypot(...a); return length > 0 ? a.map((x) => x / length) : a; };

function times(a, b) {
    const out = new Float32Array(16);
    for (let i = 0; i < 16; i++)
        for (let k = 0; k < 4; k++) out[i] += a[4 * k + i % 4] * b[i - i % 4 + k];
    return out;
}

const rigid = ([x, y, z], at) => new Float32Array([...x, 0, ...y, 0, ...z, 0, ...at, 1]); // columns: axes, origin
// Matrix that converts to the coordinates of a camera with these axes.
const viewOf = ({ right, up, back, eye }) => new Float32Array([
    right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
    -dot3(right, eye), -dot3(up, eye), -dot3(back, eye), 1]);
const diagonal = (x, y, z, ...last) => new Float32Array([x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, ...(last.length ? last : [0, 0, 0]), 1]);

// Inverse of a matrix whose last row is 0 0 0 1.
function inverse(m) {
    const [x, y, z, at] = [0, 4, 8, 12].map((i) => [m[i], m[i + 1], m[i + 2]]);
    const rows = [cross3(y, z), cross3(z, x), cross3(x, y)].map((row) => row.map((v) => v / dot3(x, cross3(y, z))));
    return new Float32Array([0, 1, 2].flatMap((k) => [...rows.map((row) => row[k]), 0])
        .concat(rows.map((row) => -dot3(row, at)), 1));
}

function axesOfTurn([w, x, y, z]) { // columns of the matrix of a unit quaternion; 0 0 0 0: level
    if (w === 0 && x === 0 && y === 0 && z === 0) w = 1;
    return [[1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
            [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
            [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]];
}

// ---- camera: the formulas of clients/viewer/camera.c

const TAN_HALF = 0.2217; // tangent of half the angle of view
const FILL = 0.86; // fraction of the picture that the object's box fills
const HEADROOM = 0.45; // space above the object, as a fraction of its height

function axesOf(azimuth, elevation) {
    const a = azimuth * Math.PI / 180, e = elevation * Math.PI / 180;
    const right = [Math.cos(a), Math.sin(a), 0];
    const back = [Math.sin(a) * Math.cos(e), -Math.cos(a) * Math.cos(e), Math.sin(e)];
    return { right, back, up: cross3(back, right) };
}

function distanceFor(half, azimuth, elevation, aspect) {
    const { right, up, back } = axesOf(azimuth, elevation);
    let distance = 0;
    for (let corner = 0; corner < 8; corner++) {
        const p = half.map((x, i) => corner >> i & 1 ? x : -x);
        const across = Math.max(Math.abs(dot3(p, right)) / aspect, Math.abs(dot3(p, up)));
        distance = Math.max(distance, dot3(p, back) + across / (FILL * TAN_HALF));
    }
    return distance;
}

const longestSide = ({ low, high }) => Math.max(1e-6, ...high.map((x, i) => x - low[i]));

// The box that the picture shows: the object's place at rest, and also the object itself if it was lifted or pushed away
// by more than a quarter of its longest side. now: low and high corner of its present box.
function frameOf({ low, high }, now) {
    const all = { low: low.map((x, i) => Math.min(x, now[i])), high: high.map((x, i) => Math.max(x, now[3 + i])) };
    const beyond = Math.max(...low.map((x, i) => Math.max(x - all.low[i], all.high[i] - high[i])));
    return beyond > longestSide({ low, high }) / 4 ? all : { low, high };
}

// Place the camera so that it sees the whole box of the object at every azimuth. look: azimuth and elevation in
// degrees, zoom, and pan: shift to the right and up, m.
function cameraOf(object, look, aspect) {
    const { low, high } = object, top = high[2] + HEADROOM * (high[2] - low[2]);
    const axes = axesOf(look.azimuth, look.elevation);
    let target = low.map((x, i) => (x + (i === 2 ? top : high[i])) / 2);
    const half = target.map((x, i) => x - low[i]);
    let distance = 0;
    for (let deg = 0; deg < 180; deg += 5) distance = Math.max(distance, distanceFor(half, deg, look.elevation, aspect));
    distance = Math.max(distance, distanceFor(half, look.azimuth, look.elevation, aspect));
    target = along(along(target, look.pan[0], axes.right), look.pan[1], axes.up);
    const eye = along(target, distance, axes.back), tanHalf = TAN_HALF / look.zoom;
    const near = 0.1 * distance, far = distance + 20 * longestSide(object);
    const lens = new Float32Array(16);
    lens[0] = 1 / (tanHalf * aspect);
    lens[5] = 1 / tanHalf;
    lens[10] = (far + near) / (near - far);
    lens[11] = -1;
    lens[14] = 2 * far * near / (near - far);
    return { ...axes, eye, aspect, tanHalf, distance, matrix: times(lens, viewOf({ ...axes, eye })) };
}

// Line of sight through the point (u, v) of the picture, 0..1 from its upper left corner.
function sightOf(camera, u, v) {
    const x = camera.tanHalf * camera.aspect * (2 * u - 1), y = camera.tanHalf * (1 - 2 * v);
    return { eye: camera.eye, sight: camera.back.map((b, i) => x * camera.right[i] + y * camera.up[i] - b) };
}

// Place of a point of the scene in the picture, 0..1 from its upper left corner.
function seenAt({ matrix: m }, p) {
    const row = (i) => m[i] * p[0] + m[4 + i] * p[1] + m[8 + i] * p[2] + m[12 + i];
    return [(1 + row(0) / row(3)) / 2, (1 - row(1) / row(3)) / 2];
}

// Side of the table's squares, m: the power of ten that gives 2 to 20 squares along the object's longest side.
const squareOf = (object) => 10 ** Math.floor(Math.log10(longestSide(object) / 2));

// ---- what is drawn

const SCALE = ['440154', '472d7b', '3b528b', '2c728e', '21918c', '28ae80', '5ec962', 'addc30', 'fde725']; // viridis, as in clients/viewer/label.c
const linear = (color) => color.map((x) => x * x); // the shaders use a gamma of 2
const SCALE_LINEAR = SCALE.flatMap((hex) => linear([0, 2, 4].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255)));
const COLORS = {
    table: [0.925, 0.93, 0.935], ink: [0, 0, 0], darkTable: [0.078, 0.086, 0.098], darkInk: [0.45, 0.48, 0.51],
    tool: [0.45, 0.52, 0.60], outside: [0.74, 0.77, 0.80], hand: [0.42, 0.58, 0.88], arrow: [0.86, 0.30, 0.12],
};
const LIT = 1.6; // radius around the object's middle within which shadows are drawn, in longest sides of the object
const N_PER_SQUARE = 5; // force whose arrow is as long as a square of the table
const BOX = 1, ROD = 2, BALL = 3, CONE = 4; // unit solids; DEVELOPING.md of this folder numbers the first three

// Surface of a solid of revolution about z. profile: radius and z from the bottom up. Return position and normal of
// each corner. round: the normals point away from the origin; flat: each segment has one normal.
function revolve(profile, segments, { round = false, flat = false } = {}) {
    const out = [], angle = (j) => 2 * Math.PI * (j + 0.5) / segments;
    const corner = ([r, z], j, normal, middle) => {
        const a = angle(j), at = [r * Math.cos(a), r * Math.sin(a), z], n = flat ? angle(middle) : a;
        out.push(...at, ...(round ? unit(at) : [normal[0] * Math.cos(n), normal[0] * Math.sin(n), normal[1]]));
    };
    for (let i = 0; i + 1 < profile.length; i++) {
        const [p, q] = [profile[i], profile[i + 1]], slope = Math.hypot(q[1] - p[1], q[0] - p[0]);
        const normal = [(q[1] - p[1]) / slope, (p[0] - q[0]) / slope];
        for (let j = 0; j < segments; j++)
            for (const [ring, k] of [[p, j], [p, j + 1], [q, j + 1], [p, j], [q, j + 1], [q, j]])
                corner(ring, k, normal, j + 0.5);
    }
    return new Float32Array(out);
}

// Compile a program of shaders.glsl. Its method `use` selects it and sets uniforms by their names. more: more names that
// are defined.
function programOf(gl, text, name, more = '') {
    const program = gl.createProgram();
    for (const [kind, which] of [[gl.VERTEX_SHADER, 'VERTEX'], [gl.FRAGMENT_SHADER, 'FRAGMENT']]) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, `#version 300 es\n#define ${name}_${which}\n${more}${text}`);
        gl.compileShader(shader);
        gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
        const logs = gl.getAttachedShaders(program).map((shader) => gl.getShaderInfoLog(shader));
        throw new Error(`${name}: ${[gl.getProgramInfoLog(program), ...logs].join(' ')}`);
    }
    const setters = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
        const { name: full, type } = gl.getActiveUniform(program, i), at = gl.getUniformLocation(program, full);
        setters[full.replace('[0]', '')] = {
            [gl.FLOAT]: (x) => gl.uniform1f(at, x), [gl.INT]: (x) => gl.uniform1i(at, x),
            [gl.SAMPLER_2D_SHADOW]: (x) => gl.uniform1i(at, x), [gl.FLOAT_VEC3]: (x) => gl.uniform3fv(at, x),
            [gl.FLOAT_VEC4]: (x) => gl.uniform4fv(at, x), [gl.FLOAT_MAT4]: (x) => gl.uniformMatrix4fv(at, false, x),
        }[type];
    }
    const set = (values) => { for (const key in values) setters[key]?.(values[key]); };
    return { set, use(values) { gl.useProgram(program); set(values); } };
}

// True: this browser draws WebGL in software, which is slow. Then a picture has no shadows and one sample per pixel, and
// app.js limits its size.
const isModest = (() => {
    const gl = document.createElement('canvas').getContext('webgl2'), names = gl?.getExtension('WEBGL_debug_renderer_info');
    const name = gl?.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER) ?? '';
    gl?.getExtension('WEBGL_lose_context')?.loseContext();
    const fine = new URLSearchParams(location.search).get('draw') === 'fine'; // as on a GPU, for pictures of the page
    return !fine && /SwiftShader|llvmpipe|softpipe|software/i.test(name);
})();

// Open a drawing on a canvas. text: shaders.glsl. Throw if the browser has no WebGL 2.
function openScene(canvas, text) {
    const gl = canvas.getContext('webgl2', { alpha: false, antialias: !isModest });
    if (!gl) throw new Error('no WebGL 2');
    if (isModest) text = `#define MODEST\n${text}`;
    const SHADOW = isModest ? 1 : 1024; // side of the shadow map, texels
    const depth = programOf(gl, text, 'DEPTH'), table = programOf(gl, text, 'TABLE');
    const solid = programOf(gl, text, 'SOLID', '#define OPAQUE\n'), wires = programOf(gl, text, 'SOLID');

    // Triangles in the memory of WebGL. sizes: number of floats of each attribute, all in one buffer per attribute group.
    const triangles = () => ({ array: gl.createVertexArray(), buffers: new Map(), corners: 0 });
    function upload(mesh, data, first, sizes, usage = gl.STATIC_DRAW) {
        gl.bindVertexArray(mesh.array);
        if (!mesh.buffers.has(first)) mesh.buffers.set(first, gl.createBuffer());
        gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffers.get(first));
        gl.bufferData(gl.ARRAY_BUFFER, data, usage);
        const stride = sizes.reduce((sum, size) => sum + size);
        let offset = 0;
        sizes.forEach((size, i) => {
            gl.vertexAttribPointer(first + i, size, gl.FLOAT, false, 4 * stride, 4 * offset);
            gl.enableVertexAttribArray(first + i);
            offset += size;
        });
        return data.length / stride;
    }
    function solidOf(data) {
        const mesh = triangles();
        mesh.corners = upload(mesh, data, 0, [3, 3]);
        return mesh;
    }
    const steps = isModest ? 8 : 16; // from pole to pole of a ball
    const arc = Array.from({ length: steps + 1 }, (_, i) => [i % steps ? Math.sin(Math.PI * i / steps) : 0, -Math.cos(Math.PI * i / steps)]);
    const shapes = {
        [BOX]: solidOf(revolve([[0, 0], [Math.SQRT1_2, 0], [Math.SQRT1_2, 1], [0, 1]], 4, { flat: true })),
        [ROD]: solidOf(revolve([[0, 0], [1, 0], [1, 1], [0, 1]], 24)),
        [BALL]: solidOf(revolve(arc, 2 * steps, { round: true })),
        [CONE]: solidOf(revolve([[0, 0], [1, 0], [0, 1]], 24)),
    };
    const square = solidOf(new Float32Array([[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]].flatMap(([x, y]) => [x, y, 0, 0, 0, 1])));
    const meshTools = new Map(); // triangles of tools that are meshes, by index; null: being loaded
    const body = triangles();

    const map = gl.createTexture(), frame = gl.createFramebuffer();
    gl.bindTexture(gl.TEXTURE_2D, map);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.DEPTH_COMPONENT24, SHADOW, SHADOW, 0, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT, null);
    for (const [key, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
        [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
        [gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE]]) gl.texParameteri(gl.TEXTURE_2D, key, value);
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, map, 0);

    // ---- the surface and its present shape

    let vertices = 0, box = null, triangle = [], group = [], xyz, normals, corners, values = null, fresh = false;

    // Take a surface (topology) that begins at `offset` of a message.
    function takeSurface(buffer, offset) {
        const [v, t, g] = new Uint32Array(buffer, offset, 3);
        vertices = v;
        triangle = new Uint32Array(buffer, offset + 16, 3 * t);
        group = new Uint32Array(buffer, offset + 16 + 12 * t, 3 * t);
        const line = new Uint8Array(buffer, offset + 16 + 24 * t, 3 * t);
        xyz = new Float32Array(3 * v), normals = new Float32Array(3 * g), corners = new Float32Array(18 * t);
        // Barycentric distance of each corner from each side. A side that is no line has the distance 1 from each corner.
        const sides = new Float32Array(9 * t);
        for (let i = 0; i < 3 * t; i++)
            for (let side = 0; side < 3; side++) sides[3 * i + side] = i % 3 === side || !line[i - i % 3 + side] ? 1 : 0;
        upload(body, sides, 2, [3]);
        body.corners = 3 * t;
    }

    // Take a shape: positions, and perhaps values, of all vertices.
    function takeShape(buffer, offset, size) {
        const steps = new Uint16Array(buffer, offset + 24, 3 * vertices);
        box = new Float32Array(buffer, offset, 6);
        for (let i = 0; i < xyz.length; i++)
            xyz[i] = steps[i] === 65535 ? NaN : box[i % 3] + steps[i] / 65534 * (box[3 + i % 3] - box[i % 3]);
        values = size > 24 + 6 * vertices ? new Uint8Array(buffer, offset + 24 + 6 * vertices, vertices) : null;
        fresh = true;
    }

    // Compute position and normal of each corner. A normal is the mean of the normals of the group's triangles, weighted
    // by the corner's angle, as in clients/viewer/shading.c.
    function computeCorners() {
        normals.fill(0);
        for (let t = 0; t < triangle.length; t += 3)
            for (let k = 0; k < 3; k++) {
                const a = 3 * triangle[t + k], b = 3 * triangle[t + (k + 1) % 3], c = 3 * triangle[t + (k + 2) % 3], g = 3 * group[t + k];
                const ux = xyz[b] - xyz[a], uy = xyz[b + 1] - xyz[a + 1], uz = xyz[b + 2] - xyz[a + 2];
                const vx = xyz[c] - xyz[a], vy = xyz[c + 1] - xyz[a + 1], vz = xyz[c + 2] - xyz[a + 2];
                const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx, n = Math.hypot(nx, ny, nz);
                if (!(n > 0)) continue; // no area, or a position that is not finite
                const weight = Math.atan2(n, ux * vx + uy * vy + uz * vz) / n;
                normals[g] += weight * nx, normals[g + 1] += weight * ny, normals[g + 2] += weight * nz;
            }
        for (let i = 0, o = 0; i < triangle.length; i++, o += 6) {
            const t = i - i % 3, a = 3 * triangle[i], g = 3 * group[i];
            const whole = xyz[3 * triangle[t]] + xyz[3 * triangle[t + 1]] + xyz[3 * triangle[t + 2]] < Infinity;
            const n = Math.hypot(normals[g], normals[g + 1], normals[g + 2]) || 1;
            for (let k = 0; k < 3; k++) {
                corners[o + k] = whole ? xyz[a + k] : 0; // a triangle that is not whole shrinks to a point
                corners[o + 3 + k] = normals[g + k] / n;
            }
        }
        upload(body, corners, 0, [3, 3], gl.STREAM_DRAW);
        if (values)
            upload(body, Float32Array.from(triangle, (v) => values[v] === 255 ? -1 : values[v] / 254), 3, [1], gl.STREAM_DRAW);
        fresh = false;
    }

    // Footprint of the object on the table, and the radius of its rounded corners, as in clients/viewer/renderer.c.
    function footprint({ low, high }) {
        const quarter = low[2] + 0.25 * (high[2] - low[2]), foot = [Infinity, Infinity, -Infinity, -Infinity];
        const each = (call) => { for (let v = 0; v < xyz.length; v += 3) if (xyz[v + 2] <= quarter) call(xyz[v], xyz[v + 1]); };
        each((x, y) => {
            foot[0] = Math.min(foot[0], x), foot[1] = Math.min(foot[1], y);
            foot[2] = Math.max(foot[2], x), foot[3] = Math.max(foot[3], y);
        });
        if (foot[0] > foot[2]) return { foot: [1e9, 1e9, 1e9, 1e9], corner: 0 }; // the object is in the air
        const half = [(foot[2] - foot[0]) / 2, (foot[3] - foot[1]) / 2];
        let most = 0;
        each((x, y) => { most = Math.max(most, Math.abs(x - foot[0] - half[0]) / half[0] + Math.abs(y - foot[1] - half[1]) / half[1]); });
        return { foot, corner: most > 0 ? clamp((2 - most) / (2 - Math.SQRT2), 0, 1) * Math.min(...half) : 0 };
    }

    // ---- drawing

    function drawMesh(mesh, program, uniforms) {
        if (!mesh?.corners) return;
        program.set(uniforms);
        gl.bindVertexArray(mesh.array);
        gl.drawArrays(gl.TRIANGLES, 0, mesh.corners);
    }

    // The solids of a tool at a pose: [kind, matrix].
    const poseOf = (tool, { at, turn }) => rigid(axesOfTurn(tool.level ? [1, 0, 0, 0] : turn), at);
    const solidsOf = (tool, pose) => tool.solids.map(({ kind, place }) => [kind, times(poseOf(tool, pose), place)]);
    const shapeOf = (kind, index) => kind ? shapes[kind] : meshTools.get(index);

    // Arrow of the force on a tool: [kind, matrix] of its shaft and its head.
    function arrowOf(tool, pose, side) {
        const newton = Math.hypot(...pose.force);
        if (!(newton >= 0.05)) return [];
        const direction = unit(pose.force), length = newton / N_PER_SQUARE * side, place = poseOf(tool, pose);
        const top = [0, 1, 2].map((i) => place[12 + i] + tool.height * place[8 + i]);
        const tail = dot3(direction, place.subarray(8, 11)) < 0 ? along(top, -length, direction) : top;
        const width = Math.min(0.08 * side, length / 4.5), head = 3 * width;
        const y = unit(cross3(direction, Math.abs(direction[0]) > 0.9 ? [0, 1, 0] : [1, 0, 0])), x = cross3(y, direction);
        const part = (kind, at, wide, long) => [kind, times(rigid([x, y, direction], at), diagonal(wide, wide, long))];
        return [part(ROD, tail, width, length - head), part(CONE, along(tail, length - head, direction), 2 * width, head)];
    }

    // Draw solids with the program `solid`. clear: the background is visible through them, but not their own back: first
    // draw their depth, then their colour.
    function drawSolids(list, camera, uniforms, clear) {
        if (clear) {
            gl.colorMask(false, false, false, false);
            gl.enable(gl.POLYGON_OFFSET_FILL);
            gl.polygonOffset(1, 4);
            depth.use({ u_light: camera.matrix });
            for (const [kind, u_model, index] of list) drawMesh(shapeOf(kind, index), depth, { u_model });
            gl.disable(gl.POLYGON_OFFSET_FILL);
            gl.colorMask(true, true, true, true);
            gl.enable(gl.BLEND);
            gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
        }
        solid.use(uniforms);
        for (const [kind, u_model, index] of list)
            drawMesh(shapeOf(kind, index), solid, { u_model, u_gloss: kind === BOX ? 0.25 : 0.5 });
        gl.disable(gl.BLEND);
    }

    // The tools of a picture, with everything that is drawn of them.
    function toolsOf(object, poses, side) {
        return object.tools.flatMap((tool, index) => {
            const pose = poses?.[index];
            if (!pose) return [];
            const numbered = (list) => list.map(([kind, place]) => [kind, place, index]), { hand } = pose;
            const far = hand && (Math.hypot(...hand.at.map((x, i) => x - pose.at[i])) > 0.0005
                || (!tool.level && Math.abs(hand.turn.reduce((sum, x, i) => sum + x * pose.turn[i], 0)) < 0.99966)); // 3 degrees
            return [{ tool, pose, solids: numbered(solidsOf(tool, pose)), arrow: arrowOf(tool, pose, side),
                      hand: far ? numbered(solidsOf(tool, hand)) : [], touches: pose.acts && Math.hypot(...pose.force) > 0.02 }];
        });
    }

    // Uniforms of the contact patch: the solids of the tools that touch.
    function patchOf(tools, spacing) {
        const all = tools.filter(({ touches }) => touches).flatMap(({ solids }) => solids).filter(([kind]) => kind).slice(0, 6);
        const size = (m, k) => Math.hypot(m[k], m[k + 1], m[k + 2]);
        if (!all.length) return { u_solids: 0 };
        return { u_solids: all.length, u_solid: new Float32Array(all.flatMap(([, m]) => [...inverse(m)])),
                 u_size: new Float32Array(all.flatMap(([kind, m]) => [kind, size(m, 0), size(m, 4), size(m, 8)])),
                 u_near: 0.35 * spacing, u_touched: linear(COLORS.arrow) };
    }

    function drawShadows(tools, uniforms) {
        gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
        gl.viewport(0, 0, SHADOW, SHADOW);
        gl.clear(gl.DEPTH_BUFFER_BIT);
        gl.enable(gl.POLYGON_OFFSET_FILL);
        gl.polygonOffset(3, 4);
        gl.disable(gl.CULL_FACE);
        depth.use(uniforms);
        drawMesh(body, depth, {});
        for (const { solids, arrow, pose } of tools)
            for (const [kind, u_model, index] of pose.acts ? [...solids, ...arrow] : []) drawMesh(shapeOf(kind, index), depth, { u_model });
        gl.disable(gl.POLYGON_OFFSET_FILL);
    }

    // Draw a picture. what: object (its box, colour, tools), poses of the tools, camera, style, dark.
    function draw({ object, poses, camera, azimuth, style, dark }) {
        if (fresh) computeCorners();
        const { width, height } = canvas, scale = longestSide(object), side = squareOf(object);
        const tools = toolsOf(object, poses, side), level = object.low[2] - 1e-3 * scale, tall = object.high[2] - object.low[2];
        const sun = axesOf(azimuth - 52, 48), radius = LIT * scale;
        const middle = object.low.map((x, i) => (x + object.high[i]) / 2), key = sun.back;
        const light = times(diagonal(1 / radius, 1 / radius, 2 / (0.5 * radius - 4 * radius), 0, 0, 4.5 / -3.5),
                            viewOf({ ...sun, eye: along(middle, 2 * radius, key) }));
        const model = diagonal(1, 1, 1);

        gl.enable(gl.DEPTH_TEST);
        if (!isModest) drawShadows(tools, { u_light: light, u_model: model });
        gl.bindFramebuffer(gl.FRAMEBUFFER, null);
        gl.viewport(0, 0, width, height);
        const ground = dark ? COLORS.darkTable : COLORS.table;
        const lit = { u_shadow: 0, u_camera: camera.matrix, u_light: times(diagonal(0.5, 0.5, 0.5, 0.5, 0.5, 0.5), light),
                      u_eye: camera.eye, u_key: key, u_height: tall };
        const board = { ...lit, u_color: linear(ground), u_ink: linear(dark ? COLORS.darkInk : COLORS.ink), u_square: side,
                        u_reach: 4 * scale, u_level: level };
        gl.bindTexture(gl.TEXTURE_2D, map);
        gl.clearColor(...ground, 1);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        gl.enable(gl.CULL_FACE);
        const wire = style === 'wire';
        if (wire) gl.disable(gl.CULL_FACE);
        if (!values) gl.bindVertexArray(body.array), gl.disableVertexAttribArray(3);
        const program = wire ? wires : solid;
        program.use({ ...lit, ...patchOf(tools, object.spacing), u_bias: 3 * radius / SHADOW, u_model: model,
                    u_color: linear(object.color), u_scale: SCALE_LINEAR, u_scaled: values ? 1 : 0, u_gloss: 0.06,
                    u_lines: style === 'lined' ? 0.3 : 0, u_wire: wire ? 0.5 : 0, u_grow: 0, u_flat: 0, u_alpha: 0,
                    u_ghost: [0, 0, 0, 0] });
        drawMesh(body, program, {});
        gl.enable(gl.CULL_FACE);

        const { foot, corner } = footprint(object);
        drawTable(object, camera, azimuth, { ...board, u_foot: foot, u_corner: corner });

        solid.use({ ...lit, u_solids: 0, u_scaled: 0, u_lines: 0, u_flat: 0, u_alpha: 0 });
        for (const { solids, pose, arrow, touches } of tools) {
            const wide = Math.max(...solids.map(([, m]) => Math.hypot(m[0], m[1], m[2])));
            drawSolids(solids, camera, { u_color: linear(pose.acts ? COLORS.tool : COLORS.outside),
                                         u_ghost: touches ? [...pose.at, wide] : [0, 0, 0, 0] }, touches);
            solid.set({ u_ghost: [0, 0, 0, 0], u_color: linear(COLORS.arrow), u_gloss: 0.1 });
            for (const [kind, u_model] of arrow) drawMesh(shapes[kind], solid, { u_model });
        }
        for (const { hand } of tools) {
            if (!hand.length) continue;
            gl.clear(gl.DEPTH_BUFFER_BIT);
            drawSolids(hand, camera, { u_color: linear(COLORS.hand), u_flat: 0.6, u_alpha: -0.6 }, true);
        }
    }

    // Draw the table behind everything, with the bar in front of the side of the object that is at the left.
    function drawTable({ low, high }, camera, azimuth, uniforms) {
        const s = uniforms.u_square, away = 1.5 * s, wide = 0.12 * s;
        const bars = [[low[0], low[1] - away, low[0] + s, low[1] - away + wide],
                      [high[0] + away - wide, low[1], high[0] + away, low[1] + s],
                      [high[0] - s, high[1] + away - wide, high[0], high[1] + away],
                      [low[0] - away, high[1] - s, low[0] - away + wide, high[1]]];
        table.use({ ...uniforms, u_bar: bars[Math.floor(azimuth / 90 + 1e-9) & 3],
                    u_right: camera.right.map((x) => x * camera.tanHalf * camera.aspect),
                    u_up: camera.up.map((x) => x * camera.tanHalf), u_forward: camera.back.map((x) => -x) });
        drawMesh(square, table, {});
    }

    // Load the triangles of the tools that are meshes. load: function that returns the floats of tool number `index`.
    let toolsTaken = 0; // number of calls; an answer to an older call is too late
    function takeTools({ tools }, load) {
        const call = ++toolsTaken;
        meshTools.clear();
        tools.forEach(({ solids }, index) => {
            if (solids.every(({ kind }) => kind)) return;
            load(index).then((data) => { if (data && call === toolsTaken && !gl.isContextLost()) meshTools.set(index, solidOf(data)); });
        });
    }

    // Call a function when everything that was drawn is done, or the context is lost.
    function whenDone(call) {
        const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
        gl.flush();
        const poll = () => {
            const waits = fence && !gl.isContextLost() && gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.UNSIGNALED;
            if (waits) return void setTimeout(poll, 1);
            gl.deleteSync(fence);
            call();
        };
        setTimeout(poll, 0);
    }

    return { canvas, gl, whenDone, takeSurface, takeShape, takeTools, draw, ready: () => vertices > 0, box: () => box };
}

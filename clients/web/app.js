// The page of knead web: draw the object and send the pointer. The wire format is in DEVELOPING.md of this folder.
'use strict';
const picture = $('picture'), slider = $('depth');

// Figures for tests and benchmarks. latency: for each of the last 2000 pointer events, time from the event's handler to
// the first drawn frame that shows the effect of the event, ms. first_ms: time from the request of the page to the first
// drawn frame, ms.
const knead = window.knead = { latency: [], events: 0, frames: 0, first_ms: 0, now: null };

// ---- the wire

const POINTER = 1, SEEN = 2, GRIP = 3, RETRY_MS = 2000;
// waiting: pointer events whose effect no drawn frame shows yet: {number, at: time of the event}.
let socket = null, waiting = [];
let asked = 0; // id of the last request
const answers = new Map(); // callbacks of unanswered requests, by id

// Send a pointer event. lines: lines of sight through the pointer, or through both fingers of a grip: {eye, sight}.
function sendPointer(number, pressed, depth_m, lines) {
    if (socket?.readyState !== WebSocket.OPEN) return;
    const bytes = new DataView(new ArrayBuffer(24 + 12 * lines.length));
    bytes.setUint32(0, number, true);
    [lines.length > 1 ? GRIP : POINTER, pressed].forEach((x, i) => bytes.setUint8(4 + i, x));
    [depth_m, ...lines[0].eye, ...lines.flatMap(({ sight }) => sight)].forEach((x, i) => bytes.setFloat32(8 + 4 * i, x, true));
    socket.send(bytes);
}

// Acknowledge a message, so that knead web sends more.
function sendSeen(number) {
    if (socket?.readyState !== WebSocket.OPEN) return;
    const bytes = new DataView(new ArrayBuffer(8));
    bytes.setUint32(0, number, true);
    bytes.setUint8(4, SEEN);
    socket.send(bytes);
}

// Send a request as JSON. The promise always resolves, to {ok, words}.
function ask(what, fields = {}) {
    if (socket?.readyState !== WebSocket.OPEN) return Promise.resolve({ ok: false, words: 'knead web is not connected' });
    const id = ++asked;
    socket.send(JSON.stringify({ id, do: what, ...fields }));
    return new Promise((answer) => answers.set(id, answer));
}

function hear({ id, ok, words }) {
    answers.get(id)?.({ ok, words });
    answers.delete(id);
}

// Take a message: the JSON, then the surface, the shape and the picture that its `blocks` announce.
function take(data) {
    const size = new DataView(data).getUint32(0, true);
    const now = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, size)));
    const [surface, shape, jpeg] = now.blocks;
    let at = 4 + size;
    record(now.trace);
    now.answers.forEach(hear);
    if (now.about) showAbout(now.about);
    if (surface) takeSurface(data, at), at += surface;
    if (shape) takeShape(data, at, shape, now), at += shape;
    return { now, shape, jpeg: jpeg && new Blob([new Uint8Array(data, at, jpeg)], { type: 'image/jpeg' }) };
}

// Draw what waits; set by the present connection.
let wake = () => {};
document.addEventListener('visibilitychange', () => wake());

function connect() {
    const token = location.hash.slice(1);
    if (!token) return say('fault', 'open the address that knead web printed: this one has no token');
    const mine = socket = new WebSocket(`${location.protocol.replace('http', 'ws')}//${location.host}/ws`, 'knead');
    let pending = null; // what the next frame shows: the newest message, and whether it has a new shape
    let draws = false; // true: a frame is being drawn
    mine.binaryType = 'arraybuffer';
    mine.onopen = () => { mine.send(token); askToDraw(); };
    // Draw what is pending. A page that draws itself acknowledges a message at once, and draws the newest one when the
    // last is done. A page with pictures acknowledges a picture when it has been drawn, so that knead web makes no more.
    // A hidden page acknowledges nothing, so knead web sends it nothing more.
    const frame = async () => {
        if (!pending || document.hidden) return;
        if (scene && !pending.seen) sendSeen(pending.now.frame), pending.seen = true;
        if (draws) return;
        const { now, jpeg, seen } = pending, shape = pending.shape && !mayRest();
        pending = null;
        draws = true;
        const bitmap = jpeg && await createImageBitmap(jpeg).catch(() => null); // a broken picture must not stop the next one
        if (mine !== socket) return bitmap?.close();
        if (bitmap) drawPicture(bitmap, jpeg);
        if (shape) redraw();
        bitmap?.close();
        show(now);
        const done = () => {
            draws = false;
            if (mine !== socket) return;
            if (shape || bitmap) drawn(now);
            if (!seen) sendSeen(now.frame);
            frame();
        };
        if (shape && scene) scene.whenDone(done);
        else done();
    };
    mine.onmessage = ({ data }) => {
        const next = take(data);
        pending = { now: next.now, shape: next.shape || pending?.shape, jpeg: next.jpeg || pending?.jpeg };
        frame();
    };
    wake = frame;
    mine.onclose = ({ code, reason }) => {
        if (mine !== socket) return;
        letGo();
        socket = null; // so that a picture that is still being decoded is not drawn
        waiting = [];
        picture.classList.add('stale');
        $('tag').hidden = true;
        for (const id of answers.keys()) hear({ id, ok: false, words: 'knead web disconnected before it answered' });
        showAbout(null);
        // Do not try again with a wrong token (4401), or after a newer page has taken this page's place (4429).
        const again = code < 4401;
        say(again ? 'wait' : 'fault', (reason || 'knead web has ended') + (again ? ': trying again every 2 s' : ''));
        if (again) setTimeout(connect, RETRY_MS);
    };
}

// ---- drawing: by this browser (scene), or pictures of knead web if there is no WebGL

const KEPT_MS = 10000, KEPT_BYTES = 1e8; // what `Clip` shows, and the memory for it
const query = new URLSearchParams(location.search);
let shaders = null, scene = null, canvas = null;
let surface = null; // the message with the present surface: {data, at}
let poses = null; // poses of the tools in the newest shape
let ownView = null; // the page's own view, while it shows pictures
const kept = []; // what was drawn in the last 10 s: {at, tick, data, offset, size, poses} or {at, tick, jpeg}
let keptBytes = 0;
const dark = matchMedia('(prefers-color-scheme: dark)');

// Give the page a new canvas: the old one may have lost its WebGL, or cannot change from one way of drawing to the other.
function newCanvas() {
    canvas?.remove();
    canvas = make('canvas', { width: 800, height: 450 });
    canvas.setAttribute('aria-hidden', 'true'); // its parent has the name
    picture.prepend(canvas);
}

// Begin to draw with WebGL, or fall back to pictures. `?draw=picture` in the address asks for pictures.
function openDrawing(allowed = query.get('draw') !== 'picture') {
    const before = scene;
    scene = null;
    kept.length = keptBytes = 0;
    newCanvas();
    try {
        if (allowed) scene = openScene(canvas, shaders);
    } catch (error) {
        newCanvas();
    }
    const mine = canvas;
    mine.addEventListener('webglcontextlost', () => {
        if (mine !== canvas) return;
        // Show pictures at once, and WebGL again as soon as the browser gives it, but not in a press: to compile the shaders
        // may hold up the page for so long that the tool lifts.
        openDrawing(false);
        const again = (wait) => setTimeout(() => {
            if (hand.holder !== null) return again(wait);
            openDrawing();
            if (!scene && wait < 60000) again(2 * wait);
        }, wait);
        again(1000);
    });
    picture.classList.toggle('pictures', !scene);
    showStyle(about);
    $('tag').hidden = true;
    // Pictures have the view of knead web, and the page goes back to its own view afterwards.
    if (before && !scene) ownView = { ...orbit };
    if (!scene && about) takeView(about.view);
    else if (scene && ownView) Object.assign(orbit, ownView, { pointer: null }), ownView = null;
    if (scene && surface) scene.takeSurface(surface.data, surface.at), scene.takeTools(about?.object ?? { tools: [] }, loadTool);
    if (socket) askToDraw();
}

// Tell knead web how this page draws, and which measure it wants.
function askToDraw() {
    ask('draw', { name: scene ? 'mesh' : 'picture' });
    if (scene) ask('measure', { name: $('measure').value });
}

function takeSurface(data, at) {
    surface = { data, at };
    kept.length = keptBytes = 0;
    scene?.takeSurface(data, at);
}

function takeShape(data, offset, size, now) {
    poses = now.tools;
    if (!scene) return;
    scene.takeShape(data, offset, size);
    keep({ tick: now.tick, data, offset, size, poses }, data.byteLength);
}

function keep(what, bytes) {
    const at = performance.now();
    kept.push({ at, bytes, ...what });
    for (keptBytes += bytes; kept.length > 1 && (kept[0].at < at - KEPT_MS || keptBytes > KEPT_BYTES);) keptBytes -= kept.shift().bytes;
}

const aspect = () => canvas.width / canvas.height;
// The camera of what is drawn now; null: the object is not known yet. A picture of knead web has its own shape and view.
const camera = () => about?.object
    ? cameraOf(hand.frame ?? (scene?.box() ? frameOf(about.object, scene.box()) : about.object), orbit, aspect()) : null;

// A browser that draws in software draws at most MOVING_PIXELS while something moves. When nothing has moved for
// STILL_MS, it draws STILL_PIXELS, a few times a second.
const MOVING_PIXELS = 100000, STILL_PIXELS = 500000, STILL_MS = 300;
let movedAt = 0, redrawnAt = 0;
const isStill = () => {
    if (knead.now?.contact || hand.holder !== null) movedAt = performance.now();
    return performance.now() - Math.max(movedAt, toldAt) > STILL_MS;
};
// Return true if a new shape need not be drawn.
const mayRest = () => isModest && isStill() && performance.now() - redrawnAt < STILL_MS;

// Draw the newest shape. Called for each new shape, and when the view changes. full: with all pixels.
function redraw(full = false) {
    if (!scene?.ready() || !about?.object || scene.gl.isContextLost()) return;
    const all = picture.clientWidth * picture.clientHeight * devicePixelRatio ** 2;
    const ratio = devicePixelRatio * (isModest ? Math.min(1, Math.sqrt((full || isStill() ? STILL_PIXELS : MOVING_PIXELS) / all)) : 1);
    redrawnAt = performance.now();
    fit(canvas, Math.round(picture.clientWidth * ratio), Math.round(picture.clientHeight * ratio));
    scene.draw({ object: about.object, poses, camera: camera(), azimuth: orbit.azimuth, style: $('style').value, dark: dark.matches });
    showTag();
}

function drawPicture(bitmap, jpeg) {
    if (scene) return; // it was on its way when WebGL came back
    fit(canvas, bitmap.width, bitmap.height);
    // A canvas in memory does not wait for the GPU.
    canvas.getContext('2d', { alpha: false, willReadFrequently: true }).drawImage(bitmap, 0, 0);
    keep({ tick: knead.now?.tick ?? 0, jpeg }, jpeg.size);
}

// Copy the picture. A WebGL canvas can be copied only in the task that has drawn it.
function copyPicture(context, width, height) {
    redraw(true);
    context.drawImage(canvas, 0, 0, width, height);
}

// ---- received data

// Set a canvas size only if it changes, because setting it clears the canvas.
function fit(canvas, width, height) {
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
}

// Count a frame that has been drawn, and the pointer events whose effect it shows.
function drawn(now) {
    picture.classList.remove('stale');
    const at = performance.now();
    if (++knead.frames === 1) knead.first_ms = at;
    while (waiting.length && waiting[0].number <= now.event)
        if (knead.latency.push(at - waiting.shift().at) > 2000) knead.latency.shift();
}

function say(level, words) {
    $('status').dataset.level = level;
    write($('level'), { ok: 'Live', wait: 'Waiting', fault: 'Stopped' }[level]);
    write($('words'), words);
}

// Show numbers, words and trace, at most every SHOW_MS: the browser spends more time on them than on the drawing.
const SHOW_MS = 80;
let shownAt = 0;
function show(now) {
    knead.now = now;
    if (performance.now() - shownAt < SHOW_MS) return;
    shownAt = performance.now();
    say(now.level, now.status);
    write($('force'), now.force_n.toFixed(now.force_n < 9.995 ? 2 : 1));
    write($('pressed'), now.contact || !now.depth_mm ? now.depth_mm.toFixed(1) : '–'); // beside the object there is no depth
    write($('contact'), now.contact ? 'touching' : 'none');
    $('readings').classList.toggle('touching', now.contact);
    // During a press, keep the slider's maximum: deepest_mm is then only the depth that is left below the tool.
    if (hand.holder === null && !now.contact) slider.max = now.deepest_mm;
    showDepth();
    write($('bar'), barWords());
    write($('time'), `${(now.tick / 1000).toFixed(1)} s served`);
    showTouch(now.touch);
    showLegend(now.top);
    drawTrace();
}

function barWords() {
    const mm = about?.object ? Number((1000 * squareOf(about.object)).toPrecision(1)) : 0;
    return mm ? `bar on the table: ${mm < 10 ? `${mm} mm` : `${mm / 10} cm`}` : '';
}

// Show force and depth beside the tool.
function showTag() {
    const now = knead.now, pose = poses?.[about.object.tools.findIndex(({ name }) => name === about.tool)];
    $('tag').hidden = !pose?.acts || !now?.contact;
    if ($('tag').hidden) return;
    const [u, v] = seenAt(camera(), pose.at);
    $('tag').style.left = `${clamp(100 * u, 2, 80)}%`;
    $('tag').style.top = `${clamp(100 * v, 4, 92)}%`;
    const deep = now.depth_mm ? `, ${now.depth_mm.toFixed(1)} mm deep` : '';
    write($('tag'), `${Math.hypot(...pose.force).toFixed(2)} N${deep}`);
}

// ---- pointer

// REPEAT_MS: interval at which a press is sent again, ms. WHEEL_MM: change of depth per pixel of the wheel, mm. KEY_MM:
// change of depth per key, mm. KEY_STEP: step of an arrow key, as a share of the picture. TOUCH_MS: a finger presses only
// after this time, because a second one may come, ms. TELL_MS: least time between two messages of moves, ms.
const REPEAT_MS = 50, WHEEL_MM = 0.005, KEY_MM = 0.5, KEY_STEP = 0.015, TOUCH_MS = 80, TELL_MS = 10;
// u, v: place in the picture at which the tool aims. holder: what holds the press: a pointer's id, 'key', 'grip' (two
// fingers), or null (no press). lines: lines of sight of the last aim. view: camera with which the press began. frame: box
// that the camera shows during a press, so that it does not follow what the press moves. share: share of the depth that a
// pen asks for by its pressure. spent: a grip has ended, but not all fingers have left.
const hand = { u: 0.5, v: 0.5, holder: null, depth_mm: 5, lines: null, view: null, frame: null, share: 1, spent: false };
const fingers = new Map(); // places of the fingers on the picture, by id; two at most
// soon: timer that will send the pointer, 0: none. soonAt: time of the first event that it will send. toldAt: time when
// the pointer was last sent. pressSoon: timer that will begin the press of a finger, 0: none.
let soon = 0, soonAt = 0, toldAt = 0, pressSoon = 0;

const depthNow = () => clamp(hand.depth_mm, 0, Number(slider.max));

// Send the place of the pointer. If the view changes during a press, the pointer stands for another point of the object.
// The tool then stays where it is until the press ends.
function sayPointer() {
    const seen = camera(), view = seen?.matrix.join();
    if (hand.holder === null) hand.view = null;
    const places = hand.holder === 'grip' ? [...fingers.values()] : [hand];
    if (seen && (hand.view ??= view) === view) hand.lines = places.map(({ u, v }) => sightOf(seen, u, v));
    const depth_m = places.length > 1 ? 0 : Math.min(0.0999, hand.share * depthNow() / 1000);
    if (hand.lines?.length === places.length) sendPointer(++knead.events, hand.holder === null ? 0 : 1, depth_m, hand.lines);
}

// Send the pointer now.
function tell() {
    clearTimeout(soon);
    soon = 0;
    toldAt = performance.now();
    if (waiting.push({ number: knead.events + 1, at: soonAt || toldAt }) > 500) waiting.shift();
    soonAt = 0;
    sayPointer();
}

// Send the pointer, at most every TELL_MS, so that all moves until then become one message.
function tellSoon() {
    if (soon) return;
    soonAt = performance.now();
    const rest = toldAt + TELL_MS - soonAt;
    if (rest <= 0) tell();
    else soon = setTimeout(tell, rest);
}

function showDepth() {
    slider.value = depthNow();
    write($('depth-now'), `${depthNow().toFixed(1)} mm`);
}

function setDepth(mm) {
    hand.depth_mm = clamp(mm, 0, Number(slider.max));
    showDepth();
    if (hand.holder !== null) tellSoon();
}

function press(holder) {
    if (hand.holder !== null) return;
    hand.holder = holder;
    hand.view = null;
    hand.frame = scene?.box() && about?.object ? frameOf(about.object, scene.box()) : null;
    tell();
}

function letGo() {
    clearTimeout(pressSoon);
    pressSoon = 0;
    if (hand.holder === null) return;
    hand.spent = hand.holder === 'grip' && fingers.size > 0;
    hand.holder = hand.frame = null;
    hand.share = 1;
    tell();
}

// Place of an event in the picture, 0..1 from its upper left corner.
function placeOf(event) {
    const box = canvas.getBoundingClientRect();
    return { u: clamp((event.clientX - box.left) / box.width, 0, 1), v: clamp((event.clientY - box.top) / box.height, 0, 1) };
}

function aim(event) {
    Object.assign(hand, placeOf(event));
    if (event.pointerType === 'pen' && event.pressure > 0) hand.share = event.pressure;
}

picture.addEventListener('pointerdown', (event) => {
    const touch = event.pointerType === 'touch', id = event.pointerId;
    if (touch && fingers.size < 2) {
        fingers.set(id, placeOf(event));
        // Two fingers grip the object if the scene has two round tools. Otherwise they turn and zoom the view.
        if (fingers.size === 2 && hand.spent) return;
        if (fingers.size === 2) return letGo(), about?.second ? press('grip') : beginPinch([...fingers.values()]);
    }
    if (hand.holder !== null || fingers.size > 1) return;
    if (event.button === 1 || event.button === 2 || (event.button === 0 && event.shiftKey)) return beginOrbit(event);
    if (event.button !== 0) return;
    picture.setPointerCapture(id);
    aim(event);
    if (touch) pressSoon = setTimeout(() => { pressSoon = 0; press(id); }, TOUCH_MS);
    else press(id);
});
picture.addEventListener('pointermove', (event) => {
    if (hand.holder !== null || !event.isPrimary || orbit.pointer !== null || fingers.size > 1) return;
    aim(event);
    tellSoon();
});
// Listen on the window, which gets the events of the pressing pointer with and without a pointer capture. Chromium ends
// the capture when the layout changes under a mouse that is driven by Chromium's debugging protocol.
window.addEventListener('pointermove', (event) => {
    if (fingers.has(event.pointerId)) fingers.set(event.pointerId, placeOf(event));
    if (hand.holder === 'grip') return fingers.has(event.pointerId) && tellSoon();
    if (fingers.size === 2) return movePinch([...fingers.values()]);
    if (hand.holder !== event.pointerId) return;
    if (event.buttons & 1) aim(event), tellSoon(); // stroke the object at the current depth
    else letGo(); // the left button was released while another was down: the browser sends no pointerup for this
});
onRelease(({ pointerId }) => {
    const finger = fingers.delete(pointerId);
    if (fingers.size === 0) hand.spent = false;
    if (hand.holder === pointerId || (finger && (pressSoon || hand.holder === 'grip'))) letGo();
});
picture.addEventListener('wheel', (event) => {
    event.preventDefault();
    // Ctrl and the wheel zoom the picture. A browser reports the pinch of a touchpad in the same way.
    if (event.ctrlKey) return look(orbit.azimuth, orbit.elevation, orbit.zoom * 1.002 ** -event.deltaY);
    setDepth(hand.depth_mm + event.deltaY * (event.deltaMode ? 33 : 1) * WHEEL_MM);
}, { passive: false });
picture.addEventListener('contextmenu', (event) => event.preventDefault());
for (const place of [picture, window]) place.addEventListener('blur', letGo);
document.addEventListener('visibilitychange', () => { if (document.hidden) letGo(); });

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const DEEPER = { '+': 1, '=': 1, PageDown: 1, '-': -1, PageUp: -1 };
picture.addEventListener('keydown', (event) => {
    const { key } = event;
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (ARROWS[key] && event.shiftKey) turn(-6 * ARROWS[key][0], -4 * ARROWS[key][1]);
    else if (ARROWS[key]) {
        hand.u = clamp(hand.u + ARROWS[key][0] * KEY_STEP, 0, 1);
        hand.v = clamp(hand.v + ARROWS[key][1] * KEY_STEP, 0, 1);
        tellSoon();
    } else if (key in DEEPER) setDepth(hand.depth_mm + DEEPER[key] * KEY_MM);
    else if (key === ' ' || key === 'Enter') press('key');
    else if (key === 'Escape') letGo();
    else if (key === 'r' || key === 'R') $('reset').click();
    else if (key === 'u' || key === 'U') $('undo').click();
    else return;
    event.preventDefault();
});
picture.addEventListener('keyup', ({ key }) => { if ([' ', 'Enter'].includes(key) && hand.holder === 'key') letGo(); });
slider.addEventListener('input', () => setDepth(Number(slider.value)));
// Repeat a press, because knead web lifts the tool when it has heard nothing for 400 ms.
setInterval(() => { if (hand.holder !== null) sayPointer(); }, REPEAT_MS);
window.addEventListener('hashchange', () => location.reload());
window.addEventListener('resize', () => redraw());
dark.addEventListener('change', () => redraw());
// Begin. Without the shaders, knead web draws.
fetch('shaders.glsl').then((answer) => answer.ok ? answer.text() : null, () => null).then((text) => {
    shaders = text;
    openDrawing();
    connect();
});

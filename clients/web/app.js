// The page of knead web: draw the received pictures and send the pointer. The wire format is in README.md of this
// folder.
'use strict';
const picture = $('picture'), slider = $('depth');

// Figures for tests and benchmarks. latency: for each of the last 2000 pointer events, time from the event's handler to
// the first drawn picture that shows the effect of the event, ms. first_ms: time from the request of the page to the
// first drawn picture, ms.
const knead = window.knead = { latency: [], events: 0, frames: 0, first_ms: 0, now: null };

// ---- the wire

const POINTER = 1, SEEN = 2, RETRY_MS = 2000;
// waiting: pointer events whose effect no drawn picture shows yet: {number, at: time of the event}.
let socket = null, waiting = [];
let asked = 0; // id of the last request
const answers = new Map(); // callbacks of unanswered requests, by id

function send(kind, number, pressed = 0, u = 0, v = 0, depth_m = 0) {
    if (socket?.readyState !== WebSocket.OPEN) return;
    const bytes = new DataView(new ArrayBuffer(20));
    bytes.setUint32(0, number, true);
    bytes.setUint8(4, kind);
    bytes.setUint8(5, pressed);
    [u, v, depth_m].forEach((x, i) => bytes.setFloat32(8 + 4 * i, x, true));
    socket.send(bytes);
}

// Send a request as JSON. The promise always resolves, to {ok, words}.
function ask(what, fields = {}) {
    if (socket?.readyState !== WebSocket.OPEN) return Promise.resolve({ ok: false, words: 'knead web is not connected' });
    const id = ++asked;
    socket.send(JSON.stringify({ id, do: what, ...fields }));
    return new Promise((answer) => answers.set(id, answer));
}

const inSight = () => new Promise((then) => document.addEventListener('visibilitychange', then, { once: true }));

function hear({ id, ok, words }) {
    answers.get(id)?.({ ok, words });
    answers.delete(id);
}

function connect() {
    const token = location.hash.slice(1);
    if (!token) return say('fault', 'open the address that knead web printed: this one has no token');
    const mine = socket = new WebSocket(`${location.protocol.replace('http', 'ws')}//${location.host}/ws`, 'knead');
    let drawn = 0; // number of the newest message whose picture has been drawn
    mine.binaryType = 'arraybuffer';
    mine.onopen = () => mine.send(token);
    mine.onmessage = async ({ data }) => {
        const size = new DataView(data).getUint32(0, true);
        const now = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, size)));
        record(now.trace); // before the picture is decoded, because the next message may come meanwhile
        now.answers.forEach(hear);
        if (now.about) showAbout(now.about);
        if (data.byteLength > 4 + size) {
            const jpeg = new Blob([new Uint8Array(data, 4 + size)], { type: 'image/jpeg' });
            // A broken picture must not stop the next one.
            const bitmap = await createImageBitmap(jpeg).catch(() => null);
            // Draw every picture that is newer than the last drawn one. If only the newest received picture were
            // drawn, none might ever be drawn, because the next one may arrive while a picture is decoded.
            if (bitmap && mine === socket && now.frame > drawn) draw(bitmap, now);
            bitmap?.close();
        }
        // Delay the acknowledgement below while the page is hidden, so that knead web makes no pictures for the page.
        while (document.hidden && mine === socket) await inSight();
        if (mine !== socket) return;
        send(SEEN, now.frame);
        if (now.frame > drawn) show(now);
        drawn = Math.max(drawn, now.frame);
    };
    mine.onclose = ({ code, reason }) => {
        if (mine !== socket) return;
        letGo();
        socket = null; // so that a picture that is still being decoded is not drawn
        waiting = [];
        picture.classList.add('stale');
        for (const id of answers.keys()) hear({ id, ok: false, words: 'knead web disconnected before it answered' });
        showAbout(null);
        // Do not try again with a wrong token (4401), or after a newer page has taken this page's place (4429).
        const again = code < 4401;
        say(again ? 'wait' : 'fault', (reason || 'knead web has ended') + (again ? ': trying again every 2 s' : ''));
        if (again) setTimeout(connect, RETRY_MS);
    };
}

// ---- received data

// Set a canvas size only if it changes, because setting it clears the canvas.
function fit(canvas, width, height) {
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
}

function draw(bitmap, now) {
    fit(picture, bitmap.width, bitmap.height);
    picture.getContext('2d', { alpha: false }).drawImage(bitmap, 0, 0);
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

function show(now) {
    knead.now = now;
    say(now.level, now.status);
    write($('force'), now.force_n.toFixed(now.force_n < 9.995 ? 2 : 1));
    write($('pressed'), now.depth_mm.toFixed(1));
    write($('contact'), now.contact ? 'touching' : 'none');
    $('readings').classList.toggle('touching', now.contact);
    // During a press, keep the slider's maximum: deepest_mm is then only the depth that is left below the tool.
    if (hand.holder === null && !now.contact) slider.max = now.deepest_mm;
    showDepth();
    write($('bar'), now.bar_mm ? `bar on the table: ${now.bar_mm < 9.9 ? `${now.bar_mm} mm` : `${now.bar_mm / 10} cm`}` : '');
    write($('time'), `${(now.tick / 1000).toFixed(1)} s served`);
    showTouch(now.touch);
    showLegend(now.top);
    drawTrace();
}

// ---- pointer

// REPEAT_MS: interval at which a press is sent again, ms. WHEEL_MM: change of depth per pixel of the wheel, mm. KEY_MM:
// change of depth per key, mm. KEY_STEP: step of an arrow key, as a share of the picture.
const REPEAT_MS = 50, WHEEL_MM = 0.005, KEY_MM = 0.5, KEY_STEP = 0.015;
// u, v: place in the picture at which the tool aims. holder: what holds the press: a pointer's id, 'key', or null (no
// press).
const hand = { u: 0.5, v: 0.5, holder: null, depth_mm: 5 };
// soon: id of the requested animation frame that will send the pointer, 0: none. soonAt: time of the request.
let soon = 0, soonAt = 0;

const depthNow = () => clamp(hand.depth_mm, 0, Number(slider.max));
function sayPointer() {
    send(POINTER, ++knead.events, hand.holder === null ? 0 : 1, hand.u, hand.v, Math.min(0.0999, depthNow() / 1000));
}

// Send the pointer now.
function tell() {
    cancelAnimationFrame(soon);
    if (waiting.push({ number: knead.events + 1, at: soon ? soonAt : performance.now() }) > 500) waiting.shift();
    soon = 0;
    sayPointer();
}

// Send the pointer with the next animation frame, so that all moves until then become one message.
function tellSoon() {
    if (soon) return;
    soonAt = performance.now();
    soon = requestAnimationFrame(tell);
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
    tell();
}

function letGo() {
    if (hand.holder === null) return;
    hand.holder = null;
    tell();
}

function aim(event) {
    const box = picture.getBoundingClientRect();
    hand.u = clamp((event.clientX - box.left) / box.width, 0, 1);
    hand.v = clamp((event.clientY - box.top) / box.height, 0, 1);
}

picture.addEventListener('pointerdown', (event) => {
    if (hand.holder !== null) return;
    if (event.button === 2 || (event.button === 0 && event.shiftKey)) return beginOrbit(event);
    if (event.button !== 0) return;
    picture.setPointerCapture(event.pointerId);
    aim(event);
    press(event.pointerId);
});
picture.addEventListener('pointermove', (event) => {
    if (hand.holder !== null || !event.isPrimary || orbit.pointer !== null) return;
    aim(event);
    tellSoon();
});
// Listen on the window, which gets the events of the pressing pointer with and without a pointer capture. Chromium ends
// the capture when the layout changes under a mouse that is driven by Chromium's debugging protocol.
window.addEventListener('pointermove', (event) => {
    if (hand.holder !== event.pointerId) return;
    if (event.buttons & 1) aim(event), tellSoon(); // stroke the object at the current depth
    else letGo(); // the left button was released while another was down: the browser sends no pointerup for this
});
onRelease((event) => { if (hand.holder === event.pointerId) letGo(); });
picture.addEventListener('wheel', (event) => {
    if (event.ctrlKey) return; // Ctrl and the wheel zoom the page
    event.preventDefault();
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
connect();

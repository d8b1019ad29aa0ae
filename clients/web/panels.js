// Panels beside the picture: buttons for an operator, material, scene, view, numbers. The panels show the facts that
// the page has received (`about`) and send requests.
'use strict';
// Helpers of all scripts of the page.
const $ = (id) => document.getElementById(id);
const make = (tag, fields) => Object.assign(document.createElement(tag), fields);
const clamp = (x, low, high) => Math.min(high, Math.max(low, x));
// Call a function when a pointer is released or lost.
const onRelease = (call) => ['pointerup', 'pointercancel'].forEach((end) => window.addEventListener(end, call));
const round3 = (x) => Number(x.toPrecision(3)).toLocaleString('en', { maximumFractionDigits: 6 });
let about = null, toolsShown = '';

// Write only new text: a screen reader reads every change aloud.
function write(element, text) {
    if (element.textContent !== text) element.textContent = text;
}

// ---- orders

let unsaid = 0; // timer that clears the last shown answer
const LATE_MS = 700; // time after which an order without an answer is shown as waiting

function report(ok, words) {
    clearTimeout(unsaid);
    $('said').dataset.level = ok ? 'ok' : 'fault';
    write($('said'), words);
    unsaid = setTimeout(() => write($('said'), ''), ok ? 8000 : 30000);
}

// Send a request and show its answer. silent: show the answer only if the request was refused.
async function order(what, fields, silent = false) {
    // If kneadd needs longer, for example to build a scene and let it settle, say so within a second.
    const late = setTimeout(report, LATE_MS, true, `Waiting for kneadd (${what}${fields?.name ? ` ${fields.name}` : ''}) ...`);
    const { ok, words } = await ask(what, fields);
    clearTimeout(late);
    if (!ok || !silent) report(ok, words);
    return ok;
}

for (const what of ['undo', 'reset', 'snapshot', 'restore', 'estop', 'recover'])
    $(what).addEventListener('click', () => { letGo(); order(what); });

function explain(id, words) {
    $(id).hidden = !words;
    write($(id), words || '');
}

// Enable the buttons whose orders kneadd can carry out now. Show why the other buttons are disabled.
function showOperator({ why, orders, saves, snapshot, stopped }) {
    for (const what of ['undo', 'reset', 'recover']) $(what).disabled = Boolean(why);
    $('estop').disabled = !orders; // the emergency stop stays enabled as long as orders can be sent to kneadd
    // Show either the emergency stop or Recover. If the hidden button had the focus, give the focus to the shown one.
    if (stopped !== $('estop').hidden) {
        const focused = [$('estop'), $('recover')].includes(document.activeElement);
        $('estop').hidden = stopped;
        $('recover').hidden = !stopped;
        if (focused) $(stopped ? 'recover' : 'estop').focus();
    }
    $('snapshot').disabled = Boolean(why) || !saves;
    $('restore').disabled = Boolean(why) || !saves || snapshot === 0;
    explain('why', why && `${orders ? 'Only the emergency stop works' : 'Controls are off'}: ${why}.`);
    explain('why-saves', why ? null : !saves ? 'Nothing is saved: kneadd was started without --state-dir.'
        : snapshot === 0 ? 'Nothing has been saved yet.' : null);
}

// ---- material

const KEYS = { // parameters of a material, in the order of the page: [label, unit]
    k1: ['Spring k1', 'Pa'], c1: ['Dashpot c1', 'Pa·s'], c2: ['Damper c2', 'Pa·s'],
    alpha: ['Damper α', 'Pa·s'], beta: ['Thinning β', '1/Pa'],
    c_max: ['Damper at rest', 'Pa·s'], c_min: ['Damper under load', 'Pa·s'],
    p0: ['Thins from p0', 'Pa'], p1: ['Thins up to p1', 'Pa'],
};
// DECADES: range of a slider to each side of the scene's value, in decades. TICKS: steps of a slider per decade.
const DECADES = 2, TICKS = 100;
// Sliders by key. from: value in the middle of the slider. dragged: the user moves the slider, or its new value is
// being sent. fixed: the value is 0, which has no place on a logarithmic scale. shown: position of the slider for the
// value in use.
const sliders = new Map();

function quantity(x, unit) {
    if (unit === '1/Pa') return `${round3(1e3 * x)} 1/kPa`;
    const [factor, prefix] = x >= 1e9 ? [1e-9, 'G'] : x >= 1e6 ? [1e-6, 'M'] : x >= 1e3 ? [1e-3, 'k'] : [1, ''];
    return `${round3(factor * x)} ${prefix}${unit}`;
}

// Add a slider for a parameter of the material, with a logarithmic scale around the scene's value.
function addSlider(key, value) {
    const [words, unit] = KEYS[key], row = make('div', { className: 'slider' });
    const label = make('label', { textContent: words, htmlFor: `m-${key}` });
    const output = make('output', { htmlFor: `m-${key}` });
    const input = make('input',
        { type: 'range', id: `m-${key}`, min: -DECADES * TICKS, max: DECADES * TICKS, step: 1 });
    const one = { input, output, from: value, dragged: false, shown: '' };
    const chosen = () => one.from * 10 ** (Number(input.value) / TICKS);
    const say = (x) => {
        output.textContent = quantity(x, unit);
        input.setAttribute('aria-valuetext', output.textContent);
    };
    one.show = (x) => {
        one.fixed = x === 0;
        if (x > 0) input.value = Math.round(TICKS * Math.log10(x / one.from));
        one.shown = input.value;
        say(x);
    };
    // If a drag ends at the old value, the browser sends no `change` event. So end such a drag here.
    const settle = () => {
        if (input.value !== one.shown) return;
        one.dragged = false;
        if (about?.material) one.show(about.material[key]);
    };
    for (const end of ['pointerup', 'pointercancel', 'keyup', 'blur']) input.addEventListener(end, settle);
    input.addEventListener('input', () => { one.dragged = true; say(chosen()); });
    input.addEventListener('change', async () => {
        one.dragged = true;
        one.shown = input.value;
        const taken = await order('set', { name: key, value: Number(chosen().toPrecision(6)) });
        one.dragged = false;
        if (!taken && about?.material) one.show(about.material[key]);
    });
    input.setAttribute('aria-describedby', 'why why-zero');
    row.append(label, output, input);
    $('sliders').append(row);
    sliders.set(key, one);
}

// Show the material. Make new sliders for a new scene or another damper. A slider that is being dragged keeps its
// place.
function showMaterial(material, scene) {
    const keys = Object.keys(KEYS).filter((key) => key in material), made = `${scene} ${keys}`;
    if ($('sliders').dataset.made !== made) {
        $('sliders').dataset.made = made;
        $('sliders').replaceChildren();
        sliders.clear();
        for (const key of keys) addSlider(key, material[key] || 1);
    }
    for (const [key, one] of sliders) if (!one.dragged) one.show(material[key]);
    explain('why-zero', [...sliders.values()].some((one) => one.fixed) && 'A value of 0 has no place on a logarithmic slider.');
}

// ---- lists

// Fill a list with names, and select the chosen name unless the list has the focus. words: function that returns the
// text shown for a name.
function fill(id, names, chosen, words = (name) => name) {
    const select = $(id);
    if (select.dataset.names !== names.join()) {
        select.dataset.names = names.join();
        select.replaceChildren(...names.map((name) => new Option(words(name), name)));
    }
    if (document.activeElement !== select || !names.includes(select.value)) select.value = chosen;
}

$('style').addEventListener('change', () => redraw());
for (const what of ['quality', 'scene', 'material', 'measure'])
    $(what).addEventListener('change', ({ target }) => {
        const silent = what === 'measure'; // its effect is visible in the picture
        if (target.value !== '…') order(what, { name: target.value }, silent);
        // Do not leave the chosen material selected, because the sliders may change the material afterwards.
        if (what === 'material') target.value = '…';
    });
$('what').addEventListener('change', ({ target }) => choose(target.value));

// ---- view

// The view of this page. pan: shift of the picture, m, to the right and up. pans: true: the pointer moves the view
// sideways instead of turning it.
const orbit = { pointer: null, azimuth: 28, elevation: 27, zoom: 1, pan: [0, 0], pans: false, x: 0, y: 0 };
let looking = 0;

// Change the view, at most once per animation frame. Pages that show pictures of knead web share one view.
function look(azimuth, elevation, zoom = orbit.zoom, pan = orbit.pan) {
    orbit.azimuth = ((azimuth + 540) % 360) - 180;
    orbit.elevation = clamp(elevation, 2, 90);
    orbit.zoom = clamp(zoom, 1, scene ? 16 : 4);
    orbit.pan = scene ? pan : [0, 0];
    movedAt = performance.now();
    looking ||= requestAnimationFrame(() => {
        looking = 0;
        if (scene) redraw();
        else ask('view', { azimuth: orbit.azimuth, elevation: orbit.elevation, zoom: orbit.zoom });
    });
}

const turn = (azimuth, elevation) => look(orbit.azimuth + azimuth, orbit.elevation + elevation);

// Move the view sideways by pixels of the window.
function pan(x, y) {
    const seen = camera();
    if (!seen) return;
    const metres = 2 * seen.tanHalf * seen.distance / picture.clientHeight;
    look(orbit.azimuth, orbit.elevation, orbit.zoom, [orbit.pan[0] - x * metres, orbit.pan[1] + y * metres]);
}

function beginOrbit(event) {
    const pans = event.button === 1 || (event.button === 2 && event.shiftKey);
    Object.assign(orbit, { pointer: event.pointerId, x: event.clientX, y: event.clientY, pans });
    $('picture').setPointerCapture(event.pointerId);
}
window.addEventListener('pointermove', (event) => {
    if (orbit.pointer !== event.pointerId) return;
    if (orbit.pans) pan(event.clientX - orbit.x, event.clientY - orbit.y);
    else turn((orbit.x - event.clientX) * 0.4, (event.clientY - orbit.y) * 0.3);
    Object.assign(orbit, { x: event.clientX, y: event.clientY });
});
onRelease(({ pointerId }) => { if (orbit.pointer === pointerId) orbit.pointer = null; });

// Two fingers: their middle turns the view, their distance zooms it. Places are shares of the picture.
let pinch = null;
const pinchOf = ([a, b]) => ({ u: (a.u + b.u) / 2, v: (a.v + b.v) / 2, wide: Math.max(0.02, Math.hypot(a.u - b.u, a.v - b.v)) });
function beginPinch(places) { pinch = pinchOf(places); }
function movePinch(places) {
    const now = pinchOf(places);
    if (!pinch) return;
    look(orbit.azimuth + 200 * (pinch.u - now.u), orbit.elevation + 120 * (now.v - pinch.v), orbit.zoom * now.wide / pinch.wide);
    pinch = now;
}
onRelease(() => { pinch = null; });

for (const button of document.querySelectorAll('[data-view]'))
    button.addEventListener('click', () => look(...button.dataset.view.split(',').map(Number), orbit.zoom, [0, 0]));

for (const [id, factor] of [['closer', 1.25], ['farther', 0.8]])
    $(id).addEventListener('click', () => look(orbit.azimuth, orbit.elevation, orbit.zoom * factor));

const wordsOf = (measure) => about?.view.measures.find(({ name }) => name === measure)?.words;

const TOPS = { // by measure: text of the legend for the top of the colour scale
    displacement: (x) => `${round3(1e3 * x)} mm`, stress: (x) => quantity(x, 'Pa'),
    residual: (x) => `${round3(100 * x)} %`,
};

$('legend').querySelector('i').style.background = `linear-gradient(90deg, ${SCALE.map((hex) => `#${hex}`)})`;
function showLegend(top) {
    const measure = $('measure').value;
    $('legend').hidden = !top || !TOPS[measure];
    if ($('legend').hidden) return;
    write($('legend-words'), wordsOf(measure) ?? '');
    write($('legend-top'), TOPS[measure](top));
}

// ---- recordings

$('record').addEventListener('click', () => {
    const value = about?.recording || about?.playing;
    order(value ? 'stop' : 'record', value ? { value } : {});
});

// Add the row of a recording with its buttons.
function addRecording(number) {
    const row = make('li'), words = make('span'), told = make('p', { className: 'why' });
    const buttons = make('p', { className: 'buttons' });
    const add = (name, does) => {
        const button = make('button', { type: 'button', textContent: name });
        button.setAttribute('aria-label', `${name}, recording ${number}`);
        button.setAttribute('aria-describedby', 'why');
        button.addEventListener('click', does);
        buttons.append(button);
    };
    const file = (kind) => save(`recording/${number}.${kind}`, `${stem()}-${number}.${kind}`);
    const one = () => about?.recordings.find((each) => each.number === number);
    add('Log', () => file('lcmlog'));
    add('CSV', async () => { if (one()?.csv || await order('verify', { value: number }) || one()?.csv) file('csv'); });
    add('Verify', () => order(about?.replaying === number ? 'stop' : 'verify', { value: number }));
    add('Play', () => order('play', { value: number }));
    row.dataset.number = number;
    row.append(words, told, buttons);
    return row;
}

function showRecordings({ recordings, recording, playing, replaying }) {
    write($('record'), recording ? 'Stop' : playing ? 'Stop playing' : 'Record');
    $('record').classList.toggle('on', Boolean(recording));
    const rows = new Map([...$('recordings').children].map((row) => [Number(row.dataset.number), row]));
    for (const [number, row] of rows) if (!recordings.some((one) => one.number === number)) row.remove();
    for (const one of recordings.sort((a, b) => a.number - b.number)) { // ascending: each new row is put first
        const row = rows.get(one.number) ?? addRecording(one.number);
        if (!row.isConnected) $('recordings').prepend(row);
        const [words, told, buttons] = row.children;
        write(words, { waits: `${one.number}: waits for the scene`, failed: `${one.number}: failed` }[one.state]
            ?? `${one.number}: ${one.s.toFixed(1)} s, ${one.mb.toFixed(1)} MB`);
        write(told, replaying === one.number ? 'is being replayed' : one.words);
        buttons.hidden = one.state !== 'whole';
        const verify = buttons.children[2], now = replaying === one.number ? 'Stop' : 'Verify';
        write(verify, now); // the same button verifies and stops, so that it keeps the focus
        verify.setAttribute('aria-label', `${now}, recording ${one.number}`);
    }
}

// ---- numbers

function numbers({ mesh, loop, energy }) {
    const rows = [];
    if (energy) rows.push(['Energy stored', `${round3(energy.stored_mj)} mJ`],
                          ['Dissipated since new', `${round3(energy.dissipated_mj)} mJ`]);
    if (loop) rows.push(
        ['Ticks missed', loop.ticks ? `${loop.missed} of ${loop.ticks.toLocaleString('en')}; the machine stood still `
            + `in ${loop.explained} of them` : '–'],
        ['Time of a tick', loop.p99_us ? `mean ${round3(loop.mean_us ?? 0)} µs; half below ${loop.p50_us} µs, 99 % `
            + `below ${loop.p99_us} µs` : '–']);
    rows.push(['Lattice', `${mesh.nodes.toLocaleString('en')} nodes, ${mesh.edges.toLocaleString('en')} edges, `
                          + `${mesh.cells.toLocaleString('en')} cells`],
              ['Surface', `${mesh.triangles.toLocaleString('en')} triangles, ${mesh.hz ?? 0} per second of `
                          + `${round3((mesh.bytes ?? 0) / 1000)} kB`]);
    return rows;
}

function showNumbers(told) {
    const rows = numbers(told), list = $('numbers');
    while (list.children.length < rows.length) {
        list.append(make('div'));
        list.lastChild.append(make('dt'), make('dd'));
    }
    while (list.children.length > rows.length) list.lastChild.remove();
    rows.forEach(([name, value], i) => {
        write(list.children[i].firstChild, name);
        write(list.children[i].lastChild, value);
    });
}

function showTouch(touch) {
    $('touch-box').hidden = !touch;
    if (!touch || !$('touch-box').open) return;
    const ctx = $('touch').getContext('2d'), most = Math.max(1e-9, ...touch.kpa);
    const style = getComputedStyle($('touch')), ink = style.getPropertyValue('--force');
    ctx.clearRect(0, 0, 160, 160);
    ctx.fillStyle = ink;
    touch.kpa.forEach((kpa, i) => {
        ctx.globalAlpha = Math.max(0.04, kpa / most);
        ctx.fillRect(20 * (i % 8) + 1, 20 * (7 - Math.floor(i / 8)) + 1, 18, 18);
    });
    write($('touch-words'), touch.area_mm2 > 0
        ? `${round3(touch.area_mm2)} mm² touched, ${round3(touch.peak_kpa)} kPa at most` : 'no contact');
}

// ---- everything

// Enable or disable the controls. why: reason why kneadd accepts no orders now; null: kneadd accepts orders. there:
// true if knead web is connected; knead web itself answers the requests that kneadd does not answer.
// Pictures of knead web have one style.
function showStyle(there) {
    $('style').disabled = !there || !scene;
    $('style').title = scene ? '' : 'Only where the browser draws by WebGL.';
}

function showAble(why, there) {
    for (const select of ['material', 'scene', 'quality']) $(select).disabled = Boolean(why);
    for (const one of sliders.values()) {
        one.input.disabled = Boolean(why) || one.fixed;
        if (!there) one.dragged = false;
    }
    showStyle(there);
    const own = '#view button, #view select, #record, #recordings button, [id^=save]';
    for (const element of document.querySelectorAll(own)) element.disabled = !there;
}

// Take over the view of the pictures of knead web.
function takeView({ azimuth, elevation, zoom }) { Object.assign(orbit, { azimuth, elevation, zoom, pan: [0, 0] }); }

// Show the facts that have been received; null: knead web has disconnected.
function showAbout(told) {
    about = told;
    if (!told) {
        showOperator({ why: 'knead web is not connected', orders: false, saves: false, snapshot: 0, stopped: false });
        return showAble('knead web is not connected', false);
    }
    write($('names'), [told.scene, told.tool].filter(Boolean).join(' · '));
    write($('label'), told.label ?? '');
    $('label').hidden = !told.label;
    showOperator(told.control);
    if (told.material) showMaterial(told.material, told.scene);
    fill('material', ['…', ...told.materials], '…');
    fill('scene', told.scenes.includes(told.scene) ? told.scenes : [told.scene, ...told.scenes], told.scene);
    const { length } = told.scenes, more = told.unlisted;
    explain('why-scenes',
        more > 0 ? `${more} more scenes are not listed: at most 32 are, with names of letters, digits and . _ -`
        : length === 0 ? 'To list other scenes, start knead web with --scenes DIR.' : null);
    fill('quality', told.points ?? [], told.control.quality ?? '');
    const measures = ['none', ...told.view.measures.map(({ name }) => name)], own = $('measure').value;
    fill('measure', measures, !scene ? told.view.measure : measures.includes(own) ? own : 'none', (name) => wordsOf(name) ?? 'material');
    if (scene && $('measure').value !== own) ask('measure', { name: $('measure').value });
    // Pictures of knead web have one view: take over what another page has set, unless this page is turning the view.
    if (!scene && orbit.pointer === null && !looking) {
        takeView(told.view);
    }
    if (told.object && JSON.stringify(told.object.tools) !== toolsShown) {
        toolsShown = JSON.stringify(told.object.tools);
        scene?.takeTools(told.object, loadTool);
    }
    showNumbers(told);
    showRecordings(told);
    showAble(told.control.why, true);
}

// ---- downloads

const get = (name) => fetch(`/get/${name}`, { headers: { Authorization: `Bearer ${location.hash.slice(1)}` }, cache: 'no-store' }).catch(() => null);

function saveBlob(blob, as) {
    const link = make('a', { download: as, href: URL.createObjectURL(blob) });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    report(true, `Saved ${as}.`);
}

// Download a file of knead web and save it under a name.
async function save(name, as) {
    const answer = await get(name);
    if (!answer?.ok) return report(false, answer ? await answer.text() : 'knead web is not connected');
    saveBlob(await answer.blob(), as);
}

// Triangles of a tool that is a mesh; null: knead web has none.
async function loadTool(index) {
    const answer = await get(`tool-${index}`);
    return answer?.ok ? new Float32Array(await answer.arrayBuffer()) : null;
}

// Write caption, scale and legend on a copy of the picture.
function caption(ctx, { width, height }, tick) {
    const size = Math.round(height / 32), pad = size, style = getComputedStyle(document.body);
    ctx.font = `${size}px ${style.fontFamily}`;
    ctx.fillStyle = style.color;
    ctx.textAlign = 'left';
    ctx.fillText(`${stem()}, ${(tick / 1000).toFixed(2)} s`, pad, pad + size);
    ctx.fillText(barWords(), pad, height - pad);
    if ($('legend').hidden) return;
    const from = width - pad - 12 * size, tone = ctx.createLinearGradient(from, 0, width - pad, 0);
    SCALE.forEach((hex, i) => tone.addColorStop(i / 8, `#${hex}`));
    ctx.textAlign = 'right';
    ctx.fillText(`${$('legend-words').textContent}, 0 to ${$('legend-top').textContent}`, width - pad, height - pad);
    ctx.fillStyle = tone;
    ctx.fillRect(from, height - pad - 2.2 * size, 12 * size, 0.8 * size);
}

$('save-picture').addEventListener('click', () => {
    if (!about?.object) return report(false, 'Nothing has been drawn yet.');
    redraw(true);
    const { width, height } = canvas, copy = make('canvas', { width, height }), ctx = copy.getContext('2d');
    copyPicture(ctx, width, height);
    caption(ctx, copy, knead.now?.tick ?? 0);
    copy.toBlob((blob) => saveBlob(blob, `${stem()}.png`));
});

// Play the last 10 s again on a canvas of its own, and let the browser record it as a film.
let filming = false;
$('save-clip').addEventListener('click', () => {
    if (filming) return;
    const frames = kept.filter((frame) => Boolean(frame.jpeg) === !scene), kind = ['video/webm;codecs=vp9', 'video/webm;codecs=vp8', 'video/mp4'].find((type) => window.MediaRecorder?.isTypeSupported(type));
    if (!kind || !about?.object || frames.length < 2) return report(false, kind ? 'Nothing has been drawn yet.' : 'This browser cannot record films.');
    const film = make('canvas', { width: 1280, height: 720 }), ctx = film.getContext('2d'), parts = [];
    const stage = make('canvas', { width: 1280, height: 720 });
    let play = null;
    try {
        play = scene && openScene(stage, shaders);
    } catch (error) {
        return report(false, `The film cannot be drawn: ${error.message}`);
    }
    const object = about.object, view = { ...orbit };
    play?.takeSurface(surface.data, surface.at);
    play?.takeTools(object, loadTool);
    const recorder = new MediaRecorder(film.captureStream(30), { mimeType: kind, videoBitsPerSecond: 6e6 });
    recorder.ondataavailable = ({ data }) => parts.push(data);
    recorder.onstop = () => {
        play?.gl.getExtension('WEBGL_lose_context')?.loseContext();
        filming = false;
        saveBlob(new Blob(parts, { type: kind.split(';')[0] }), `${stem()}.${kind.includes('webm') ? 'webm' : 'mp4'}`);
    };
    recorder.start();
    filming = true;
    const begin = performance.now(), seconds = Math.round((frames.at(-1).at - frames[0].at) / 1000);
    report(true, `Making a film of the last ${seconds} s ...`);
    let shown = null;
    const step = async () => {
        const time = frames[0].at + performance.now() - begin;
        const frame = frames.findLast(({ at }) => at <= time) ?? frames[0];
        if (frame !== shown && frame.jpeg) {
            const bitmap = await createImageBitmap(frame.jpeg).catch(() => null);
            if (bitmap) ctx.drawImage(bitmap, 0, 0, film.width, film.height);
            bitmap?.close();
        } else if (frame !== shown) {
            play.takeShape(frame.data, frame.offset, frame.size);
            play.draw({ object, poses: frame.poses, camera: cameraOf(object, view, 16 / 9), azimuth: view.azimuth,
                        style: $('style').value, dark: dark.matches });
            ctx.drawImage(stage, 0, 0);
        }
        if (frame !== shown) caption(ctx, film, frame.tick);
        shown = frame;
        if (time > frames.at(-1).at) recorder.stop();
        else setTimeout(step, 1000 / 60);
    };
    step();
});
const stem = () => (about?.scene ?? 'scene').replace(/\.yaml$/, '');
$('save-material').addEventListener('click', () => save('material.yaml', `${stem()}-material.yaml`));
$('save-scene').addEventListener('click', () => save('scene.yaml', `${stem()}-served.yaml`));

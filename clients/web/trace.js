// Traces of force, depth, work, energies and round trip: one sample per millisecond of the page's own clock; NaN: no
// value was received.
'use strict';
const trace = document.getElementById('trace');
// SPAN: time that the trace shows, ms. RING: number of samples that are kept, one per ms; more than SPAN, so that the
// oldest column stays complete. LATE: the trace gets a gap if the samples lag behind the clock by
// more than this, ms.
const SPAN = 10000, RING = 12000, LATE = 250;
const TRACES = {
    force: { unit: 'N', least: 1, label: 'Force' },
    depth: { unit: 'mm', least: 1, label: 'Depth below the first touch' },
    work: { unit: 'mJ', least: 1, label: 'Work of the hand on the object' },
    stored: { unit: 'mJ', least: 1, label: 'Energy that the object stores, audited once a second' },
    dissipated: { unit: 'mJ', least: 1, label: 'Energy dissipated since the object was new, audited once a second' },
    trip: { unit: 'ms', least: 2, label: 'Time from sending a pose to receiving its force' },
};
for (const one of Object.values(TRACES)) one.ring = new Float32Array(RING).fill(NaN);
let tick = 0, shown = 'force';

// Append the samples of one message. If the trace lags behind the clock by more than LATE, fill the gap with NaN first.
function record(samples) {
    const count = samples.force.length, audit = about?.energy;
    let late = Math.round(performance.now()) - tick - count;
    const put = (name, value) => { TRACES[name].ring[tick % RING] = value ?? NaN; };
    if (late > RING) tick += late - RING, late = RING; // the gap fills the whole ring
    if (late > LATE) for (; late > 0; late--, tick++) for (const name in TRACES) put(name, NaN);
    for (let i = 0; i < count; i++, tick++) {
        for (const name in samples) put(name, samples[name][i]);
        put('stored', audit?.stored_mj);
        put('dissipated', audit?.dissipated_mj);
    }
}

function choose(name) {
    shown = name;
    trace.setAttribute('aria-label', `${TRACES[name].label}, over the last ten seconds`);
    drawTrace();
}

// Reduce the ring to the least and largest value of each column. The columns begin at multiples of a fixed number of
// ticks, counted from tick 0, so that a peak keeps its shape while it moves left.
function columnsOf(ring, count) {
    const per = SPAN / count, last = Math.floor(tick / per), columns = [];
    for (let c = last - count; c < last; c++) {
        let low = Infinity, high = -Infinity;
        for (let t = Math.max(0, Math.ceil(c * per)); t < (c + 1) * per; t++) {
            const value = ring[t % RING];
            if (value < low) low = value; // a comparison with NaN is false
            if (value > high) high = value;
        }
        columns.push([low, high]);
    }
    return columns;
}

// Draw the chosen trace: scale, time axis, then the curve.
function drawTrace() {
    const ratio = devicePixelRatio, width = trace.clientWidth, height = trace.clientHeight;
    const left = 56, right = width - 12, top = 14, bottom = height - 24;
    fit(trace, Math.round(width * ratio), Math.round(height * ratio));
    const { ring, unit, least } = TRACES[shown];
    const columns = columnsOf(ring, Math.max(1, Math.floor((right - left) * ratio)));
    const most = columns.reduce((m, [, high]) => Math.max(m, high), 0);
    let ceiling = least; // top of the scale: 1, 2, 5, 10, 20, 50 ...
    for (let i = least === 2 ? 1 : 0; most > ceiling; i++) ceiling *= [2, 2.5, 2][i % 3];
    const x = (c) => left + (c + 0.5) / columns.length * (right - left);
    const y = (value) => bottom - Math.max(0, value) / ceiling * (bottom - top);
    const style = getComputedStyle(trace), color = (name) => style.getPropertyValue(name);
    const ctx = trace.getContext('2d');
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);

    ctx.font = `12px ${style.fontFamily}`;
    ctx.fillStyle = color('--quiet');
    ctx.strokeStyle = color('--rule');
    ctx.lineWidth = 1;
    ctx.beginPath();
    ctx.textAlign = 'right';
    for (const value of [0, ceiling / 2, ceiling]) {
        ctx.fillText(value === ceiling ? `${value} ${unit}` : value, left - 8, y(value) + 4);
        ctx.moveTo(left, Math.round(y(value)) + 0.5);
        ctx.lineTo(right, Math.round(y(value)) + 0.5);
    }
    ctx.stroke();
    for (let s = -10; s <= 0; s += right - left < 340 ? 5 : 2) {
        ctx.textAlign = s === 0 ? 'right' : s === -10 ? 'left' : 'center';
        ctx.fillText(s === 0 ? 'now' : `−${-s} s`, left + (s + 10) / 10 * (right - left), height - 6);
    }

    ctx.strokeStyle = ctx.fillStyle = color('--force');
    ctx.lineWidth = 1.75;
    ctx.lineJoin = 'round';
    let from = -1, end = 0;
    // For each run of columns that have samples, draw a line and fill the area below it.
    for (let c = 0; c <= columns.length; c++) {
        const [low, high] = columns[c] ?? [1, 0], heard = low <= high;
        if (heard && from < 0) ctx.beginPath(), from = c;
        // Draw a column as a slanted stroke between its largest and its least value. Begin at the value that is nearer
        // to the end of the last stroke. Vertical strokes would show a slope as a saw or as stairs.
        if (heard) {
            const falls = Math.abs(high - end) < Math.abs(low - end);
            ctx.lineTo(x(c - 0.25), y(falls ? high : low));
            ctx.lineTo(x(c + 0.25), y(end = falls ? low : high));
        }
        if (heard || from < 0) continue;
        ctx.stroke();
        ctx.lineTo(x(c - 1), y(0));
        ctx.lineTo(x(from), y(0));
        ctx.globalAlpha = 0.13;
        ctx.fill();
        ctx.globalAlpha = 1;
        from = -1;
    }
}

window.addEventListener('resize', drawTrace);

// Read an MCAP file with @mcap/core, check every message against its schema, and compare the forces with a table.
//     node mcap_reader.mjs FILE.mcap TABLE.csv MOMENTS MM      MM: the surface moves at least so far
import { open, readFile } from 'node:fs/promises';
import { McapIndexedReader, McapStreamReader } from '@mcap/core';

const [path, table, moments, atLeast] = process.argv.slice(2);
let failed = false;
const check = (sentence, holds, ...seen) => {
    console.log(holds ? `ok   ${sentence}` : `FAIL ${sentence}: ${seen.map((x) => JSON.stringify(x)).join(', ')}`);
    failed ||= !holds;
};
// Return where a value does not fit a schema: a path, or null if it fits.
function misfit(value, schema, at = '') {
    if (schema.type === 'number' || schema.type === 'integer')
        return typeof value === 'number' && (schema.type === 'number' || Number.isInteger(value)) ? null : at;
    if (schema.type === 'array') {
        if (!Array.isArray(value)) return at;
        for (const [i, one] of value.entries()) { const bad = misfit(one, schema.items, `${at}[${i}]`); if (bad) return bad; }
        return null;
    }
    if (schema.type !== 'object') return typeof value === schema.type ? null : at;
    for (const [name, type] of Object.entries(schema.properties)) {
        if (!(name in Object(value))) return `${at}.${name} (missing)`;
        const bad = misfit(value[name], type, `${at}.${name}`);
        if (bad) return bad;
    }
    return null;
}

const file = await open(path), size = (await file.stat()).size;
const readable = {
    size: async () => BigInt(size),
    read: async (offset, length) => {
        const bytes = new Uint8Array(Number(length));
        await file.read(bytes, 0, bytes.length, Number(offset));
        return bytes;
    },
};
const reader = await McapIndexedReader.Initialize({ readable });
const channels = new Map(), schemas = new Map(), counts = {}, misfits = [], forces = [], places = [], updates = [];
const text = new TextDecoder();
for (const [id, schema] of reader.schemasById) schemas.set(id, JSON.parse(text.decode(schema.data)));
for (const [id, channel] of reader.channelsById) channels.set(id, channel);
let last = 0n, backwards = 0, gaps = 0, stamps = 0;
for await (const m of reader.readMessages()) {
    const { topic, schemaId, messageEncoding } = channels.get(m.channelId), value = JSON.parse(text.decode(m.data));
    const bad = messageEncoding === 'json' ? misfit(value, schemas.get(schemaId)) : messageEncoding;
    if (bad) misfits.push([topic, bad]);
    const { sec, nsec } = value.timestamp ?? value.entities[0].timestamp;
    stamps += BigInt(sec) * 1000000000n + BigInt(nsec) === m.logTime;
    backwards += m.logTime < last;
    last = m.logTime;
    gaps += m.sequence !== (counts[topic] ?? 0);
    counts[topic] = (counts[topic] ?? 0) + 1;
    if (topic.endsWith('/force')) forces.push({ at: m.logTime, ...value });
    if (topic === '/tf') places.push(value);
    if (topic === '/scene') updates.push(value);
}
check('the reader knows every topic', [...channels.values()].map((c) => c.topic).join() === '/tf,/scene,/plate/force,/finger/force',
    [...channels.values()].map((c) => c.topic));
check('every message fits its schema', misfits.length === 0, misfits.slice(0, 3));
check('the messages are in the order of their times and numbers', backwards === 0 && gaps === 0, backwards, gaps);
const all = Object.values(counts).reduce((a, b) => a + b);
check('the statistics count the messages', Number(reader.statistics.messageCount) === all, counts);
check('every message has its time inside, too', stamps === all, stamps, all);

const [head, ...rows] = (await readFile(table, 'utf8')).trim().split('\n').map((line) => line.split(','));
const column = (name) => head.indexOf(name);
check(`there is a force and a pose for each of the ${rows.length} rows of the table`,
    forces.length === rows.length && places.length === rows.length, counts);
let worst = 0;
for (const [i, row] of rows.entries())
    for (const [vector, names] of [[forces[i].position_m, ['x_m', 'y_m', 'z_m']], [forces[i].force_n, ['fx_n', 'fy_n', 'fz_n']],
        [forces[i].contact_force_n, ['contact_fx_n', 'contact_fy_n', 'contact_fz_n']],
        [forces[i].torque_n_m, ['tx_n_m', 'ty_n_m', 'tz_n_m']],
        [places[i].translation, ['proxy_x_m', 'proxy_y_m', 'proxy_z_m']]])
        for (const [k, name] of names.entries()) {
            const wanted = Number(row[column(name)]);
            worst = Math.max(worst, Math.abs(vector['xyz'[k]] - wanted) / Math.max(Math.abs(wanted), 1e-6));
        }
check(`positions and forces are those of the table: ${worst.toExponential(1)}`, worst < 1e-7);
check('the times are those of the table', rows.every((row, i) =>
    Number(forces[i].at - forces[0].at) === Math.round(1e3 * (row[column('time_s')] - rows[0][column('time_s')])) * 1e6));

const entity = (update, id) => update.entities.find((e) => e.id === id);
check(`there is a scene update for each of the ${moments} moments`, updates.length === Number(moments), updates.length);
const skins = updates.map((u) => entity(u, 'World').triangles[0].points), last_skin = skins.at(-1);
const moved = Math.max(...skins[0].map((p, i) => Math.hypot(p.x - last_skin[i].x, p.y - last_skin[i].y, p.z - last_skin[i].z)));
check(`the surface moves by ${(1e3 * moved).toFixed(2)} mm`, moved >= 1e-3 * atLeast, atLeast);
const inside = ({ triangles: [t] }) => t.indices.length % 3 === 0 && t.indices.every((i) => i >= 0 && i < t.points.length);
check('every corner of a triangle is a point', updates.every((u) => u.entities.every(inside)));
check('every moment has the shape of the tool, in its own frame',
    updates.every((u) => entity(u, 'plate').frame_id === 'plate' && entity(u, 'plate').triangles[0].points.length > 8));
// An arrow points along x in its own frame: turn x by its orientation, and compare it with the force of its tick.
let arrows = 0, off = 0;
for (const { entities: [{ timestamp }], entities } of updates)
    for (const { pose: { orientation: q }, shaft_length } of entities.find((e) => e.id === 'World').arrows) {
        const { contact_force_n: f } = forces.find(({ timestamp: t }) => t.sec === timestamp.sec && t.nsec === timestamp.nsec);
        const drawn = [1 - 2 * (q.y * q.y + q.z * q.z), 2 * (q.x * q.y + q.w * q.z), 2 * (q.x * q.z - q.w * q.y)];
        off = Math.max(off, Math.hypot(...['x', 'y', 'z'].map((k, i) => 100 * shaft_length * drawn[i] - f[k])) / Math.hypot(f.x, f.y, f.z));
        arrows++;
    }
check(`the ${arrows} arrows are the forces: ${off.toExponential(1)}`, arrows >= atLeast && off < 1e-6);

// A reader that knows no index reads the same messages.
const stream = new McapStreamReader({ validateCrcs: true });
stream.append(await readFile(path));
let streamed = 0;
for (let record; (record = stream.nextRecord());) streamed += record.type === 'Message';
check('read as a stream, with the checksums, the file has as many messages', stream.done() && streamed === all, streamed);
await file.close();
process.exit(failed ? 1 : 0);

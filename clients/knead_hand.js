// A hand of a running kneadd on this machine, for node without packages: copy this file. clients/knead_hand.h and
// clients/python have the same in C, C++ and Python.
//
//     const hand = await Hand.open('finger')                the tool's name in the scene
//     const force_n = await hand.move(position_m, velocity_m_s)   some 1000 times a second: waits for the next millisecond
//     hand.close()                                          its force fades without a fault, and the tool is free at once
//
// Poses and forces are LCM messages of one datagram (proto/README.md). The hand has a watchdog of its own: it holds a
// force for 3 ms, fades it to 0 N by 20 ms, and then sends no poses for 1.2 s, which ends the session.
'use strict'
const dgram = require('node:dgram')
const { randomBytes } = require('node:crypto')
const { setTimeout: sleep } = require('node:timers/promises')

const BUS = new URL((process.env.LCM_DEFAULT_URL || 'udpm://239.255.76.67:7667?ttl=0').replace(/^udpm/, 'http'))
const GROUP = BUS.hostname, PORT = Number(BUS.port) || 7667, TTL = Number(BUS.searchParams.get('ttl')), SMALL = 0x4c433032
const POSE = 0xedade4a5caa88ff7n, FORCE = 0x75bbe2590573aa90n // fingerprints of probe_pose_t and contact_force_t
const POSE_BYTES = 125, FORCE_BYTES = 249, HOLD_MS = 3, ZERO_MS = 20, SILENCE_MS = 1200
const LATCHED = 4, LEAVING = 1 << 30

class Hand {
    static open(tool = 'finger') {
        const hand = new Hand()
        hand.pose = Buffer.from(`KNEAD_POSE_${tool}\0`)
        hand.channel = Buffer.from(`KNEAD_FORCE_${tool}\0`)
        hand.socket = dgram.createSocket({ type: 'udp4', reuseAddr: true })
        hand.socket.on('message', data => hand.receive(data))
        hand.seq = hand.count = 0n
        hand.next = performance.now()
        hand.begin()
        return new Promise((done, fail) => {
            hand.socket.once('error', fail)
            hand.socket.bind(PORT, GROUP, () => {
                try {
                    hand.socket.addMembership(GROUP)
                    hand.socket.setMulticastTTL(TTL)
                } catch (error) {
                    hand.socket.close()
                    return fail(new Error(`no LCM on ${GROUP}:${PORT}: ${error.message}; is there a multicast route?`))
                }
                hand.socket.on('error', () => {}) // a pose that is not sent is a pose lost
                done(hand)
            })
        })
    }

    begin() {
        this.session = randomBytes(8).readBigUInt64BE() >> 2n | 1n
        this.heard = this.silent = 0
        this.force_n = [0, 0, 0] // newest force of kneadd on the hand, before the watchdog
        this.flags = 0 // FLAG_* of proto/contact_force_t.lcm
    }

    send(position_m, velocity_m_s, buttons) {
        this.last = [position_m, velocity_m_s]
        const start = 8 + this.pose.length, data = Buffer.alloc(start + POSE_BYTES), p = data.subarray(start)
        data.writeUInt32BE(SMALL)
        data.writeUInt32BE(Number(++this.count & 0xffffffffn), 4)
        this.pose.copy(data, 8)
        p.writeBigUInt64BE(POSE)
        p.writeBigInt64BE(BigInt(Math.round((performance.timeOrigin + performance.now()) * 1e3)), 8)
        p.writeBigUInt64BE(this.session, 16)
        p.writeBigInt64BE(++this.seq, 24)
        p.writeBigInt64BE(process.hrtime.bigint(), 32)
        const values = [...position_m, 1, 0, 0, 0, ...velocity_m_s]
        values.forEach((value, i) => p.writeDoubleBE(value, 40 + 8 * i))
        p.writeInt32BE(buttons, 120)
        this.socket.send(data, PORT, GROUP)
    }

    receive(data) {
        const start = 8 + this.channel.length, p = data.subarray(start)
        if (p.length < FORCE_BYTES || data.readUInt32BE() !== SMALL) return
        if (data.compare(this.channel, 0, this.channel.length, 8, start) !== 0 || p.readBigUInt64BE() !== FORCE) return
        const tick = p.readBigInt64BE(40)
        // a force for another session is for another hand; a repeated force does not reset its age
        if (p.readBigUInt64BE(16) !== this.session || this.heard && tick <= this.tick) return
        this.tick = tick
        this.heard = performance.now()
        this.flags = p.readInt32BE(240)
        this.force_n = [0, 1, 2].map(k => p.readDoubleBE(104 + 8 * k))
    }

    // Wait for the next millisecond, send a pose, and return the force to give to the hand.
    async move(position_m, velocity_m_s = [0, 0, 0]) {
        this.next = Math.max(this.next + 1, performance.now() - 1)
        do await sleep(Math.max(0, Math.floor(this.next - performance.now())))
        while (performance.now() < this.next)
        const now = performance.now()
        if (this.silent && now >= this.silent) this.begin()
        if (!this.silent) this.send(position_m, velocity_m_s, 0)
        const age = this.heard ? now - this.heard : ZERO_MS
        if (this.heard && age >= ZERO_MS && !this.silent) this.silent = now + SILENCE_MS
        const factor = this.silent || age >= ZERO_MS ? 0 : Math.min(1, (ZERO_MS - age) / (ZERO_MS - HOLD_MS))
        this.trouble = factor === 0 ? 'no force from kneadd: is it running?'
            : this.flags & LATCHED ? 'latched: lift the tool' : ''
        return this.force_n.map(f => factor * f)
    }

    close() {
        if (this.closed) return
        this.closed = true
        if (this.heard && !this.silent) this.send(...this.last, LEAVING) // from where it is
        setTimeout(() => this.socket.close(), 10) // once the last datagram is out
    }
}

module.exports = { Hand }

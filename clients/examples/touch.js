// Touch the dough of a running kneadd (kneadd dough-small); touch.c and touch.py do the same.
const { Hand } = require('../knead_hand.js')

async function main() {
    const hand = await Hand.open('finger')
    for (let ms = 0; ms < 4000; ms++) { // down and up, 60 to 37 mm above the table
        const phase = 2 * Math.PI * ms / 4000, z = 0.0485 + 0.0115 * Math.cos(phase)
        const force = await hand.move([0, 0, z], [0, 0, -0.0115 * 2 * Math.PI / 4 * Math.sin(phase)])
        if (ms % 250 === 0) console.log(`z ${(1e3 * z).toFixed(1)} mm   force ${force[2].toFixed(2)} N   ${hand.trouble}`)
    }
    hand.close()
}
main()

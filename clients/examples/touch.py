# Touch the dough of a running kneadd (kneadd dough-small); touch.c and touch.js do the same.
import math

import knead

with knead.Hand('finger') as hand:
    for ms in range(4000):  # down and up, 60 to 37 mm above the table
        phase = 2 * math.pi * ms / 4000
        z, speed = 0.0485 + 0.0115 * math.cos(phase), -0.0115 * 2 * math.pi / 4 * math.sin(phase)
        force_n = hand.move((0, 0, z), (0, 0, speed))
        if ms % 250 == 0:
            print('z %5.1f mm   force %6.2f N   %s' % (1e3 * z, force_n[2], hand.trouble()), flush=True)

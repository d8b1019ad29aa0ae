# awk -v clamp=N -v guard=N/MS [-v local=1] -f device.awk LOG: what a device (tool_presser.c) gave, by its own log and clock, in numbers:
#
#     ticks N pressed N over_clamp N over_guard N over_slope N after_deadline N     of ticks that break a rule
#     largest F steepest_contact F steepest_transition F                            N; N per ms
#     outages N felt N zero_at N                                                    felt: more than 0.1 N at the last force; ms
#
# In contact a force may differ from the last one by guard per ms since that came, 3 ms at most, for which it may be held. A transition is
# every tick after that (local: from 100 ms on, as long as a contact is good), and every force that says it fades: max(0.5 N, clamp/17)
# per ms, and the ramp of a device that hears again, 1/200 of the clamp. Deadline: 20 ms after the last force 0 N, local 300 ms.
BEGIN {
    FS = ","
    slope = clamp / 17 > 0.5 ? clamp / 17 : 0.5
    deadline = local ? 300 : 20
    eps = 1e-6
}
function norm(x, y, z) { return sqrt(x * x + y * y + z * z) }
function bit(flags, b) { return int(flags / b) % 2 }
{
    size = norm($4, $5, $6)
    ms = NR > 1 ? $1 - tick : 1
    step = NR > 1 ? norm($4 - x, $5 - y, $6 - z) : 0
    silent = $3 > 0 ? 0 : silent + ms # as the watchdog counts
    gap = missing + ms                # since a force was given
    missing = $10 > 0 ? 0 : gap
    fades = bit($8, 4) || bit($8, 64) || bit($8, 1024) # latched, braking, stopping
    transition = local ? silent > 100 : missing > 3 || fades
    ticks += ms
    pressed += size > 0.1
    over_clamp += size > clamp + eps
    after_deadline += silent >= deadline && missing > 0 && size > 0
    if (size > largest) largest = size
    if (transition && silent < deadline) {
        span = missing > 0 ? ms : gap
        over_slope += step > span * slope + clamp / 200 + eps
        if (step / span > steepest_transition) steepest_transition = step / span
    } else if (!transition) {
        span = gap < 3 ? gap : 3
        over_guard += step > span * guard + clamp / 200 + eps
        if (step / span > steepest_contact) steepest_contact = step / span
    }
    if ($3 > 0) { at_last = size; at = -1 }
    if ($3 == 0 && at < 0 && size == 0) at = silent
    if (silent >= deadline && silent - ms < deadline) {
        outages++
        felt += at_last > 0.1
        if (at_last > 0.1 && at > zero_at) zero_at = at
        if (at < 0) zero_at = silent
    }
    tick = $1; x = $4; y = $5; z = $6
}
END {
    printf "ticks %d pressed %d over_clamp %d over_guard %d over_slope %d after_deadline %d\n", ticks, pressed, over_clamp, over_guard, over_slope, after_deadline
    printf "largest %.3f steepest_contact %.3f steepest_transition %.3f\n", largest, steepest_contact, steepest_transition
    printf "outages %d felt %d zero_at %d\n", outages, felt, zero_at
}

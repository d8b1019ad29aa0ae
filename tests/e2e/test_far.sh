#!/usr/bin/env bash
# A simulated device in a hand, closed round a kneadd over LCM with 0, 5 and 20 ms of round trip, and 30 ms with a fifth of
# all lost: with the local model it stays calm pressing, sliding and tapping jelly; with the last force, held for 20 ms, the
# passivity controller alone keeps it so.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
cat >jelly.yaml <<'YAML'
version: 1
object: {size: [5 cm, 5 cm, 3 cm], spacing: 5 mm, structure: diagonals}
material: {variant: viscoelastic, k1: 21.7 kPa, c1: 225 Pa s, damper: none}
density: 1.02 g/cm^3
gravity: 0 m/s^2
support: bonded
device: omega
probes: [{name: finger, shape: sphere, radius: 1.5 cm, coupling: 800 N/m, damping: 2 N*s/m}]
YAML
# the hand's way, which its grip follows by some mm less: press, slide 5 mm, lift, tap twice
awk 'function ramp(t, a, b) { return t < a ? 0 : t > b ? 1 : (t - a) / (b - a) }
    BEGIN {
        print "time_s,x_m,y_m,z_m"
        for (i = 0; i <= 450; i++) {
            t = i / 100
            down = 0.014 * (ramp(t, 0.3, 0.8) - ramp(t, 2.4, 2.8)) + (t < 3.2 || t > 4.2 ? 0 : 0.006 * (1 - cos(12.566 * (t - 3.2))))
            printf "%.2f,%.6f,0,%.6f\n", t, 0.005 * (ramp(t, 1.4, 2.2) - ramp(t, 2.8, 3.2)), 0.051 - down
        }
    }' >way.csv
kneadd --scene jelly.yaml --realtime "$KN_REALTIME" --local-model >kneadd.log 2>kneadd.err &
server=$!
for _ in $(seq 200); do
    grep -q serving kneadd.log && break
    kill -0 $server 2>/dev/null || { echo "FAIL kneadd did not come up:" && cat kneadd.err && exit 1; }
    sleep 0.05
done
# play NAME OPTION...: what it felt into the file NAME, its exit code into code
play() {
    knead probe --path way.csv --hand normal "${@:2}" >"$1" 2>"$1.err"
    code=$?
    grep -E '^  (buzz|energy given|local model)' "$1"
    [ $code != 3 ] || cat "$1.err"
}
felt() { awk -v line="  $1" 'index($0, line) == 1 { sub(line, ""); print $1 }' "$2"; } # felt LINE FILE: its number
damped() { grep -oE 'damped for [0-9]+' "$1" | grep -oE '[0-9]+'; } # damped FILE: ms
below() { awk -v a="$1" -v b="$2" 'BEGIN { exit !(a < b) }'; }
play near
[ $code != 3 ] || { echo "FAIL poses or forces were missing in three tries" && exit 1; }
for delay in 0 5 30 20; do
    lossy=()
    [ $delay != 30 ] || lossy=(--loss 20%)
    play far --local --delay "$delay ms" "${lossy[@]}"
    [ $code != 3 ] || { echo "FAIL poses or forces were missing in three tries" && exit 1; }
    check "$delay ms, local model: calm" [ $code = 0 ]
    check "$delay ms, local model: no more buzz than without a link" \
        below "$(felt buzz far)" "$(awk -v b="$(felt buzz near)" 'BEGIN { print 1.5 * b + 0.02 }')"
    check "$delay ms, local model: the hand gets no more back than it gave" below "$(felt 'energy given' far)" 1
    check "$delay ms, local model: every tick has one" below 2500 "$(felt 'local model' far)"
done
play held --delay '20 ms' --held
[ $code != 0 ] || check "20 ms, last force held: calm by the controller's damping alone" \
    below "$((100 + 3 * $(damped far)))" "$(damped held)"
stop_kneadd
check "kneadd ended well" [ "$status" = 0 ]
exit $failed

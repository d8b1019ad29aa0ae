#!/usr/bin/env bash
# A bad link between kneadd and two devices, in both directions: losses, bursts, jitter, repeats, swaps, flipped bits and all at once; 3 s
# of each (KN_LINK_SECONDS=N for more). What kneadd gives and what the motors give, by the device's own log, keeps the rules of
# core/safety.h; kneadd loses what the link lost; with a key nothing flipped is taken.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
seconds=${KN_LINK_SECONDS:-3}
far=udpm://239.255.76.67:7671?ttl=0
umask 077
head -c 32 /dev/urandom | od -An -tx1 | tr -d ' \n' >key
way() { grep "^$1 " link.txt | grep -oE "$2 [0-9]+" | grep -oE '[0-9]+'; } # way poses|forces NAME
broken() { # broken FILE: how many ticks of it break a rule
    local n sum=0
    for n in over_clamp over_guard over_slope late_zero after_deadline; do
        grep -q "\b$n " "$1" && sum=$((sum + $(number $n "$1")))
    done
    echo $sum
}
# row [key] FAULT=VALUE...: into link.txt, served.txt, near.txt (renders forces), far.txt (the local model), kneadd.log
row() {
    local key=()
    [ "$1" != key ] || { key=(--key key) && export KNEAD_KEY=$PWD/key && shift; }
    start_logger row.lcmlog
    start_kneadd "$KN_SOURCE/tests/e2e/two_fingers.yaml" --local-model "${key[@]}"
    KNEAD_KEY= link 'udpm://239.255.76.67:7667?ttl=0' "$far" 0 1e6 "$@" >link.txt & link=$!
    sleep 0.2
    LCM_DEFAULT_URL=$far presser near "$seconds.4" x=-0.015 >near.csv & near=$!
    sleep 0.3 # the first that is let in has the ticks follow its poses
    LCM_DEFAULT_URL=$far presser far "$seconds" x=0.015 local >far.csv & far_device=$!
    wait $near && wait $far_device || { echo "FAIL a device's log has gaps" && failed=1; }
    stop_kneadd >/dev/null
    kill $link
    wait $link
    stop_logger
    unset KNEAD_KEY
    rules row.lcmlog near 3.3 4 >served.txt
    rules row.lcmlog far 3.3 4 >served_far.txt
    awk -v clamp=3.3 -v guard=4 -f "$KN_SOURCE/tests/tactile/device.awk" near.csv >near.txt
    awk -v clamp=3.3 -v guard=4 -v local=1 -f "$KN_SOURCE/tests/tactile/device.awk" far.csv >far.txt
    logcheck row.lcmlog >health.txt
    rm row.lcmlog
}
missing() { awk -v fresh="$(number fresh served.txt)" -v all="$(number cycles served.txt)" 'BEGIN { print 1 - fresh / all }'; }
# heard SHARE: whether kneadd missed a fresh pose in that share of its ticks, within 1 %, beyond what it misses without a fault: poses that
# a busy machine brings late
heard() { awk -v d="$(missing)" -v base="$base" -v lost="$1" 'BEGIN { d -= base + lost; exit !(d <= 0.01 && d >= -0.01) }'; }
share() { awk -v n="$(way poses "$1")" -v all=$(($(way poses carried) + $(way poses lost))) 'BEGIN { print n / all }'; }
# counts NAME WHAT: whether kneadd's own count of the poses' numbers is what the link did to them, within a tenth of that, and 10 that
# were under way when either began or ended
counts() {
    awk -v n="$(number "$1" health.txt)" -v did="$(way poses "$2")" 'BEGIN { d = n - did; most = 10 + 0.1 * did; exit !(d <= most && d >= -most) }'
}
judge() { # judge NAME
    awk -v name="$1" -v fresh="$(number fresh served.txt)" -v all="$(number cycles served.txt)" -v near="$(number pressed near.txt)" \
        -v far="$(number pressed far.txt)" -v c="$(number steepest_contact near.txt)" -v t="$(number steepest_transition near.txt)" \
        -v lc="$(number steepest_contact far.txt)" -v lt="$(number steepest_transition far.txt)" 'BEGIN {
        printf "%s: fresh in %.2f %% of the ticks; forces: pressed %d ms, at most %.3f N/ms in contact, %.3f else; model: %d ms, %.3f, %.3f\n",
            name, 100 * fresh / all, near, c, t, far, lc, lt }'
    check "$1: kneadd keeps every rule" [ "$(broken served.txt) $(broken served_far.txt)" = "0 0" ] || cat served.txt served_far.txt
    check "$1: and the device that renders forces" [ "$(broken near.txt)" = 0 ] || cat near.txt
    check "$1: and the one with the local model" [ "$(broken far.txt)" = 0 ] || cat far.txt
}
# success NAME WHAT FAULT...: the row once more where the machine has spoilt it
success() {
    local name=$1 what=$2 pause
    shift 2
    for pause in 3 0; do
        row "$@"
        heard "$(share "$what")" && break
        sleep $pause
    done
    judge "$name"
    check "$name: kneadd loses what the link did, $(share "$what"), within 1 %" heard "$(share "$what")" || cat served.txt link.txt
    check "$name: and says so: $(number lost health.txt) lost, $(number in_a_row health.txt) in a row" counts lost lost || cat health.txt link.txt
    check "$name: $(number duplicate health.txt) twice" counts duplicate twice || cat health.txt link.txt
    check "$name: $(number reordered health.txt) swapped" counts reordered swapped || cat health.txt link.txt
}

row
judge "no fault"
base=$(missing)
[ "$(number pressed near.txt)" -gt $((seconds * 250)) ] || { echo "FAIL nothing was pressed" && failed=1; }
for loss in 0.01 0.05 0.2; do success "loss $loss" lost loss=$loss; done
success "bursts of 3" lost loss=0.05 burst=3
success "bursts of 20" lost loss=0.05 burst=20
success "repeats" lost twice=0.01
success "swaps" swapped swap=0.01
row jitter=5
judge "jitter 0 to 5 ms"
check "jitter: told as late, $(number late health.txt), and overtaken, $(number reordered health.txt)" \
    [ "$(number late health.txt)" -gt 0 -a "$(number reordered health.txt)" -gt 0 ]
row flip=0.001
judge "flipped bits, no key"
success "flipped bits, a key" flipped key flip=0.001
check "a key: none of $(way poses flipped) flipped poses was taken" [ "$(counter mac)" = "$(way poses flipped)" ]
check "and every other one" [ "$(counter accepted)" -le $(($(way poses carried) - $(way poses flipped))) ]
row key flip=1
check "a key: where every message is flipped kneadd takes none of $(way poses carried)" [ "$(counter accepted) $(counter mac)" = "0 $(way poses carried)" ]
check "and the device hears none" [ "$(awk -F, '{ n += $3 } END { print n + 0 }' near.csv far.csv)" = 0 ]
row loss=0.05 burst=3 jitter=4 twice=0.01 swap=0.01 flip=0.001
judge "all at once, no key"
row key loss=0.2 burst=20 jitter=4 twice=0.01 swap=0.01 flip=0.001
judge "worse, a key"
exit $failed

#!/usr/bin/env bash
# tests/tactile/test_link.c on a real bus: two devices behind a link that loses, repeats and swaps datagrams, then with
# a key behind one that does everything at once; KN_LINK_SECONDS=N for more than 3 s. Neither kneadd nor a device breaks
# a rule, and KNEAD_HEALTH reports what the link did.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
seconds=${KN_LINK_SECONDS:-3}
far=udpm://239.255.76.67:7671?ttl=0
umask 077
head -c 32 /dev/urandom | od -An -tx1 | tr -d ' \n' >key
way() { grep "^$1 " link.txt | grep -oE "$2 [0-9]+" | grep -oE '[0-9]+'; } # way poses|forces NAME
# row [key] FAULT=VALUE...: into link.txt, served.txt, near.txt (renders forces), far.txt (the local model), kneadd.log
row() {
    local key=()
    [ "$1" != key ] || { key=(--key key) && export KNEAD_KEY=$PWD/key && shift; }
    start_logger row.lcmlog
    start_kneadd "$KN_SOURCE/tests/e2e/two_fingers.yaml" --local-model "${key[@]}"
    KNEAD_KEY= link 'udpm://239.255.76.67:7667?ttl=0' "$far" 0 1e6 "$@" >link.txt & link=$!
    sleep 0.2
    LCM_DEFAULT_URL=$far presser near "$seconds.4" x=-0.015 >near.txt & near=$!
    sleep 0.3 # the ticks follow the poses of the first device that is let in
    LCM_DEFAULT_URL=$far presser far "$seconds" x=0.015 local >far.txt
    wait $near
    stop_kneadd >/dev/null
    kill $link
    wait $link
    stop_logger
    unset KNEAD_KEY
    rules row.lcmlog near 3.3 4 >served.txt
    logcheck row.lcmlog >health.txt
    rm row.lcmlog
    cat link.txt served.txt near.txt far.txt
    check "$*: no rule is broken, by kneadd, a device with forces, one with the local model" \
        [ "$(number broken served.txt) $(number broken near.txt) $(number broken far.txt)" = "0 0 0" ]
}
# counts NAME WHAT: kneadd's own count of the poses' numbers equals what the link did to them, within a tenth of that
# plus 10 that were under way when either began or ended
counts() {
    awk -v n="$(number "$1" health.txt)" -v did="$(way poses "$2")" 'BEGIN { d = n - did; most = 10 + 0.1 * did; exit !(d <= most && d >= -most) }'
}

row loss=0.05 burst=3 twice=0.01 swap=0.01
check "the device was pressed" [ "$(number pressed near.txt)" -gt $((seconds * 250)) ]
check "kneadd tells of $(number lost health.txt) lost" counts lost lost
check "of $(number duplicate health.txt) that came twice" counts duplicate twice
check "of $(number reordered health.txt) swapped" counts reordered swapped
row key loss=0.2 burst=20 jitter=4 twice=0.01 swap=0.01 flip=0.001
check "a key: none of $(way poses flipped) flipped poses was taken" [ "$(counter accepted)" -le $(($(way poses carried) - $(way poses flipped))) ]
check "each is counted" [ "$(counter mac)" = "$(way poses flipped)" ]
exit $failed

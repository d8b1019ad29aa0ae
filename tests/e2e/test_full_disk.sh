#!/usr/bin/env bash
# kneadd --state-dir on a disk that is full for a while, under a hand that presses. Every failed save is counted once.
# It is reported in at most one line a second, and the numbers of these lines add up. The servo ticks on, saved files
# stay, and saving resumes by itself once there is room.
if [ "$1" != inside ]; then # mounts disappear with the namespace
    unshare -m mount -t tmpfs none "$PWD" 2>/dev/null || { echo "skipped: no file system may be mounted here"; exit 77; }
    exec unshare -m "$0" inside
fi
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
look() { ctl --json status >"$1.json"; }
# of NAME EXPRESSION: evaluate an expression on the status NAME.json
of() { python3 -c 'import json, sys; print(eval(sys.argv[2], json.load(open(sys.argv[1] + ".json"))))' "$1" "$2"; }
grown() { echo $(($(of "$2" "$3") - $(of "$1" "$3"))); }
files() { find kept -name '*.knead' -printf '%f %s %T@\n' | sort; }
mkdir kept && mount -t tmpfs -o size=1m,mode=700 none kept || exit 77
start_logger disk.lcmlog
start_kneadd dough-small.yaml --control control --state-dir kept
kneader finger & hand=$!
until_saves() { # until_saves NAME SINCE: take statuses until two more saves succeeded
    for ((tries = 0; tries < 300; tries++)); do
        look "$1"
        [ "$(grown "$2" "$1" 'state["snapshots"]')" -lt 2 ] || break
        pause 0.4
    done
}
pause 1
look begin
until_saves well begin
dd if=/dev/zero of=kept/fill bs=4k 2>/dev/null
# until a save has met the full disk, and no save begun before that is under way
for ((tries = 0; tries < 50; tries++)); do
    ctl snapshot >/dev/null 2>&1 || break
done
look full
files >files.full
for n in 1 2 3 4 5; do ctl snapshot >"asked.$n" 2>&1; echo $? >>"asked.$n"; done
for ((tries = 0; tries < 300; tries++)); do # the server's own saves must fail too
    look fuller
    [ "$(of fuller '"snapshot_error" in current_errors')" = False ] || # the errors of the newest status
        [ "$(grown full fuller 'state["snapshot_errors"]')" -lt 8 -o "$(of fuller 'state["snapshot_age_ms"]')" -lt 3500 ] || break
    pause 0.1
done
files >files.fuller
rm kept/fill
until_saves again fuller
until_saves later again
pause 2.2 # time for a status, which comes once a second
kill $hand
stop_kneadd
stop_logger
logcheck disk.lcmlog | tee disk.txt
cat kneadd.err

check "with room on the disk there are $(grown begin well 'state["snapshots"]') saves and no error" \
    [ "$(grown begin well 'state["snapshots"]')" -ge 2 -a "$(of well 'state["snapshot_errors"]')" = 0 ]
check "on a full disk $(grown full fuller 'state["snapshot_errors"]') saves failed and none succeeded" \
    [ "$(grown full fuller 'state["snapshot_errors"]')" -ge 8 -a "$(grown full fuller 'state["snapshots"]')" = 0 ]
check "the earlier snapshots are kept" diff files.full files.fuller
check "each snapshot command gets the error: $(head -1 asked.1)" [ "$(cat asked.* | grep -c 'No space left on device')" = 5 ]
check "each failed snapshot command exits with 2" [ "$(grep -cx 2 asked.1 asked.2 asked.3 asked.4 asked.5 | grep -c ':1$')" = 5 ]
check "the status names the error: $(of fuller current_errors), and keeps it as the last error: $(of later last_errors)" \
    [ "$(of fuller '"snapshot_error" in current_errors') $(of later 'not {"snapshot_error", "comm_lost"}.isdisjoint(last_errors)')" = "True True" ]
check "$(of fuller 'state["snapshot_age_ms"]') ms without a snapshot are shown in the status" [ "$(of fuller 'state["snapshot_age_ms"]')" -ge 3500 ]
ms() { echo $(($(grown "$1" "$2" monotonic_us) / 1000)); }
ran() { echo $(($(grown "$1" "$2" tick) - $(grown "$1" "$2" 'loop["missed_cycles"]'))); }
check "the servo keeps ticking: $(ran full fuller) ticks in $(ms full fuller) ms; before $(ran begin well) in $(ms begin well)" \
    [ $((2 * $(ran full fuller))) -gt "$(ms full fuller)" ]
late() { echo $(($(grown "$1" "$2" 'loop["missed_cycles"]') - $(grown "$1" "$2" 'loop["missed_explained"]'))); }
[ -z "${KN_NIGHT:-}" ] ||
    check "the servo misses no more ticks than before: $(late full fuller) in $(ms full fuller) ms that are not the machine's, $(late begin well) in $(ms begin well) before" \
        [ "$(late full fuller)" -le $((2 * $(late begin well) + 40)) ]
check "poses are still accepted: $(grown full fuller 'link["accepted"]')" [ "$(grown full fuller 'link["accepted"]')" -gt 1000 ]
errors=$(of later 'state["snapshot_errors"]')
check "with room again kneadd saves by itself without errors" \
    [ "$(grown fuller later 'state["snapshots"]')" -ge 2 -a "$(grown again later 'state["snapshot_errors"]')" = 0 ]
check "the error is no longer current: $(of later current_errors)" [ "$(of later '"snapshot_error" in current_errors')" = False ]
lines=$(grep -c 'was not saved' kneadd.err)
check "$lines messages, at most one a second, in $(ms well again) ms" [ "$lines" -ge 3 -a "$lines" -le $(($(ms well again) / 1000 + 2)) ]
told=$(grep -oE '\([0-9]+ (more )?failed\)' kneadd.err | grep -oE '[0-9]+' | awk '{ n += $1 } END { print n + 0 }')
check "the messages count each of the $errors errors once" [ "$told" = "$errors" ]
check "the summary counts all errors" [ "$(counter 'saves failed')" = "$errors" ]
check "KNEAD_HEALTH came with every KNEAD_STATUS" \
    [ "$(number healths disk.txt)" -ge 10 -a "$(number paired disk.txt)" = "$(number healths disk.txt)" ]
check "the health message has the newest generation" [ "$(number generation disk.txt)" -ge "$(of later 'state["snapshot_gen"]')" ]
check "KNEAD_STATUS carries the error" [ $(($(number ever_errors disk.txt) & 256)) = 256 ]
start_kneadd dough-small.yaml --control control --state-dir kept
stop_kneadd
check "the next start restores the last snapshot: $(grep restored kneadd.log)" grep -q '^kneadd: restored kept/' kneadd.log
exit $failed

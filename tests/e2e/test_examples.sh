#!/usr/bin/env bash
# Every example of every --help is run as it stands: the lines below "Examples:", in one folder, so that a line may use what
# an earlier one made. Beside them runs the kneadd of the last example of kneadd. The man pages that are made of the same
# texts have no errors.
# night: fits, sweeps and measurements of some minutes
source "$KN_SOURCE/tests/e2e/kneadd.sh"
export KNEAD_CONTROL=control
examples() { "$@" --help | sed -n '/^Examples:$/,/^$/s/^    //p'; }
# served WORD LINE: start a program that runs until a signal; it prints WORD and ends with 0
served() {
    : >served.log # otherwise the words of the program before could be read
    bash -c "exec $2" >served.log 2>&1 &
    await has "$1" served.log || cat served.log
    kill -TERM $!
    check "$2" ended $!
}
# run CODES LINE: run an example, which must end with one of these exit codes
run() {
    local begun=$SECONDS code
    bash -c "$2" >run.log 2>&1 </dev/null
    code=$?
    check "$2 ($((SECONDS - begun)) s)" eval "[[ ' $1 ' == *' $code '* ]]" || { echo "     exit $code" && tail -n 5 run.log; }
}
try() { # try LINE
    case $1 in
    kneadd*) served serving "$1" ;;
    knead-simdev*) served : "$1" ;;
    'knead web'*) served http:// "$1" ;;
    'knead hand'*) run '3 124' "timeout 5 $1" ;; # the only examples that cannot succeed: there is no device
    'knead doctor'* | 'knead latency') run '0 1' "$1" ;; # their verdict is on this machine
    *) run 0 "$1" ;;
    esac
}
all() { # all PROGRAM...
    local lines line
    mapfile -t lines < <(examples "$@")
    check "$* has examples" [ ${#lines[@]} -gt 0 ]
    for line in "${lines[@]}"; do try "$line"; done
}
cp "$KN_SOURCE/tests/clients/surfaces/block-binary.stl" block.stl
all knead demo
all kneadd
all knead-simdev
: >kneadd.log
bash -c "exec $(examples kneadd | tail -n 1)" >kneadd.log 2>kneadd.err & server=$!
await has serving kneadd.log || cat kneadd.err
for name in probe replay view; do all knead $name; done

# gauge.csv: a press of the finger as a force gauge records it.
knead ctl reset >reset.log
knead probe --quiet --probe finger --depth '4 mm' --speed '5 mm/s' --hold '1 s' --csv finger.csv >finger.log 2>&1 || cat finger.log
awk -F, 'NR == 1 { print "time (s),force (N),depth (mm)" }
    NR > 1 && $6 < 0.045 { if (!n++) at = $2; if (n % 20 == 1) printf "%.3f,%.5g,%.4f\n", $2 - at, $9, 1e3 * (0.045 - $6) }' finger.csv >gauge.csv
knead ctl reset >reset.log
knead probe --quiet --hold '60 s' >hand.log 2>&1 & hand=$! # knead touch shows its contact
patience=1 await knead touch --once >touch.log 2>&1 || cat touch.log hand.log
all knead touch
kill $hand
wait $hand

for name in creep relax sweep press shape; do all knead identify $name; done
for name in $(knead --help | sed -n 's/^  \([a-z]*\) .*/\1/p'); do
    case $name in demo | probe | replay | view | touch) ;; *) all knead "$name" ;; esac
done
all knead
kill -TERM $server
check "the kneadd beside the examples ends with 0" ended $server

pages=0
for page in "$KN_BUILD"/man/man?/*; do
    pages=$((pages + 1))
    man --warnings -E UTF-8 -l -Tutf8 -Z "$page" 2>&1 >page.out | head -n 3 >warnings
    check "${page##*/} is a man page without warnings" [ ! -s warnings ] || cat warnings
done
check "every command has a man page" [ $pages = $(($(knead --help | grep -c '^  [a-z]') + $(knead identify --help | grep -c '^  [a-z]') + 4)) ]
exit $failed

#!/usr/bin/env bash
# A block of two resolutions is served, pressed, and replays to the bit; played on its uniform lattice the press is what
# the scene says it is, and a box that is too small is found out.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
fine=$KN_SOURCE/core/scenes/dough-fine.yaml
small=(--set object.size='[3 cm, 3 cm, 1.8 cm]' --set probes.spatula.reach='[-1 mm, 1 mm, -1 mm, 1 mm]')

start_kneadd dough-fine.yaml "${small[@]}"
press --depth '4 mm' --hold '200 ms' --record press.lcmlog
stop_kneadd >/dev/null
check "it replays to the bit" knead replay press.lcmlog --verify
knead check "$fine" "${small[@]}" --log press.lcmlog >kept
check "the press keeps the accuracy" [ $? = 0 ]
check "and says so" grep -q '^accuracy  force 0\.[0-9]* % off the uniform lattice, 1 % asked: kept' kept
cat kept
knead check "$fine" "${small[@]}" --set object.margin='0.1 mm' --log press.lcmlog >missed
check "a box that is too small does not" [ $? = 1 ]
check "and says what may help" grep -q 'a larger object.margin' missed
knead check "$fine" --log press.lcmlog 2>refused
check "a log of another scene is refused" [ $? = 2 ]
check "in one line" [ "$(wc -l <refused)" = 1 ]
exit $failed

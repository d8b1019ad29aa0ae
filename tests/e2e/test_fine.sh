#!/usr/bin/env bash
# A block of two resolutions is served. A press of the block replays to the bit. On the uniform lattice the press is
# as accurate as the scene states, and a box that is too small is found out.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
fine=$KN_SOURCE/core/scenes/dough-fine.yaml
size='object.size=[3 cm, 3 cm, 1.8 cm]' reach='probes.spatula.reach=[-1 mm, 1 mm, -1 mm, 1 mm]'
small=(--set "$size" --set "$reach")

start_kneadd dough-fine.yaml "${small[@]}"
stop_kneadd
pressed "$fine" press.lcmlog 6 "$size" "$reach"
check "a press on two resolutions replays to the bit" knead replay press.lcmlog --verify 2>warned
check "the replay prints no warning" [ ! -s warned ]
knead check "$fine" "${small[@]}" --log press.lcmlog >kept
check "the press meets the requested accuracy" [ $? = 0 ]
check "knead check reports the accuracy" grep -q '^accuracy  force 0\.[0-9]* % off the uniform lattice, 1 % asked: kept' kept
cat kept
beside=("${small[@]}" --set probes.spatula.reach='[1 mm, 2 mm, -2 mm, 2 mm]')
knead check "$fine" "${beside[@]}" --set object.margin='0.1 mm' --log press.lcmlog >missed
check "a fine box that is too small misses the accuracy" [ $? = 1 ]
check "knead check names a remedy" grep -q 'a larger object.margin' missed
outside='spatula pressed up to 1 mm outside its reach, for [0-9]+ ms in all, where the cells are coarse'
check "a hand that leaves the reach gets a warning" grep -qE "^warning   $outside$" missed
check "a hand within the reach gets no warning" eval '! grep warning kept'
knead replay "$fine" press.lcmlog "${beside[@]}" >replayed 2>warned
check "a replay of a hand outside the reach warns in one line" eval '[ $(wc -l <warned) = 1 ] && grep -qE ": press.lcmlog: $outside$" warned'
refuses() { expect "^knead check: $1$" 2 knead check "$fine" "${@:2}"; } # refuses LINE OPTION...
another="press.lcmlog: was recorded with another scene, 'dough-fine.yaml', expected one of dough-fine.yaml"
refuses "$another" --log press.lcmlog
refuses "$another" --set density='2 g/cm^3' --log press.lcmlog
head -c 100000 press.lcmlog >cut.lcmlog
refuses 'cut.lcmlog: .*, expected a whole log of one run' "${small[@]}" --log cut.lcmlog
exit $failed

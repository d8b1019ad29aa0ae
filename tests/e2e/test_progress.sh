#!/usr/bin/env bash
# Long commands show a bar on a terminal (script(1)'s), and no bar elsewhere. The line of the bar is empty when
# another message is printed.
. "$KN_SOURCE/tests/e2e/kneadd.sh"
pressed "$KN_SOURCE/core/scenes/dough-small.yaml" press.lcmlog || exit 70
# bar NAME COMMAND...
bar() {
    local name=$1
    shift
    script -qec "$*" seen </dev/null >/dev/null
    "$@" >plain 2>plain.err </dev/null
    check "$name has a bar on a terminal" grep -qaE $'\r'"$name"'[a-z ]*  \[#* *\] +[0-9]+ %' seen
    check "$name has no bar without a terminal" eval '! grep -qa " %  \|\[#*  *\]" plain.err'
    # The final text of each line of a terminal: the text after its last carriage return but one.
    check "the bar of $name is erased afterwards" eval '! sed "s/\r$//; s/.*\r//" seen | grep -qa "\[#* *\]"'
}
bar creep knead creep dough --lattice 3x3x3 --hold 60 --rest 60
bar replay knead replay press.lcmlog
bar export knead export press.lcmlog --csv press.csv
if [ -n "${KN_NIGHT:-}" ]; then
    bar relax knead relax dough --lattice 3x3x3 --ramp 10%/s --hold 60
    bar stability knead stability --quick --family bar
    bar zwidth knead zwidth --quick
    bar tradeoff knead tradeoff "$KN_SOURCE/core/scenes/dough-small.yaml" press.lcmlog --quick --solver blend --iterations 4 --precision f32
fi
exit $failed

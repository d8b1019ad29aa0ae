#!/usr/bin/env bash
# knead completion as a shell uses it: the function that `complete -F` names, called with COMP_WORDS in a real bash.
# The completion offers everything that --help lists, for every program.
# gate in release: some six hundred programs are started, which the sanitizers make three times as slow
source "$KN_SOURCE/tests/e2e/kneadd.sh" # defines check
source <(knead completion)
# completed WORD...: print the completions on one line. The last WORD is the one being typed.
completed() {
    local function
    function=$(complete -p "${1##*/}" | sed 's/.*-F \([^ ]*\) .*/\1/')
    COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
    "$function" 2>err
    echo "${COMPREPLY[*]}"
}
is() { # is "EXPECTED" WORD...
    local got
    got=$(completed "${@:2}")
    check "${*:2} -> $1" [ "$got" = "$1" ] || echo "     it was: $got"
}
is "replay" knead rep
is "completion" knead comp
is "help" knead hel
is "replay" knead help rep
is "creep" knead help identify cr
is "batch" knead ba
is "--help" knead --h
is "--verify --version" knead replay --ver
is "fixed" knead replay --solver fi
is "blend fixed implicit rk4 secant tangent" knead replay --solver ""
is "stress" knead view --color s
is "displacement residual stress" knead view --color ""
is "end" knead export --at ""
is "end" knead view --at e
is "bash zsh" knead completion ""
is "gmsh tetgen" knead mesh --tool ""
is "poke press sine" knead probe --path ""
is "set snapshot status stop" knead ctl --json s
is "auto off require" kneadd --realtime ""
is "auto off require" kneadd --realtime = ""
is "fixed" kneadd --backend fi
is "--uart" knead-simdev --ua
is "solver.iterations= solver.iterations_max=" knead check scene.yaml --set solver.it
is "material.k1=" knead ctl set material.k1
is "paddle" knead hand pa
is "creep" knead identify cr
is "--release --report" knead identify creep --re
is "" knead nosuch --
touch dough.yaml "two words.yaml" && mkdir scenes
is "dough.yaml" knead check do
is "dough.yaml" knead view --scene do
is "two words.yaml" knead check two
is "scenes" knead view --scene sc
touch -- '$(touch run)'
completed knead '$(touch run)' "" >/dev/null
completed knead check '$(touch' >/dev/null
check "typed words are never executed" [ ! -e run ]

# Find every option of every help by other means: words with two dashes in a line that begins with one, before its
# explanation.
programs=(kneadd knead-simdev)
for name in $(knead --help | sed -n 's/^  \([a-z]*\) .*/\1/p'); do programs+=("knead $name"); done
for name in $(knead identify --help | sed -n 's/^  \([a-z]*\) .*/\1/p'); do programs+=("knead identify $name"); done
options=0
for program in "${programs[@]}"; do
    offered=" $(completed $program --) "
    for option in $($program --help | sed -n 's/^ \+\(-.*\)/\1/p' | sed 's/  .*//' | grep -oE -- '--[a-z-]+'); do
        options=$((options + 1))
        [[ $offered == *" $option "* ]] || { echo "FAIL $program: $option is not completed" && failed=1; }
    done
done
check "completion offers all $options options of ${#programs[@]} help texts" [ $options -gt 150 ]
prefix=$PWD/prefix
cmake --install "$KN_BUILD" --prefix "$prefix" >install.log
for program in knead kneadd knead-simdev; do
    check "the installed completion of $program is the output of knead completion" cmp -s "$prefix/share/bash-completion/completions/$program" <(knead completion)
done
check "completion writes nothing to stderr" [ ! -s err ]
exit $failed

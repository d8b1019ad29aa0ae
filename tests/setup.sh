# Functions shared by tests/run and server/run: announce the changes to this machine, ask once, install and build.
# Sourced by bash.
#
#     setup_missing run|gate|night   print the missing packages of tests/packages for this purpose and the earlier ones
#     setup_consent YES LINE...  show the lines. YES=1 goes on, a terminal is asked, anything else exits 2
#     setup_install NAME...      install as root or through sudo; otherwise print the commands and exit 3
#     setup_pace WHAT [pass]     read lines, print them if `pass` is given; after 4 s without a line say that WHAT goes on
#     setup_build PRESET [TARGET...]  configure and build into build/PRESET; print the compiler's output only on failure

setup_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

setup_packages() {
    local purposes=run
    [ "$1" = run ] || purposes="run|gate"
    [ "$1" != night ] || purposes="run|gate|night"
    awk -v purposes="^($purposes)$" -v release="$(. /etc/os-release && echo "${VERSION_CODENAME-}")" '
        $1 == "#" && $2 == release { called[$3] = $4 }
        $2 == "#" && $3 ~ purposes && called[$1] != "-" { print called[$1] ? called[$1] : $1 }' "$setup_root/tests/packages"
}

setup_missing() {
    command -v dpkg-query >/dev/null || return 0 # not Debian: cmake will name any missing package
    mapfile -t wanted < <(setup_packages "$1")
    printf '%s\n' "${wanted[@]}" | grep -vxFf <(dpkg-query -W -f '${db:Status-Abbrev}${Package}\n' "${wanted[@]}" 2>/dev/null | sed -n 's/^.i. *//p')
}

setup_consent() {
    local yes=$1 answer
    shift
    [ $# -gt 0 ] || return 0
    printf '%s\n' "$@"
    [ "$yes" = 1 ] && return 0
    if [ ! -t 0 ] || [ ! -t 1 ]; then
        echo "no terminal to ask for consent: run again with --yes to agree"
        exit 2
    fi
    read -r -p "Go on? [y/N] " answer
    [[ $answer == [yY]* ]] || exit 2
}

setup_pace() {
    local what=$1 pass=${2-} start=$SECONDS told=$SECONDS line='' part='' count='' code
    while :; do
        code=0
        IFS= read -r -t 1 part || code=$?
        line+=$part
        if [ $code = 0 ]; then
            [[ $line != \[*\]* ]] || count=" ${line%%]*}]" # how far ninja and make are
            [ -z "$pass" ] || { printf '%s\n' "$line" && told=$SECONDS; }
            line=
        elif [ $code -le 128 ]; then # the end, not a second without a line
            [ -z "$pass$line" ] || printf '%s' "$line"
            return
        fi
        [ $((SECONDS - told)) -lt 3 ] || { echo "$what$count: $((SECONDS - start)) s" && told=$SECONDS; }
    done
}

setup_install() {
    [ $# -gt 0 ] || return 0
    local as=()
    if [ "$(id -u)" != 0 ]; then
        if command -v sudo >/dev/null && { sudo -n true 2>/dev/null || { [ -t 0 ] && sudo -v; }; }; then
            as=(sudo)
        else
            printf 'packages are missing, and this user is not root and may not use sudo. As root:\n'
            printf '    apt-get update\n    apt-get install -y --no-install-recommends %s\n' "$*"
            exit 3
        fi
    fi
    local apt=("${as[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -o Dpkg::Use-Pty=0)
    (set -o pipefail
        "${apt[@]}" update </dev/null | setup_pace "apt-get update" &&
            "${apt[@]}" install -y --no-install-recommends "$@" </dev/null | setup_pace "apt-get install" pass) ||
        { echo "apt could not install: $*" && exit 3; }
}

setup_build() {
    local preset=$1 log=$setup_root/build/$1/build.log
    shift
    mkdir -p "${log%/*}"
    # cmake reads these settings when it first sees a build folder, and keeps them
    ! command -v ninja >/dev/null || export CMAKE_GENERATOR=Ninja
    # paths relative to the source tree, so that another clone finds the same objects
    if command -v ccache >/dev/null; then
        export CMAKE_C_COMPILER_LAUNCHER=ccache OBJCACHE=ccache CCACHE_BASEDIR=$setup_root CCACHE_NOHASHDIR=1 CCACHE_DEPEND=1
    fi
    (set -o pipefail && cd "$setup_root" && { cmake --preset "$preset" -DKNEAD_RTL="${KN_RTL:-ON}" &&
        cmake --build --preset "$preset" -j "$(nproc)" ${1+--target "$@"}; } </dev/null 2>&1 | tee "$log" |
        setup_pace "building into build/$preset") && return 0
    cat "$log"
    return 1
}

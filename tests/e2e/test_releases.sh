#!/usr/bin/env bash
# README's two commands on a fresh Debian 13 and Ubuntu 24.04: server/run whole; of tests/run all packages, the build release,
# and its unit and golden tests. Not played there: the build checked, physics, end-to-end tests and the night.
# night: a root of each release is made, and all is built in it
source "$KN_SOURCE/tests/e2e/clean_root.sh" || exit 70

# silence FILE: write the lines that are read to FILE, and print the longest time between two of them
silence() {
    local most=0 last=${EPOCHREALTIME/./} now line
    while IFS= read -r line; do
        now=${EPOCHREALTIME/./}
        ((now - last <= most)) || most=$((now - last))
        last=$now
        echo "$line"
    done >"$1"
    echo "     the longest silence: $((most / 1000)) ms"
}
played=0
# play RELEASE [OPTION|MIRROR...]
play() {
    rm -rf root
    echo "$1" && make_root "$@" || { echo "     not played: no mirror of $1 is within reach" && return; }
    played=1
    git clone -q --depth 1 "file://$KN_SOURCE" root/knead
    took "a root"
    network=$outside inside sh -c 'cd /knead && exec server/run --yes --once' 2>&1 </dev/null | silence run.log
    check "server/run --yes --once installs, builds and presses" [ ${PIPESTATUS[0]} = 0 ] || { tail -n 50 run.log && return; }
    sed -n '/a virtual hand/,$p' run.log
    took "server/run"
    check "the press has its table" grep -qE '^ +peak +[0-9.]+ N' run.log
    check "$(inside gcc --version | head -n 1) has no warning" sh -c '[ -s root/knead/build/release/build.log ] && ! grep warning: root/knead/build/release/build.log'
    network=$outside inside bash -c 'cd /knead && source tests/setup.sh && setup_install $(setup_missing gate)' >apt.log 2>&1
    check "the packages of tests/run are installed" [ $? = 0 ] || { tail -n 20 apt.log && return; }
    took "packages"
    inside sh -c 'cd /knead && exec ctest --test-dir build/release -j $((4 * $(nproc))) --output-on-failure -L "unit|golden" -LE night' >tests.log 2>&1
    check "unit and golden tests pass" [ $? = 0 ] || grep -vE ' Start |   Passed ' tests.log
    sed -n '/tests passed/p; /did not run/,/^$/p' tests.log
    took "tests"
}

play trixie
# Debian 12 has no package of Ubuntu's keys; without them the mirror is trusted
[ -e /usr/share/keyrings/ubuntu-archive-keyring.gpg ] && trusted= || trusted='[trusted=yes] '
play noble --include=apt "deb ${trusted}http://archive.ubuntu.com/ubuntu noble main universe"
[ $played = 1 ] || skip "no mirror is within reach"
exit $failed

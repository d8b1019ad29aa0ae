#!/usr/bin/env bash
# The command line of `knead`: help for newcomers, one line for every mistake, and the promised exit codes.
# gate in release: many runs of programs that start slowly with the sanitizers
set -u
source "$KN_SOURCE/tests/clients/refuses.sh"

knead --help >help || fail "knead --help: exit $?"
for name in $(sed -n 's/^  \([a-z]*\) .*/\1/p' help); do
    knead "$name" --help >out 2>err || fail "knead $name --help: exit $?"
    grep -q "^usage: knead $name" out || fail "knead $name --help does not begin with its usage"
    [ ! -s err ] || fail "knead $name --help: something on stderr"
    [ "$(knead "$name" --version)" = "$(knead --version)" ] || fail "knead $name --version"
done
grep -q '^  probe ' help || fail "knead --help does not list probe"
for command in "knead --help" "knead --version" "knead check --keys" "knead check $KN_SOURCE/core/scenes/dough.yaml" "kneadd --help"; do
    $command >/dev/full 2>err
    got=$?
    [ $got -eq 3 ] && [ "$(wc -l <err)" -eq 1 ] || fail "$command on a full disk: exit $got, $(cat err)"
done
knead >out 2>err && fail "knead without a command: exit 0"
[ -s err ] && [ ! -s out ] || fail "knead without a command: help belongs on stderr"

begins 2 'knead: no command `need`' knead need
begins 2 'knead: no command `need`' knead need --version
begins 2 "knead probe: --depth 10: expected something like '10 mm'" knead probe --depth 10
begins 2 "knead probe: --depth 5 s: expected something like '10 mm'" knead probe --depth '5 s'
begins 2 "knead probe: --depth 0 mm: expected" knead probe --depth '0 mm'
begins 2 "knead probe: --speed -1 cm/s: expected" knead probe --speed '-1 cm/s'
begins 2 "knead probe: --hold 1e999 s: expected" knead probe --hold '1e999 s'
begins 2 "knead probe: --drop-at: expected two times" knead probe --drop-at 1.5
begins 2 "knead probe: --drop-at 0.9:60: expected two times" knead probe --drop-at 0.9:60
begins 2 "knead probe: --tries 4: expected 1 to 3" knead probe --tries 4
begins 2 'knead probe: `press`: expected options only' knead probe press
begins 2 'knead probe: --wood: unknown option' knead probe --wood
begins 2 'knead probe: --hold: expected a value' knead probe --hold
begins 2 'kneadd: --backend paper: expected cpu, fixed, uart:, pty:, pcie: or shm:' kneadd --backend paper
for command in kneadd 'knead '{probe,hand,view,web,touch,ctl,replay}; do
    for n in 10 15 30; do begins 3 "$command: Too many open files: " bash -c "ulimit -n $n; exec $command"; done
done
small=$KN_SOURCE/core/scenes/dough-small.yaml
begins 2 "$small: --local-model: expected solver.kind implicit" kneadd "$small" --local-model --set solver.kind=rk4 --set solver.dt='0.1 us'
[ "$(kneadd --version)" = "kneadd $(knead --version | cut -d' ' -f2)" ] || fail "kneadd --version: $(kneadd --version)"
begins 2 'knead probe: --loss 1: expected a share below 1' knead probe --loss 1
begins 2 'knead probe: --delay 1.5 ms: expected whole milliseconds, at most 255' knead probe --hand light --delay '1.5 ms'
begins 2 'knead probe: --hand strong: expected none, light, normal or firm' knead probe --hand strong
begins 2 'knead probe: --axes 2: expected 1 or 3' knead probe --axes 2
begins 2 'knead probe: --held with --local' knead probe --hand light --local --held
for alone in --device=touch --axes=1 --delay=0.001 --local --held --loss=0.1; do
    begins 2 "knead probe: ${alone%%=*}: expected --hand as well, because the option is for a simulated device" knead probe $alone
done
begins 2 'knead web: --port 70000: expected a port, 0..65535' knead web --port 70000
begins 2 'knead web: --listen-fd 0: expected a listening socket' knead web --listen-fd 0
begins 2 'knead web: page: expected an option' knead web page
begins 2 'knead probe: --path nope: expected press, sine, poke or a CSV file (No such file or directory)' knead probe --path nope
printf 'time_s,x_m,y_m,z_m\n0,0,0,0.05\n1,0,zero,0.05\n' >bad.csv
begins 2 'bad.csv:3:5: expected a finite number' knead probe --path bad.csv

# A scene is a file, or the name of a scene that comes with Knead. A material comes before a scene of the same name.
begins 2 'kneadd: --scene is now kneadd SCENE' kneadd --scene dough
begins 2 "kneadd: duogh: expected a scene file or a scene's name: bun, clay, dough-diagonals, " kneadd duogh
begins 2 'knead zwidth: --scene duogh: expected a scene file' knead zwidth --hand light --scene duogh
knead check duogh 2>&1 | grep -q '; did you mean dough?$' || fail "a misspelt scene has no suggestion"
[ "$(knead check dough-small --text)" = "$(knead check "$small" --text)" ] || fail "knead check finds no scene by its name"
[[ $(knead creep bun) == *' bun.yaml: '* && $(knead creep jelly) == *' jelly: '* ]] || fail "knead creep: bun is a scene, jelly a material"
cp "$small" jelly
[ "$(knead check jelly --text)" = "$(knead check "$small" --text)" ] || fail "a file comes before a scene of that name"
mkdir mine && cp "$small" mine/block.yaml
knead check block >/dev/null 2>&1 && fail "block is no scene of Knead"
KNEAD_SCENES=mine knead check block >/dev/null || fail "KNEAD_SCENES is not read"

# tradeoff checks the scene, the log and the lists before it plays anything.
begins 2 'knead tradeoff: expected SCENE LOG' knead tradeoff
begins 2 'nope.yaml:1:1: No such file or directory, expected a scene file' knead tradeoff nope.yaml nope.lcmlog
begins 2 'knead tradeoff: nope.lcmlog: No such file or directory, expected a log' knead tradeoff "$KN_SOURCE/core/scenes/dough-small.yaml" nope.lcmlog
begins 2 'knead tradeoff: nope.lcmlog: ' knead tradeoff --job nope.trace "$small" nope.lcmlog

# A malformed backend URI is bad input, found before a log or a scene is read. A missing device is a failure of the
# machine.
for uri in uart: uart:ttyUSB0 'uart:/dev/null?baud=x' pty: pcie:../../x shm:a/b; do
    begins 2 "kneadd: --backend $uri: expected uart:/dev/NAME" kneadd nope.yaml --backend "$uri"
    begins 2 "knead replay: --backend $uri: expected uart:/dev/NAME" knead replay --backend "$uri" nope.lcmlog
done
begins 2 'kneadd: --backend baud=3000001: expected 9600' kneadd nope.yaml --backend 'uart:/dev/null?baud=3000001'
for uri in uart:/dev/null uart:/dev/ttyNONE shm:knead-test-none; do
    kneadd "$KN_SOURCE/core/scenes/dough-small.yaml" --realtime off --backend "$uri" >out 2>err
    got=$?
    [ $got = 3 ] && [ "$(wc -l <err)" -eq 1 ] || fail "kneadd --backend $uri: exit $got, $(cat err)"
done

# A bus URL of another kind is bad input. A bus that would leave the machine is a failure of the machine, found before
# joining.
begins 2 'knead probe: tcpq://127.0.0.1:7700: expected udpm://GROUP:PORT' knead probe --lcm-url tcpq://127.0.0.1:7700
begins 2 'knead probe: file://x: expected udpm://GROUP:PORT' env LCM_DEFAULT_URL=file://x knead probe
ip route del 224.0.0.0/4 dev lo
begins 3 'knead probe: udpm://239.255.76.67:7667?ttl=0: the multicast group is not routed' knead probe

exit $failed

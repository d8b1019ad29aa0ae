# What knead demo does. $0: the program knead. Arguments: SCENE OUT ONCE INSIDE, then options of kneadd and knead check.
set -u
bin=${0%/*} scene=$1 out=$2 once=$3 inside=${KNEAD_DEMO_INSIDE:-0} # 1: started again by this script, in a namespace
shift 3
options=("$@")
results=(press.lcmlog press.csv press.png dent.png)
group=239.255.76.67 # LCM's; poses, forces and status on port 7667, meshes on 7668
mkdir -p "$out" && out=$(realpath "$out") || exit 3
control=$out/control
[ ${#control} -le 107 ] || control=$(mktemp -d)/control # a socket's path can be no longer

# Joining the group must not leave this machine, so the group is routed to lo. Whoever may not add that route gets a network
# namespace that exists only while the demo runs.
make_network() {
    local again=(env KNEAD_DEMO_INSIDE=1 "$0" demo "$scene" --out "$out" "${options[@]}") flags=-rn
    ! ip -4 route get "$group" 2>/dev/null | grep -q ' dev lo ' || return 0
    if ip route add "$group/32" dev lo 2>/dev/null; then
        route_added=1
        echo "network: while this runs, $group/32 is routed to lo, so that no message leaves this machine"
        return 0
    fi
    [ "$(id -u)" = 0 ] && unshare -n true 2>/dev/null && flags=-n
    if ! unshare $flags ip link set lo up 2>/dev/null; then
        echo "knead demo: this user may neither add a route nor open a network namespace (unshare $flags). As root:" >&2
        echo "    ip route add $group/32 dev lo" >&2
        exit 3
    fi
    echo "network: a namespace of its own (unshare $flags), since this user may not add the route $group/32 dev lo"
    [ $flags = -n ] || echo "         in there the kernel grants no real-time priority; ticks that come late are counted"
    [ $once = 0 ] || exec unshare $flags "${again[@]}" --once
    # the page's address must be outside, where the browser is
    exec "$0" web --bind unshare $flags "${again[@]}"
}

server='' page='' ticker='' state='' route_added=0
start_server() { # returns once it serves
    [ -z "$state" ] || rm -rf "$state"
    state=$(mktemp -d) || exit 3 # of this start alone: it begins on an object that nothing has touched
    "$bin/kneadd" "$scene" --set mesh.measures=both "${options[@]}" --control "$control" --state-dir "$state" --touch \
        >"$out/kneadd.log" 2>&1 3>&- &
    server=$!
    until grep -q serving "$out/kneadd.log"; do
        kill -0 "$server" 2>/dev/null || { wait "$server"; local code=$?; server=; cat "$out/kneadd.log"; exit $code; }
        sleep 0.05
    done
}
stop_server() {
    [ -n "$server" ] || return 0
    kill -TERM "$server" 2>/dev/null
    local code
    wait "$server"
    code=$?
    server=
    return $code
}
start_page() { # on its own socket, or on descriptor 3 when it was opened outside
    local more=()
    : >"$out/web.log"
    [ $inside = 0 ] || more=(--listen-fd 3)
    [[ $scene != */* ]] || more+=(--scenes "${scene%/*}")
    MESA_SHADER_CACHE_DIR=$out/cache "$0" web --control "$control" "${more[@]}" >"$out/web.log" 2>&1 </dev/null &
    page=$!
    until address=$(sed -n 's/^knead web: open //p' "$out/web.log") && [ -n "$address" ]; do
        kill -0 "$page" 2>/dev/null || { page='' && cat "$out/web.log" && echo "the page did not start; everything else continues" && return; }
        sleep 0.05
    done
    echo "press it with the mouse: $address"
    if [ -t 1 ] && [ -n "${DISPLAY-}${WAYLAND_DISPLAY-}" ] && [ "$(id -u)" != 0 ] && command -v xdg-open >/dev/null; then
        xdg-open "$address" >/dev/null 2>&1 </dev/null 3>&- &
    fi
}
leave() { # whatever has been started ends; on a terminal's Ctrl-C it is ending already
    local ended=''
    trap '' INT # a second Ctrl-C must not leave the route behind
    [ -z "$ticker" ] || kill "$ticker" 2>/dev/null
    [ -z "$page" ] || { kill -TERM "$page" 2>/dev/null; wait "$page"; ended='; the page has ended'; }
    if [ -n "$server" ]; then
        stop_server && ended+='; kneadd has ended, forces at zero' || ended+="; kneadd has ended with exit $?, see $out/kneadd.log"
    fi
    [ -z "$state" ] || rm -rf "$state"
    [ $route_added = 0 ] || { ip route del "$group/32" dev lo && ended+='; the route is gone'; }
    [ $once = 1 ] || [ -z "$ended" ] || printf '\nstopped: %s\n' "${ended:2}"
}

tell_time() { # a line every 4 s, since a press takes some 12
    local second
    for second in 4 8 12 16 20 24; do
        sleep 4 </dev/null >/dev/null 2>&1
        echo "pressing: $second s"
    done
}

press() {
    local try code picture=()
    command -v gnuplot >/dev/null && picture=(--png "$out/press.png") || echo "press.png is not drawn: gnuplot is not installed"
    (cd "$out" && rm -f "${results[@]}")
    for try in 1 2 3; do # each on a block that nothing has touched
        start_server
        echo "a virtual hand presses it: 1 cm deep at 1 cm/s, 4 s still, and up again"
        tell_time &
        ticker=$!
        "$0" probe --path press --tries 1 --record "$out/press.lcmlog" --csv "$out/press.csv" "${picture[@]}" </dev/null
        code=$?
        kill $ticker
        ticker=
        [ $code != 0 ] || break
        [ $code = 3 ] || exit $code # bad input stays bad
        tail -n 5 "$out/kneadd.log" && stop_server
        [ $try -lt 3 ] || { [ $once = 0 ] && return 1; exit 3; }
        echo "the press was disturbed: trying again on a fresh block"
    done
    # the cache of OpenGL's compiler stays in here too: in a user namespace there is no home to keep it in
    MESA_SHADER_CACHE_DIR=$out/cache "$0" view --png "$out/dent.png" >/dev/null </dev/null || exit
}

reach() { # how another terminal gets at this server
    echo "In another terminal:"
    local user=''
    grep -qw 4294967295 /proc/self/uid_map || user='-U --preserve-credentials ' # not root outside
    [ $inside = 0 ] || echo "    nsenter -t $$ -n ${user}bash"
    [ "$(command -v knead)" = "$0" ] || printf '    export PATH=%q:$PATH\n' "$bin"
    printf '    export KNEAD_CONTROL=%q\n' "$control"
    echo "    knead probe --path poke              # or sine, or press --record my.lcmlog"
    echo "    knead view --png now.png"
    [ -z "$page" ] || echo "In a browser: $address"
}

trap leave EXIT
trap 'exit 130' INT
trap 'exit 143' TERM HUP
if [ $inside = 1 ]; then
    ip link set lo up && ip route add "$group/32" dev lo || exit 3
else
    make_network
fi
"$0" check "$scene" "${options[@]}" >"$out/scene.txt" </dev/null || exit

[ $once = 1 ] || start_page
if press; then
    echo "wrote $(cd "$out" && ls "${results[@]}" 2>/dev/null | paste -sd ' ') into $out"
else
    echo "no press succeeded: this machine stalls too often. Everything else continues"
fi
[ $once = 0 ] || exit 0

stop_server
start_server
reach
trap 'exit 0' INT
scene=${scene##*/}
echo "serving an untouched ${scene%.yaml}: Ctrl-C ends it"
wait "$server"

#!/usr/bin/env bash
# The README's "Ten minutes", run as written: every ```sh block, followed by a check of the last line that it promises
# (numbers may differ). A block that starts server/run belongs to another terminal: it stays up, and Ctrl-C ends it
# when the next such block comes.
# night: the README at its own pace
set -u
cd "$KN_SOURCE" || exit 1
log=$(mktemp -d) server= fail=0

ctrl_c() {
    [ -n "$server" ] || return 0
    kill -INT -- "-$server"
    wait "$server"
    server=
}
trap 'ctrl_c; rm -rf "$log"' EXIT

plain() { sed -E 's/[-+]?[0-9]+(\.[0-9]+)?(e[-+]?[0-9]+)?/#/g; s/[[:space:]]+/ /g; s/ $//'; }
says() { [ "$(tail -n 1 "$1" | plain)" = "$(plain <<<"$2")" ]; }

step() { # step BLOCK EXPECTED
    local end=$((SECONDS + 300))
    if [[ $1 == server/run* ]]; then
        ctrl_c
        set -m # its own process group, as on a terminal; a background job would ignore Ctrl-C
        bash -c "$1" </dev/null >"$log/server" 2>&1 &
        server=$!
        set +m
        until says "$log/server" "$2" || ! kill -0 "$server" 2>/dev/null || [ $SECONDS -gt $end ]; do sleep 0.2; done
        cp "$log/server" "$log/out"
    else
        eval "$1" </dev/null >"$log/out" 2>&1
    fi
    [[ $1 != *'probe --path poke'* ]] || grep -oP 'peak +\K[0-9.]+' "$log/out" >>"$log/pokes"
    says "$log/out" "$2" && echo "ok   ${1##*$'\n'}" && return
    fail=1
    printf 'FAIL %s\nexpected last line: %s\n' "$1" "$2"
    tail -n 20 "$log/out"
}

# Blocks and promises in order: "B command" lines, then "E expected".
block= steps=0
while IFS= read -r line; do
    case $line in
    B*) block+=${line#B }$'\n' ;;
    E*) step "${block%$'\n'}" "${line#E }" && block= && ((++steps)) ;;
    esac
done < <(awk '/^## / { in_section = /^## Ten minutes/ }
    !in_section { next }
    /^ *```sh/ { code = 1; next }
    /^ *```/ { code = 0; next }
    code { sub(/^ +/, ""); print "B " $0 }
    match($0, /Last line: `[^`]+`/) { print "E " substr($0, RSTART + 12, RLENGTH - 13) }' README.md)
paste -sd ' ' "$log/pokes" | awk '{ exit !($2 < 0.9 * $1) }' || { echo "FAIL the softened dough is not softer: $(cat "$log/pokes")" && fail=1; }
[ $steps -ge 7 ] || { echo "FAIL only $steps steps found" && fail=1; }
exit $fail

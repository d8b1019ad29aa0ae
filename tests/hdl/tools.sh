# Shared functions of the circuit's tests. Sourced by bash in an empty working directory, with KN_SOURCE and KN_BUILD.
#
#     need PROGRAM...                   skip the test (77) if one is missing
#     bench TOP BENCH [OPTION]...       build and run hdl/sim/BENCH.cpp around the Verilated hdl/rtl/TOP.v, with the C
#                                       code that it is compared with; kept in $KN_BUILD/hdl, OPTION is verilator's;
#                                       -GNAME=N sets a parameter of TOP, and the bench's macro NAME
#     prove NAME MODE DEPTH FILE...     prove hdl/formal/NAME.v of the modules hdl/rtl/FILE, whatever other modules
#                                       put out. MODE bmc: in every run of DEPTH clocks; induction: in every run.
#                                       Registers that NAME.v does not reset begin with any content
#     mutant [SKIP:]DEPTH FILE SED      check that the proof fails within DEPTH clocks when SED changes FILE, so that it
#                                       proves something; the first SKIP clocks are not examined
#     cover DEPTH                       check that the proof's cover points are reached
fail=0
rtl=$KN_SOURCE/hdl/rtl
tables=$KN_BUILD/hdl # output of hdl/table.c

need() {
    local program
    for program in "$@"; do
        command -v "$program" >/dev/null || { echo "skipped: no $program here (tests/packages)" && exit 77; }
    done
}

bench() {
    local top=$1 name=$2 built option
    need verilator g++
    built=$(IFS=_ && tr -dc 'a-zA-Z0-9_' <<<"$*") && built=$KN_BUILD/hdl/$built # one for each set of options
    shift 2
    for option in "$@"; do [[ $option != -G* ]] || set -- "$@" -CFLAGS "$(sed "s/-G/-D/; s/16'd//" <<<"$option")"; done
    mkdir -p "$built" && rm -f "$built/bench"
    (cd "$built" && gcc -std=gnu17 -O2 -Wall -I"$KN_SOURCE" -I"$KN_BUILD" -c "$KN_SOURCE"/{server/backend/frame,core/fixed,clients/simdev/golden}.c) &&
        verilator --cc --exe --build -O3 --x-initial unique -Wall --default-language 1364-2005 -y "$rtl" -y "$tables" \
            --top-module "$top" --prefix "V$top" -Mdir "$built" -o bench -CFLAGS "-O2 -I$KN_SOURCE -I$tables" \
            -LDFLAGS "$built/frame.o $built/fixed.o $built/golden.o -lz" -MAKEFLAGS OPT_FAST=-O2 "$@" \
            "$rtl/$top.v" "$KN_SOURCE/hdl/sim/$name.cpp" >"$name.log" 2>&1 ||
        { cat "$name.log" && exit 1; }
    "$built/bench"
}

# smt2 FROM: write the proof of the modules in FROM as a formula. "wire A, B; // peek: INSTANCE.C INSTANCE.D" in the proof
# gives it access to registers.
smt2() {
    local file files=() peeks
    for file in "${proof[@]}"; do files+=("$1/$file"); done
    peeks=$(awk -F '; // peek: ' 'NF == 2 {
        sub(/^ *wire *(\[[^]]*\])? */, "", $1)
        n = split($1, wire, ", ")
        split($2, signal, " ")
        while (n-- > 0) print "connect -nounset -set " wire[n + 1] " " signal[n + 1] ";"
    }' "$KN_SOURCE/hdl/formal/$name.v")
    yosys -q -e "no driver" -l yosys.log -p "read_verilog -lib -I$tables $rtl/*.v; \
        read_verilog -sv -formal -I$1 -I$tables ${files[*]} $KN_SOURCE/hdl/formal/$name.v; hierarchy -check -purge_lib -top $name; \
        setattr -mod -set any 1 =A:blackbox; setattr -mod -unset blackbox =A:any; cutpoint A:any; \
        proc; flatten; $peeks prep -top $name; async2sync; dffunmap; opt_clean; write_smt2 -wires proof.smt2" >/dev/null 2>&1 || { grep ERROR yosys.log; exit 1; }
}

# solve WANTED LINE MODE...: print the solver's verdict and its time
solve() {
    local wanted=$1 line=$2 begun=${EPOCHREALTIME/[.,]/} verdict took
    shift 2
    yosys-smtbmc -s z3 --unroll --noprogress --presat "$@" proof.smt2 >solver.log 2>&1
    took=$(((${EPOCHREALTIME/[.,]/} - begun) / 100000))
    verdict=$(sed -n 's/.*Status: //p' solver.log | tail -1)
    if [[ $verdict == "$wanted" ]]; then
        echo "ok   $line, $((took / 10)).$((took % 10)) s"
    else
        printf 'FAIL %s: %s\n' "$line" "${verdict:-no verdict}" && grep -vE '^## *[0-9:]+ +(Checking|Trying)' solver.log | tail -15
        fail=1
    fi
}

prove() {
    name=$1 mode=$2 depth=$3
    need yosys yosys-smtbmc z3
    shift 3
    proof=("$@")
    smt2 "$rtl"
    solve PASSED "$name holds in $depth clocks" -t "$depth"
    if [ "$mode" = induction ]; then
        solve PASSED "$name: and if it held for $depth, it holds in the next: always" -i -t "$depth"
    fi
}

mutant() {
    local depth=$1 file=$2 change=$3
    rm -rf mutated && cp -r "$rtl" mutated
    sed -i "$change" "mutated/$file"
    if cmp -s "$rtl/$file" "mutated/$file"; then
        echo "FAIL $file: nothing there that '$change' changes" && fail=1
        return
    fi
    smt2 mutated
    solve FAILED "$name is refuted by $file with $change" -t "$depth"
}

cover() {
    smt2 "$rtl"
    solve PASSED "$name: all that it covers is reached" -c -t "$1"
}

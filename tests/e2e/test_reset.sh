#!/usr/bin/env bash
# kneadd --command-fd: a reset over its private pipe makes the object as new, under a hand, too; the log replays over
# it; everything else on the pipe is told and harmless.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
within() { awk -v a="$1" -v b="$2" 'BEGIN { exit !(a <= b) }'; }
verifies() { knead replay "$1" --verify >"$1.said" 2>"$1.err" || { cat "$1.said" "$1.err"; return 1; }; }
whole() { verifies "$1" || ! grep -q 'ticks ran whose force or pose is not in the log' "$1.err"; }
# expect SENTENCE PATTERN OPTION...: kneadd ends with 2 and one line
expect() {
    kneadd --scene "$KN_SOURCE/core/scenes/dough-small.yaml" "${@:3}" >out 2>err
    local code=$?
    check "$1 ($(cat err))" [ "$code $(cat out err | wc -l) $(grep -c -e "$2" err)" = "2 1 1" ]
}
expect "a descriptor that is not open" '--command-fd 77: not open, expected' --command-fd 77
expect "one that cannot be read" '--command-fd 9: not open for reading' --command-fd 9 9> >(cat)
expect "one that is no pipe" '--command-fd 9: not a pipe' --command-fd 9 9</dev/null
expect "one that is no number" '--command-fd nine: no such number' --command-fd nine
end() { stop_kneadd; stop_logger; } # the log, too
mkfifo commands
exec 9<>commands

# a finger presses, holds while the dough under it is made new, lifts, presses again; a stall of the machine spoils that
printf '%s\n' time_s,x_m,y_m,z_m 0,0,0,0.06 0.8,0,0,0.045 1,0,0,0.041 5,0,0,0.041 5.5,0,0,0.06 \
    6.5,0,0,0.06 7.3,0,0,0.045 7.5,0,0,0.041 8,0,0,0.041 8.5,0,0,0.06 >path.csv
for try in 1 2 3; do
    rm -f reset.lcmlog
    start_logger reset.lcmlog
    start_kneadd dough-small.yaml --command-fd 9
    knead probe --path poke --quiet >/dev/null 2>hand.err
    echo reset >&9 # over the dent, with nobody there
    sleep 1.2      # the session ends
    knead probe --path path.csv --quiet >/dev/null 2>>hand.err &
    hand=$!
    for _ in $(seq 25); do
        sleep 0.1
        logcheck reset.lcmlog >so_far 2>/dev/null && within 0.3 "$(number again_n so_far)" && break
    done
    sleep 0.5
    printf 'reset\nreset\nreset\n' | dd bs=64 iflag=fullblock status=none >&9 # bash writes line by line
    sleep 0.3
    printf 'stop\nresettle\n%0500d\n\n' 0 >&9
    wait $hand
    told=$?
    end
    [ $told = 0 ] && ! grep -q 'taken to 0 N' hand.err && whole reset.lcmlog && break
    echo "try $try:" && cat hand.err
done
logcheck reset.lcmlog | tee reset.txt
check "kneadd ended with 0" [ "$status" = 0 ]
check "a reset is a reset, three in one write are one" [ "$(number resets reset.txt)" = 2 ]
check "after each the state is the untouched object's" [ "$(number as_new reset.txt)" = 2 ]
check "what the finger felt faded by at most 2.4 N/ms" within "$(number steepest_n reset.txt)" 2.4
check "to zero in 20 ms" within "$(number faded_n reset.txt)" 0
check "lifted, it felt the new dough" within 0.3 "$(number again_n reset.txt)"
check "the log replays over the resets to the bit" verifies reset.lcmlog
check "four other lines were told, one each" [ "$(grep -c "^kneadd: command '.*': expected reset," kneadd.err)" = 4 ]
check "and nothing else" [ "$(grep -vc -e '^kneadd: command' -e '^Overrun' kneadd.err)" = 0 ]

# a hand in the air, every 10 ms a reset or nothing: as many ticks are in time (else 200 would be late)
late() { echo $(($(counter missed) + $(counter overruns))); }
hold() { # hold COMMAND LOG: sets lost
    start_logger "$2"
    start_kneadd dough-small.yaml --command-fd 9
    send plate >/dev/null <<<"poses 4000 session=7 seq=1" &
    hand=$!
    for _ in $(seq 250); do printf "$1" >&9; sleep 0.01; done
    wait $hand
    end
    lost=$(late)
}
for try in 1 2 3; do
    rm -f quiet.lcmlog often.lcmlog
    hold '' quiet.lcmlog && quiet=$lost
    hold 'reset\n' often.lcmlog && often=$lost
    [ $often -le $((quiet + 40)) ] && whole often.lcmlog && break
done
logcheck often.lcmlog | tee often.txt
check "$(number resets often.txt) resets under a hand, each of the untouched object" \
    [ "$(number resets often.txt)" -ge 200 -a "$(number as_new often.txt)" = "$(number resets often.txt)" ]
check "cost no ticks: $often late or missed, $quiet without" [ $often -le $((quiet + 40)) ]
check "that log replays to the bit, too" verifies often.lcmlog

start_kneadd dough-small.yaml --command-fd 8 8< <(printf 'reset\nres')
sleep 0.3
check "kneadd serves on when the pipe has ended" kill -0 $server
stop_kneadd
check "and ends well" [ "$status" = 0 ]
check "a line cut off is told" grep -q "^kneadd: command 'res': expected" kneadd.err
exit $failed

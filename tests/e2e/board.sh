# Sourced after kneadd.sh by the end-to-end tests with a simulated board: a knead-simdev, whose output is in board.txt.
board() { # board OPTION...: serves when it returns
    local tries
    rm -f board board.txt
    $ahead knead-simdev "$@" >board.txt 2>&1 & simdev=$!
    for ((tries = 0; tries < 250; tries++)); do
        [ ! -e board.txt ] || { ! has pty: board.txt && ! has shm: board.txt; } || return
        pause 0.02
    done
    has 'without Verilator' board.txt && echo "skipped: $(cat board.txt)" && exit 77
    echo "FAIL knead-simdev did not come up:" && cat board.txt && exit 1
}
kill_board() {
    kill -KILL $simdev
    wait $simdev 2>/dev/null
}
hash_of() { sed -n 's/^hash //p' "$1"; } # from the output of knead replay

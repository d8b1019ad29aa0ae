#!/usr/bin/env bash
# Check every bad scene with knead check and with kneadd. Each gives one line file:line:col on stderr, nothing
# on stdout and exit code 2, within a second of processor time and 256 MB. No file is created.
# gate in release: many runs of programs that start slowly with the sanitizers; fuzz.scene looks into the parser
set -u
failed=0 count=0 every=8 # kneadd uses the parser of knead check, so it reads one scene in 8 (at night each)
mkdir here files files/folder
limit="ulimit -v 262144"
grep -q __asan_init "$(command -v knead)" && limit=: # the sanitizer's shadow memory is larger than the limit
[ -z "${KN_NIGHT:-}" ] || every=1

# tell SCENE PROGRAM...: run the program, and check its exit code and that it prints one line.
tell() {
    (cd here && $limit && ulimit -t 1 && exec "${@:2}" "$1") >out 2>err </dev/null
    local status=$?
    mapfile -t said <err
    [ $status = 2 ] && [ ! -s out ] && [ ${#said[@]} = 1 ] && return
    echo "FAIL ${*:2} $1: exit $status, expected 2 and one line: $(head -c 400 out err)"
    failed=1
}
# refuses SCENE LINE: expect exactly that line from both programs. A LINE that ends with a colon is only the
# beginning.
refuses() {
    local program
    for program in "knead check" "kneadd --realtime off"; do
        [ "${program%% *}" = kneadd ] && [ $((count % every)) != 0 ] && continue
        tell "$1" $program
        [ "$said" = "$2" ] || { [ "${2: -1}" = : ] && [[ $said == "$2"* ]]; } && continue
        printf 'FAIL %s\n  says      %s\n  expected  %s\n' "$program $1" "$(cat err)" "$2"
        failed=1
    done
    count=$((count + 1))
}

# The first line of each bad file holds the expected message about the file, or about a file that it names.
bad=$KN_SOURCE/tests/core/scenes_bad
for file in "$bad"/*.yaml; do
    read -r line <"$file"
    line=${line#\# }
    line=${line//HERE/$bad}
    if [[ $line == [0-9]* ]]; then refuses "$file" "$file:$line"; else refuses "$file" "$bad/$line"; fi
done
kept=$count

# Cases that cannot well be kept as files. A comment on their first line would change them.
made=$PWD/files
bytes() { # bytes NAME PRINTF-FORMAT LINE: the message expected for a file of these bytes
    printf "$2" >"$made/$1.yaml"
    refuses "$made/$1.yaml" "$made/$1.yaml:$3"
}
head -c 1048577 /dev/zero | tr '\0' ' ' >files/large.yaml
head -c 1000000 /dev/zero | tr '\0' '[' >files/deep.yaml
head -c 1000000 /dev/zero | tr '\0' '{' >files/deep_mapping.yaml
head -c 1000000 /dev/zero | tr '\0' '"' >files/quotes.yaml
head -c 1000000 /dev/zero | tr '\0' '#' >files/comment.yaml
{ echo "version: 1" && head -c 900000 /dev/zero | tr '\0' 'a' && echo ": 1"; } >files/long_key.yaml
for i in $(seq 20000); do echo "? k$i"; done >files/keys.yaml
{
    printf 'version: 1\na0: &a0 [x, x]\n'
    for i in $(seq 30); do echo "a$i: &a$i [*a$((i - 1)), *a$((i - 1))]"; done
} >files/bomb.yaml
mkfifo files/fifo.yaml
refuses "$made/folder" "$made/folder:1:1: Is a directory, expected a scene file"
refuses "$made/missing.yaml" "$made/missing.yaml:1:1: No such file or directory, expected a scene file"
refuses "$made/large.yaml" "$made/large.yaml:1:1: larger than 1 MiB, expected a scene file"
refuses "$made/deep.yaml" "$made/deep.yaml:1:1: a list, expected a scene that begins with 'version: 1'"
refuses "$made/deep_mapping.yaml" "$made/deep_mapping.yaml:1:2: not a key, expected a short name"
refuses "$made/quotes.yaml" "$made/quotes.yaml:1:1: a value, expected a scene that begins with 'version: 1'"
refuses "$made/comment.yaml" "$made/comment.yaml:2:1: empty, expected a scene that begins with 'version: 1'"
refuses "$made/long_key.yaml" \
    "$made/long_key.yaml:2:900001: not YAML: could not find expected ':', expected 'key: value'"
refuses "$made/keys.yaml" "$made/keys.yaml:1:3: unknown key 'k1', did you mean material.k1?"
refuses "$made/bomb.yaml" \
    "$made/bomb.yaml:2:1: unknown key 'a0', $(sed -n 's/.*\(expected one of: version.*\)/\1/p' "$bad/alias_bomb.yaml" | head -1)"
refuses /dev/zero "/dev/zero:1:1: not a regular file, expected a scene file"
refuses "$made/fifo.yaml" "$made/fifo.yaml:1:1: not a regular file, expected a scene file"
refuses "$made/missing/scene.yaml" "$made/missing/scene.yaml:1:1: No such file or directory, expected a scene file"
bytes lacking 'version: 1\nmaterial: missing.yaml\n' \
    "2:11: material: $made/missing.yaml:1:1: No such file or directory, expected a material file"
bytes heavy 'version: 1\nmaterial: large.yaml\n' \
    "2:11: material: $made/large.yaml:1:1: larger than 1 MiB, expected a material file"
bytes empty '' "1:1: empty, expected a scene that begins with 'version: 1'"
bytes newline '\n' "2:1: empty, expected a scene that begins with 'version: 1'"
bytes not_utf8 'version: 1\ndensity: \xff\xfe\n' "2:10: not UTF-8 text: invalid leading UTF-8 octet, expected a scene"
bytes latin1 'version: 1\nsupport: b\xf6nded\n' "2:12:"
for value in '\xc0\x80\n' '\xed\xa0\x80\n' '\xe2\x82' '\x1b[31mbonded\n'; do bytes value$count "version: 1\nsupport: $value" "2:10:"; done # overlong, surrogate, cut, escape
bytes nul 'version: 1\0' "1:11: not UTF-8 text: control characters are not allowed, expected a scene"
bytes utf16 'v\0e\0r\0' "1:2: not UTF-8 text: control characters are not allowed, expected a scene"
bytes utf16_mark '\xff\xfev\0e\0r\0' "1:1:"
bytes utf32_mark '\xff\xfe\0\0v\0\0\0' "1:1:"
bytes mark_alone '\xef\xbb\xbf' "2:1: empty, expected a scene that begins with 'version: 1'"
bytes mark_and_key '\xef\xbb\xbfwersion: 1\n' "1:2: unknown key 'wersion', did you mean version?"
bytes mark_within 'version: 1\n\xef\xbb\xbfdensity: 3\n' "2:2:"
bytes crlf 'version: 1\r\ndensity: 3\r\n' "2:10:"
bytes cr 'version: 1\rdensity: 3\r' "2:10:"
bytes no_newline 'version: 2' "1:10: version: 2 is out of range, expected 1"
bytes tab_after_key 'version: 1\nobject:\n\tsize: 3\n' "3:1:"
bytes tab_before_value 'version: 1\nsolver:\n  dt:\t2 s\n' "3:7:"
bytes bidi 'version: 1\nsupport: \xe2\x80\xaebonded\n' \
    "2:10: support: not short ASCII text, expected bonded|frictionless|none|friction"
bytes page 'version: 1\n\x0csupport: none\n' "2:1:"
bytes elf '\x7fELF\x02\x01\x01' "1:1:"
bytes json_array '[{"version": 1}]' "1:1: a list, expected a scene that begins with 'version: 1'"
bytes json_open '{"version": 1' "2:1:"
made_count=$((count - kept))

# Values beyond either end of each key's range.
knead check --keys | awk -v folder="$made" '
    function value(v, times, unit,    text, i) {
        if (unit != "number") v = v " " unit
        for (i = 1; i <= times; i++) text = text (i > 1 ? ", " : "") v
        return times ? "[" text "]" : v
    }
    function scene(name, key, v,    path, n, i, text, tail) { # write a file, with braces and lists in one line
        n = split(key, path, ".")
        text = "version: 1\n" path[1] ": "
        for (i = 2; i <= n; i++) {
            if (path[i] == "NAME" || path[i] == "N") { text = text "["; tail = "]" tail }
            else { text = text "{" path[i] ": "; tail = "}" tail }
        }
        if (key == "version") text = "version: "
        print text v tail > (folder "/" name ".yaml")
        close(folder "/" name ".yaml")
        print name
    }
    /^material\.(k1|c1|c2|alpha|c_max|c_min) / { next } # the range depends on whether there is a specimen height
    match($0, / [-0-9.e+]+ \.\. [-0-9.e+]+ /) {
        split(substr($0, RSTART + 1, RLENGTH - 2), end, " \\.\\. ")
        type = substr($0, length($1) + 1, RSTART - length($1))
        gsub(/^ +| +$/, "", type)
        times = 0
        if (match(type, /^2 or 3 x /)) { times = 3; type = substr(type, 10) }
        else if (match(type, /^[234] x /)) { times = substr(type, 1, 1) + 0; type = substr(type, 5) }
        low = end[1] > 0 ? end[1] / 2 : end[1] < 0 ? end[1] * 2 : -1
        scene("below." $1, $1, value(low, times, type))
        scene("above." $1, $1, value(end[2] * 2, times, type))
    }' >ends
while read -r name; do
    tell "$made/$name.yaml" knead check
    grep -qE "^$made/$name.yaml:[0-9]+:[0-9]+: .* is out of range, expected " err && count=$((count + 1)) && continue
    echo "FAIL $name: $(cat err)"
    cat "$made/$name.yaml"
    failed=1
done <ends

[ -z "$(ls -A here)" ] || { echo "FAIL files were created: $(ls -A here)" && failed=1; }
echo "$count bad scenes: $kept kept as files, $made_count made of bytes," \
    "$((count - kept - made_count)) beyond a key's range; kneadd read 1 in $every"
[ $kept -ge 200 ] || { echo "FAIL only $kept bad scenes in $bad" && failed=1; }
exit $failed

#!/usr/bin/env bash
# knead view: an object at rest, a served object, a recording, and the messages when there is nothing to see.
. "$KN_SOURCE/tests/e2e/kneadd.sh"
# expect SENTENCE EXIT PATTERN COMMAND...: check the exit code and the one line on stderr (empty: ^$).
expect() {
    local sentence=$1 code=$2 pattern=$3 got told
    shift 3
    "$@" >out 2>err
    got=$?
    mapfile -t told <err
    check "$sentence (${told[*]})" eval '[ $got = $code ] && [ ${#told[@]} -le 1 ] && [[ ${told[*]} =~ $pattern ]]'
}
# film FILE CODEC WIDTH HEIGHT PICTURES: check the properties that ffprobe reports, with every picture decoded.
film() {
    local says
    says=$(ffprobe -v error -count_frames -show_entries stream=codec_name,width,height,nb_read_frames -of csv=p=0 "$1")
    check "$1 is a film of $5 pictures ($says)" [ "$says" = "$2,$3,$4,$5" ]
}
# picture FILE WIDTH HEIGHT: check for a PNG of that size (bytes 17 to 24 of the file).
picture() {
    local size
    size=$(printf '%08x%08x' "$2" "$3")
    check "$1 is a picture of $2 x $3" [ "$(od -An -tx1 -j16 -N8 "$1" | tr -d ' \n')" = "$size" ]
}
scene=$KN_SOURCE/core/scenes/dough-small.yaml
night() { [ -n "${KN_NIGHT:-}" ]; } # a picture takes a good part of a second
knead view --scene "$scene" --png rest.png 2>&1 | grep 'install the package lib' && echo "skipped: no OpenGL" && exit 77

expect "a scene at rest is drawn" 0 '^$' knead view --scene "$scene" --png rest.png --size 320x180
picture rest.png 320 180
expect "the edges of a scene at rest are drawn" 0 '^$' knead view --scene "$scene" --style edges --png edges.png --size 160x160
if night; then
    cp "$scene" "$(printf 'd\377ugh.yaml')"
    expect "a scene whose name is not UTF-8 is drawn" 0 '^$' knead view --scene "$(printf 'd\377ugh.yaml')" --png odd.png --size 320x180
    cp "$scene" "aa$(printf '\303\251%.0s' {1..80}).yaml"
    expect "a scene whose long name is cut within a character is drawn" 0 '^$' knead view --scene "aa$(printf '\303\251%.0s' {1..80}).yaml" --png odd.png --size 320x180
fi
expect "without a server the error suggests to start kneadd" 3 'heard nothing in 0.3 s: is kneadd running' knead view --png x.png --wait 0.3
check "without a server no picture is written" [ ! -e x.png ]
expect "an invalid bus is refused" 2 'knead view: nosuch://1: expected udpm://GROUP:PORT' knead view --png x.png --lcm-url nosuch://1
expect "a command without --png is refused" 2 'expected --png' knead view
expect "a size that is too small is refused" 2 '^knead view: --size 9x9: expected WxH, 16..4096' knead view --png x.png --size 9x9
for size in '32x+32' ' 32x32' 0x20x32 32x32x 32; do
    expect "a malformed size is refused" 2 '^knead view: --size .*: expected WxH, 16..4096' knead view --png x.png --size "$size"
done
for text in ' 1' 0x2 1e inf nan; do
    expect "an invalid number is refused" 2 '^knead view: --zoom .*: expected 0.2..20' knead view --png x.png --zoom "$text"
done
expect "an empty path is refused" 2 "^knead view: --png '': expected a value$" knead view --scene "$scene" --png ''
expect "an unknown KNEAD_GL is refused" 2 '^knead view: KNEAD_GL=foo: expected osmesa or egl$' env KNEAD_GL=foo knead view --scene "$scene" --png x.png
if night; then
    expect "a picture too narrow for four views is refused" 2 '^knead view: --size 48x32: expected at least 16 pixels for each of 4 pictures side by side$' \
        knead view "$scene" "$scene" "$scene" "$scene" --png x.png --size 48x32
    expect "four views at the smallest width are drawn" 0 '^$' knead view "$scene" "$scene" "$scene" "$scene" --png four.png --size 64x16
fi
expect "a missing scene is refused" 2 'nosuch.yaml:1:1: ' knead view --png x.png --scene nosuch.yaml
expect "a missing log is refused" 2 'expected an LCM event log' knead view --png x.png nosuch.lcmlog
expect "a picture over a device file is refused" 3 '/dev/null: is no regular file' knead view --png /dev/null --scene "$scene"
cp "$scene" own.yaml
expect "a picture over its own scene is refused" 2 'own.yaml: is being read' knead view --png own.yaml --scene own.yaml
check "the scene file is unchanged" cmp -s "$scene" own.yaml
expect "a picture in a missing folder is refused" 3 'nosuch/x.png: No such file' knead view --png nosuch/x.png --scene "$scene"

start_kneadd dough-small.yaml
hand plate >hand.out 2>&1 &
hand=$!
expect "the served object is drawn" 0 '^$' knead view --png live.png --size 320x180 --wait 20
check "the output names the scene and the tick" grep -q 'dough-small.yaml live, tick' out
if night; then
    expect "the served object is drawn in the colours of its displacement" 0 '^$' knead view --png moved.png --color displacement --size 320x180 --wait 20
fi
picture live.png 320 180
if night && command -v ffmpeg >/dev/null; then
    expect "a film of the served object is made" 0 '^$' knead view --video live.mp4 --seconds 1 --fps 10 --size 160x90 --wait 20
    film live.mp4 h264 160 90 10
    expect "in colours" 0 '^$' \
        knead view --video live.webm --seconds 0.5 --fps 8 --size 160x90 --wait 20 --color displacement --top '2 mm'
    film live.webm vp9 160 90 4
fi
kill $hand
stop_kneadd
start_kneadd dough-small.yaml
expect "colours of a stress that the server does not send are refused" 2 '--color stress: the served scene has no such mesh.measures' \
    knead view --png x.png --color stress --size 320x180 --wait 20
stop_kneadd
start_kneadd dough-small.yaml --set mesh.measures=both
declare -A top=([stress]='1 kPa' [residual]=0.1)
for what in stress residual; do
    expect "$what at rest is drawn" 0 '^$' knead view --png rest-$what.png --color $what --top "${top[$what]}" --plain --size 320x180 --wait 20
done
printf '%s\n' time_s,x_m,y_m,z_m 0,0,0,0.06 0.5,0,0,0.045 1.5,0,0,0.035 2,0,0,0.06 >path.csv
$ahead knead probe --path path.csv --quiet >hand.out 2>&1 &
hand=$!
if night; then
    for what in stress residual; do
        expect "$what of the served object is drawn" 0 '^$' \
            knead view --png live-$what.png --color $what --top "${top[$what]}" --plain --size 320x180 --wait 20
    done
fi
wait $hand
for what in stress residual; do
    expect "$what after a press is drawn" 0 '^$' \
        knead view --png left-$what.png --color $what --top "${top[$what]}" --plain --size 320x180 --wait 20
    check "$what after a press is another picture than at rest" [ "$(cmp -s rest-$what.png left-$what.png; echo $?)" = 1 ]
done
check "at rest stress and residual give the same picture, after a press two" \
    [ "$(cmp -s rest-stress.png rest-residual.png; echo $?) $(cmp -s left-stress.png left-residual.png; echo $?)" = '0 1' ]
stop_kneadd

pressed "$scene" press.lcmlog
expect "a moment of a recording is drawn" 0 '^$' knead view press.lcmlog --at 2 --png a.png --size 320x180
expect "the moment of a recording is drawn again" 0 '^$' knead view press.lcmlog --at 2 --png b.png --size 320x180
check "both pictures of one moment are equal to the byte" cmp a.png b.png
if night; then
    KNEAD_GL=egl knead view press.lcmlog --at 2 --png egl.png --size 320x180 >out 2>err
    case $? in
    0) check "EGL draws the same picture" cmp a.png egl.png ;;
    *) check "without EGL the package is named" grep -q 'install the package' err ;;
    esac
fi
expect "the end of a recording is drawn" 0 '^$' knead view press.lcmlog --png end.png --size 320x180
for what in stress $(! night || echo residual displacement); do
    expect "a moment is drawn in the colours of $what" 0 '^$' knead view press.lcmlog --at 2 --color $what --png $what.png --size 320x180
    check "the colours of $what change the picture" [ "$(cmp -s a.png $what.png; echo $?)" = 1 ]
done
expect "a moment is drawn with a given scale" 0 '^$' knead view press.lcmlog --at 2 --color stress --top '100 kPa' --png top.png --size 320x180
check "another scale is another picture" [ "$(cmp -s top.png stress.png; echo $?)" = 1 ]
if night; then
    for style in solid wire edges; do
        expect "the style $style is drawn" 0 '^$' knead view press.lcmlog --at 2 --style $style --png $style.png --size 320x180
        check "the style $style is another picture" [ "$(cmp -s a.png $style.png; echo $?)" = 1 ]
    done
    expect "every edge is drawn in its colour" 0 '^$' knead view press.lcmlog --at 2 --style edges --color stress --png x.png --size 320x180
    expect "a picture without text is drawn" 0 '^$' knead view press.lcmlog --at 2 --plain --png plain.png --size 320x180
    check "the picture without text is another picture" [ "$(cmp -s a.png plain.png; echo $?)" = 1 ]
fi
expect "an unknown colour is refused" 2 '^knead view: --color heat: expected displacement, stress or residual$' knead view --png x.png --color heat
expect "an unknown style is refused" 2 '^knead view: --style dots: expected lined, solid, wire or edges$' knead view --png x.png --style dots
expect "a scale without a colour is refused" 2 "^knead view: --top 1: expected --color as well$" knead view --png x.png --top 1
for bad in 5 '5 mm' '-1 kPa' 'much'; do
    expect "an invalid scale is refused" 2 "^knead view: --top $bad: expected a von Mises stress above 0, e.g. '5 kPa'$" \
        knead view --png x.png --color stress --top "$bad"
done
expect "the style edges is refused for a served object" 2 'kneadd serves the surface alone, expected a log or --scene$' knead view --png x.png --style edges

expect "a range image is written" 0 '^$' knead view press.lcmlog --depth depth.png --size 300x200
picture depth.png 300 200
check "the range image is 16-bit grey" [ "$(od -An -tu1 -j24 -N2 depth.png | tr -d ' ')" = 160 ]
check "the range image has its scale in the file" grep -qa 'height_mm = step_mm \* (value - 1)' depth.png
check "the output states the scale of the range image" grep -q 'height above the table = 0.001 mm \* (value - 1), 0: nothing there; pixel 0.5 mm' out
expect "a range image from another view is refused" 2 'the view is straight from above' knead view press.lcmlog --depth x.png --azimuth 3
expect "a range image together with a picture is refused" 2 'expected one of them$' knead view press.lcmlog --depth x.png --png x.png

expect "two objects are compared" 0 '^$' knead view --compare press.lcmlog "$scene" --png two.png
picture two.png 1920 480
check "the output states how far the two objects are apart" grep -Eq 'at rest; up to [0-9.]+ mm apart$' out
if night; then
    expect "three moments of one recording are drawn" 0 '^$' knead view press.lcmlog --at 1,2,end --png three.png --size 960x180
    check "the output names the three moments" grep -Eq 'at 1.000 s; .* at 2.000 s; .* at ' out
    expect "as many moments as objects are drawn" 0 '^$' knead view press.lcmlog press.lcmlog --at 1,2 --png x2.png --size 960x180
    expect "one moment of all objects is drawn" 0 '^$' knead view press.lcmlog press.lcmlog --at 1 --png x2.png --size 960x180
    check "the output names one moment for both objects" grep -q 'at 1.000 s; .* at 1.000 s$' out
fi
expect "two moments for three objects are refused" 2 '2 moments of 3 objects' knead view press.lcmlog press.lcmlog press.lcmlog --at 1,2 --png x.png
expect "two moments of one recording are compared" 0 '^$' knead view press.lcmlog --at 1,2 --compare --png x2.png --size 960x180
expect "an empty moment is refused" 2 'expected 1 to 4 times separated by commas' knead view press.lcmlog --at 1,,2 --png x.png
expect "a recording is compared with itself" 0 '^$' knead view --compare press.lcmlog press.lcmlog --png same.png --size 960x240
check "a recording is 0 mm apart from itself" grep -q '; up to 0 mm apart$' out
expect "a comparison of three objects is refused" 2 'expected two objects, there are 3' knead view --compare press.lcmlog "$scene" "$scene" --png x.png
expect "a comparison of two shapes is refused" 2 'mm apart, expected objects of the same shape' knead view --compare "$scene" "$KN_SOURCE/core/scenes/bun.yaml" --png x.png
if night; then
    for camera in front back left right top corner; do
        expect "the view from $camera is drawn" 0 '^$' knead view press.lcmlog --camera $camera --png $camera.png --size 160x90
    done
    sums=$(sha256sum front.png back.png left.png right.png top.png corner.png | cut -c1-64 | sort -u | wc -l)
    check "the six views are six different pictures" [ "$sums" = 6 ]
    expect "a zoomed view is drawn" 0 '^$' knead view press.lcmlog --zoom 3 --png zoom.png --size 160x90
    check "the zoomed view is another picture" [ "$(cmp -s zoom.png corner.png; echo $?)" = 1 ]
fi
expect "an unknown camera is refused" 2 'expected front, back, left, right, top or corner$' knead view press.lcmlog --camera below --png x.png

mkdir state
start_kneadd dough-small.yaml --state-dir "$PWD/state"
$ahead knead probe --path poke --quiet
stop_kneadd
snapshot=$(compgen -G 'state/dough-small.*.knead' | sort | tail -1)
cp "$snapshot" kept
expect "a snapshot is drawn" 0 '^$' knead view kept --scene "$scene" --color residual --png snapshot.png --size 320x180
check "the output names the snapshot" grep -Eq 'dough-small.yaml, snapshot [0-9]+ of tick [0-9]+$' out
check "the snapshot is another picture than the object at rest" [ "$(cmp -s snapshot.png rest.png; echo $?)" = 1 ]
expect "a snapshot is compared with its scene" 0 '^$' knead view kept "$scene" --compare --scene "$scene" --png pressed.png
check "the snapshot differs from its scene" grep -Eq 'up to [0-9]*[.]?[0-9]*[1-9][0-9]* mm apart$' out
expect "a snapshot without its scene is refused" 2 'kept: is a snapshot, expected --scene SCENE with' knead view kept --png x.png
expect "a snapshot of another scene is refused" 2 'kept: another scene: dough-small.yaml, expected clay.yaml$' \
    knead view kept --scene "$KN_SOURCE/core/scenes/clay.yaml" --png x.png
head -c 2000 kept >cut
expect "a truncated snapshot is refused" 2 'cut: truncated: 2000 bytes of' knead view cut --scene "$scene" --png x.png
head -c 2000 /dev/zero >zeros
expect "a file of an unknown kind is refused" 2 'zeros: expected an LCM event log, a snapshot or a scene$' knead view zeros --png x.png
expect "a scene together with a log is refused" 2 'expected a snapshot of this scene, or no other file' knead view press.lcmlog --scene "$scene" --png x.png

video() { knead view press.lcmlog --size 160x90 --from 1.2 --to 1.7 --fps 10 "$@"; }
if command -v ffmpeg >/dev/null; then
    expect "a film in the colours of stress is made" 0 '^$' video --video press.mp4 --color stress
    film press.mp4 h264 160 90 6
    if night; then
        expect "a film of two compared recordings is made" 0 '^$' video press.lcmlog --compare --video two.mp4 --fps 4 --size 480x90
        film two.mp4 h264 480 90 3
        expect "a film at twice the speed is made" 0 '^$' video --video fast.webm --speed 2
        film fast.webm vp9 160 90 3
        expect "a GIF is made" 0 '^$' video --video press.gif
        film press.gif gif 160 90 6
    fi
    mkdir fake
    printf '#!/bin/sh\nhead -c 1000 >/dev/null\necho no good >&2\necho no room left >&2\nexit 1\n' >fake/ffmpeg
    chmod +x fake/ffmpeg
    cp press.mp4 kept.mp4
    PATH=$PWD/fake:$PATH expect "the error has ffmpeg's own message" 3 'ffmpeg could not make the film: no room left$' video --video kept.mp4
    check "a failed film leaves the old film" cmp -s press.mp4 kept.mp4
    printf '#!/bin/sh\nexec <&-\nsleep 0.5\n' >fake/ffmpeg
    PATH=$PWD/fake:$PATH expect "an ffmpeg that reads nothing is reported" 3 'ffmpeg could not make the film: it printed no message$' \
        video --video kept.mp4 --size 640x360
    PATH=$PWD/fake:$PATH expect "an ffmpeg that fails after all input is reported" 3 'ffmpeg could not make the film' video --video kept.mp4 --size 16x16 --fps 1
    check "the failed films leave the old film" cmp -s press.mp4 kept.mp4
    printf '#!/bin/sh\nsleep 1000 & echo $! >child\nwait\n' >fake/ffmpeg
    PATH=$PWD/fake:$PATH knead view press.lcmlog --video never.mp4 --size 640x360 >out 2>err &
    filming=$!
    for _ in {1..200}; do [ -s child ] && break; sleep 0.1; done
    kill -INT $filming
    wait $filming
    got=$?
    pause 0.2
    check "an interrupt also ends the child of an ffmpeg wrapper ($got)" \
        eval '[ $got = 130 ] && [ -s child ] && [[ $(cut -d" " -f3 /proc/$(cat child)/stat 2>/dev/null) != [RSD] ]]'

    knead view press.lcmlog --video never.mp4 --fps 120 --speed 0.01 >out 2>err &
    filming=$!
    # Once the film has begun, there is a temporary file beside it.
    for _ in {1..200}; do compgen -G 'never.mp4.*' >/dev/null && break; sleep 0.1; done
    check "a film has begun" compgen -G 'never.mp4.*'
    kill -INT $filming
    wait $filming
    check "an interrupted film exits with 130" [ $? = 130 ]
    check "an interrupted film leaves no file" [ -z "$(compgen -G 'never*')" ]
    expect "a film of an object at rest without --orbit is refused" 2 'expected a log among the files; an object at rest' knead view kept --scene "$scene" --video x.mp4
fi
bare=$PWD/bare
mkdir -p bare folder/ffmpeg && ln -s "$(command -v knead)" bare/knead
expect "a film without ffmpeg is refused" 3 'films need ffmpeg, which is not installed: install the package ffmpeg$' \
    env PATH="$bare" knead view press.lcmlog --video x.mp4
expect "a folder named ffmpeg is not taken for the program" 3 'films need ffmpeg, which is not installed: install the package ffmpeg$' \
    env PATH="$bare:$PWD/folder" "$(command -v knead)" view press.lcmlog --video x.mp4
expect "an unknown film format is refused" 2 '--video x.avi: expected .mp4, ' knead view press.lcmlog --video x.avi
expect "a film without a log or a length is refused" 2 'expected a log, or --seconds N' knead view --video x.mp4
expect "a film of odd width is refused" 2 'expected even numbers' knead view press.lcmlog --video x.mp4 --size 161x90
expect "a film that starts after the end is refused" 2 '^knead view: --from 1000: press.lcmlog ends at ' knead view press.lcmlog --video x.mp4 --from 1000
expect "a picture with a speed is refused" 2 'expected --video$' knead view press.lcmlog --png x.png --speed 2
expect "colours of an endless film without a scale are refused" 2 'expected --top as well' knead view --video x.mp4 --seconds 1 --color displacement
check "no refused film is written" [ ! -e x.mp4 ]
expect "a moment after the end is refused" 2 'ends at [0-9.]+ s$' knead view press.lcmlog --at 1e6 --png x.png
exit $failed

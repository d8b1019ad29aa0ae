#!/usr/bin/env bash
# A newcomer who has only the Debian packages of the last commit: lintian finds no fault in them. In a clean root, apt installs
# them, a page and a press come from what they hold, C and Python compute the bits of the build, and a purge leaves the
# root as it was.
# night: the packages are built by themselves, and a root of Debian is made
source "$KN_SOURCE/tests/e2e/clean_root.sh" || exit 70
for tool in dpkg-buildpackage dh_python3 lintian; do command -v $tool >/dev/null || skip "no $tool here (tests/packages)"; done
packages=$KN_SOURCE/build/packages

needed=$(sed -n 's/^\([a-z0-9]*-dev\) *# run .*/\1/p' "$KN_SOURCE/tests/packages" | grep -vx libc6-dev | sort)
check "the packages are built from the libraries that tests/packages names" \
    [ -z "$(comm -23 - <(tr -s ', ' '\n' <"$KN_SOURCE/server/packaging/debian/control" | sort) <<<"$needed")" ]
if command -v ccache >/dev/null; then # debhelper gives the compiler another home
    export CMAKE_C_COMPILER_LAUNCHER=ccache CCACHE_DEPEND=1
    CCACHE_DIR=$(ccache -k cache_dir) && export CCACHE_DIR
fi
"$KN_SOURCE/server/packaging/build" >build.log 2>&1
check "the packages are built" [ $? = 0 ] || { cat build.log && exit 1; }
took "built"
TMPDIR=$PWD lintian --allow-root -i --pedantic --fail-on error,warning "$packages"/*.changes >lintian.log 2>&1
check "lintian -i --pedantic has no error and no warning" [ $? = 0 ]
cat lintian.log
took "looked at by lintian"

release=$(. /etc/os-release && echo "$VERSION_CODENAME")
make_root "$release" --include=systemd,udev,dbus,zsh || skip "no mirror of $release is within reach" # apt would bring dbus to systemd, and dbus leaves its user
cp "$packages"/*.deb root/opt
kept() { # all files, with owner, mode and target; the text of settings
    (cd root && find . \( -path ./proc -o -path ./dev -o -path ./opt -o -path ./var/cache -o -path ./var/log -o -path ./var/lib/apt -o \
        -path ./var/lib/dpkg \) -prune -o -printf '%M %U:%G %p %l\n' && find etc -type f ! -name '*-' -exec sha256sum {} +) | sort
}
kept >before
took "a root of $release"

network=$outside inside sh -c 'apt-get -q update && apt-get -q install -y /opt/*.deb' >apt.log 2>&1
check "apt installs the packages" [ $? = 0 ] || { cat apt.log && exit 1; }
took "installed: $(sed -n 's/^Need to get/needs/p' apt.log)"
check "kneadd.service has its user, and neither starts nor is enabled" \
    sh -c 'chroot root getent passwd knead >/dev/null && [ -e root/lib/systemd/system/kneadd.service ] && ! find root/etc/systemd | grep kneadd'
check "the programs are of the packages' version" \
    [ "knead $(dpkg-deb -f "$packages"/knead_*.deb Version | sed 's/-[^-]*$//')" = "$(inside knead --version)" ]
check "zsh finds the completion" [ "$(inside zsh -fc 'autoload -U compinit && compinit -D && echo $_comps[kneadd]')" = _knead ]

begin=$(date +%s%N)
set -m # a background job would ignore Ctrl-C
inside knead demo --out /opt/demo >demo.log 2>&1 & demo=$!
set +m
page() { address=$(sed -n 's/^press it with the mouse: //p' demo.log) && [ -n "$address" ]; }
check "knead demo has a page" await page
check "the page comes when it is fetched" await python3 -c \
    'import sys, urllib.request; sys.exit(b"knead" not in urllib.request.urlopen(sys.argv[1], timeout=9).read().lower())' "$address"
echo "     knead demo: the page after $((($(date +%s%N) - begin) / 1000000)) ms"
check "knead demo presses the dough" await grep -q '^serving an untouched dough' demo.log
cat demo.log
check "the press has its table" grep -qE '^ +peak +[0-9.]+ N' demo.log
check "the press has its files" [ -s root/opt/demo/press.lcmlog -a -s root/opt/demo/press.csv -a -s root/opt/demo/press.png -a -s root/opt/demo/dent.png ]
kill -INT -- -$demo
check "knead demo ends on Ctrl-C" ended $demo
took "demo"

examples=/usr/share/knead/clients/examples
env PYTHONPATH="$KN_BUILD/python" /usr/bin/python3 "$KN_SOURCE/clients/examples/press.py" >own.txt
inside python3 $examples/press.py | cmp - own.txt
check "python3-knead computes the bits of this build" [ $? = 0 ]
library=$(echo root/usr/lib/*/libknead.so)
cc -I root/usr/include -o root/opt/press root/$examples/press.c -L "${library%/*}" -lknead -lm
inside /opt/press | cmp - own.txt
check "so does a program in C on libknead" [ $? = 0 ]

inside install -d -o knead -g knead /var/lib/knead/old # as the service leaves it
inside sh -c 'cd /opt && apt-get -q purge -y --autoremove -o APT::AutoRemove::RecommendsImportant=false -o APT::AutoRemove::SuggestsImportant=false $(for file in *.deb; do echo ${file%%_*}; done)' >purge.log 2>&1
check "apt purges the packages" [ $? = 0 ] || cat purge.log
kept >after
diff before after
check "no file or setting is left, gone or changed" [ $? = 0 ]
wc -l after
took "purged"
exit $failed

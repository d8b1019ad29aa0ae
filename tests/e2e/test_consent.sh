#!/usr/bin/env bash
# tests/run and server/run change nothing on a machine without asking. A fake dpkg-query says that every package is
# missing.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh" # defines check

mkdir bin && PATH=$PWD/bin:$PATH
printf '#!/bin/sh\nexit 1\n' | tee bin/dpkg-query bin/sudo >/dev/null
printf '#!/bin/sh\necho apt-get was run >&2\nexit 9\n' >bin/apt-get
chmod -R a+rx bin "$PWD"

"$KN_SOURCE/tests/run" </dev/null >run.log 2>&1
check "without a terminal and without --yes tests/run exits 2" [ $? = 2 ]
check "tests/run names the packages that it would install" grep -q 'will install with apt: .*liblcm-dev .*clang' run.log
"$KN_SOURCE/server/run" --once </dev/null >serve.log 2>&1
check "server/run exits 2, too" [ $? = 2 ]
check "server/run does not ask for the packages of the tests" sh -c 'grep -q liblcm-dev serve.log && ! grep -q clang serve.log'
check "neither script ran apt" sh -c '! grep -q "apt-get was run" *.log'

if [ "$(id -u)" = 0 ] && setpriv --reuid 65534 --regid 65534 --clear-groups test -x "$KN_SOURCE/tests/run" 2>/dev/null; then
    setpriv --reuid 65534 --regid 65534 --clear-groups "$KN_SOURCE/tests/run" --yes </dev/null >user.log 2>&1
    check "a user without sudo gets exit 3" [ $? = 3 ]
    check "a user without sudo gets the commands to run" grep -q '^    apt-get install -y --no-install-recommends .*liblcm-dev' user.log
fi
exit $failed

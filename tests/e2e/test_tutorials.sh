#!/usr/bin/env bash
# The ```sh blocks of all tutorials, run as they stand with what is installed, and their promised lines (page_blocks.py); most use
# knead probe. With a name of pages, such as README.md (test_readmes.sh): the blocks of those pages.
# A machine that stands still spoils a press, so each page has three attempts, every one in a new folder.
# night: every page at its own pace
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"
cmake --install "$KN_BUILD" --prefix "$PWD/usr" >install.log || exit
library=$(dirname "$(find usr -name knead.pc)")
export PATH=$PWD/usr/bin:$PATH PKG_CONFIG_PATH=$PWD/$library LD_LIBRARY_PATH=$PWD/${library%/*} PYTHONPATH=$KN_BUILD/python
export KNEAD_USR=$PWD/usr
unset KNEAD_SCENES

page_runs() { # page_runs PAGE
    local try
    for try in 1 2 3; do
        mkdir "$PWD/$(tr / . <<<"${1#"$KN_SOURCE"/}").$try" && (cd "$_" && python3 "$KN_SOURCE/tests/e2e/page_blocks.py" "$1") && return
    done
    return 1
}
for page in $(grep -rlx --include="${1-[0-9]*.md}" --exclude-dir=build '```sh' "$KN_SOURCE" | sort); do
    check "${page#"$KN_SOURCE"/} does what it says" page_runs "$page"
done
[ $# = 0 ] || exit $failed

cmake --build "$KN_BUILD" --target doc >doc.log 2>&1 && built=yes
check "the manual has no warning and no broken link: $(grep ' links$' doc.log)" [ "${built-no}" = yes ] || cat doc.log
exit $failed

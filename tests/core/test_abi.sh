#!/usr/bin/env bash
# What programs see of libknead stays as it is: core/libknead.abi lists all functions, tables, enums and struct layouts of
# the public headers. A change that is wanted changes that list. If a line goes or changes, the number in the soname goes up
# with it (core/CMakeLists.txt, clients/python/knead/_library.py):
#
#     python3 clients/python/declare.py abi . >core/libknead.abi
set -u
fail=0
verdict() { # verdict CODE OK FAIL: say one of the two
    [ "$1" = 0 ] && echo "ok   $2" && return
    echo "FAIL $3" && fail=1
}
declared=$(python3 "$KN_SOURCE/clients/python/declare.py" abi "$KN_SOURCE")
list=$KN_SOURCE/core/libknead.abi
diff "$list" <(echo "$declared")
verdict $? "the headers declare what core/libknead.abi lists" "the headers and core/libknead.abi differ: see $0"

# The compiler lays the structs out as the list says.
offsets() {
    echo '#include "core/knead.h"'
    awk '$1 == "struct" { s = $2; print "_Static_assert(sizeof(struct_of_" s ") == " $3 ", \"size of " s "\");" }
         /^    / { print "_Static_assert(offsetof(struct_of_" s ", " $2 ") == " $1 ", \"" s "." $2 "\");" }' "$list" |
        sed -E 's/struct_of_(kn_shape|kn_scratch)\b/struct \1/; s/struct_of_//'
}
offsets >layout.c
cc -std=c17 -fsyntax-only -I "$KN_SOURCE" layout.c
verdict $? "the compiler lays out $(grep -c offsetof layout.c) members as listed" "a layout differs"

# The shared libraries export these names, those for libknead-scene, and no others.
libraries=$(find "$KN_BUILD/core" -name 'libknead*.so')
[ -n "$libraries" ] || { echo "skip a build with sanitizers has no shared libraries" && exit $fail; }
exported=$(for one in $libraries; do nm -D --defined-only "$one"; done | awk '$2 != "A" { sub(/@.*/, "", $3); print $3 }' | sort -u)
wanted=$(awk '$1 == "function" || $1 == "table" { print $2 }' "$list"
    printf 'kn_%s\n' composite_box composite_check composite_unfit tool_shape tool_unfit)
diff <(echo "$exported") <(echo "$wanted" | sort -u)
verdict $? "the libraries export $(echo "$exported" | wc -l) names and no others" "the libraries export other names"
exit $fail

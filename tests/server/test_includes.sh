#!/usr/bin/env bash
# The modules of server include each other without a circle. A module is a noun: its header and its source are one node.
set -u

# one line MODULE INCLUDED for each include of another module of server
for file in "$KN_SOURCE"/server/*.[ch]; do
    module=$(basename "${file%.*}")
    sed -n 's/^ *# *include "server\/\([a-z_]*\)\.h"$/\1/p' "$file" | grep -vx "$module" | sed "s/^/$module /"
done | sort -u >includes
[ -s includes ] || { echo "FAIL no include found in server" && exit 1; }
tsort includes >order 2>circles && echo "ok   the includes of server have no circle" && exit 0
echo "FAIL a circle of includes in server:"
cat circles
exit 1

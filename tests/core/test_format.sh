#!/usr/bin/env bash
# Every C file has the format of .clang-format.
# gate in release: the files are the same in every build
set -u
cd "$KN_SOURCE" || exit 70
clang-format --version 2>/dev/null | grep -q ' version 14\.' || { echo "skipped: no clang-format 14 here; other versions format otherwise" && exit 77; }
mapfile -t files < <(find core server clients tests bench -name '*.[ch]')
[ ${#files[@]} -gt 500 ] || { echo "FAIL only ${#files[@]} files" && exit 1; }
clang-format --dry-run --Werror "${files[@]}" && echo "ok   ${#files[@]} files are formatted"

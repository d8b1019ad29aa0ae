#!/usr/bin/env bash
# Dependencies run one way: core <- server, clients; proto <- server, clients; everything <- tests, bench. The
# includes show the dependencies of the source, the symbols those of the object code.
#
# No include circle: a module is NAME.h with NAME.c, and includes what either of them includes. If its includes lead
# from module to module back to it, the modules of that circle cannot be read, tested or reused one without the others,
# and the test prints the circle's path. A private header NAME_parts.h counts with NAME. A source without a header
# is a module that no other can include, so it may be the place where modules meet that know nothing of each other
# (core/build.c).
set -u
cd "$KN_SOURCE" || exit 1
fail=0

# includes FOLDER PATTERN: check that every project include in the folder's files matches the pattern.
includes() {
    local found
    found=$(grep -rnE '^ *# *include +"' --include='*.[ch]' "$1" | grep -vE "include +\"($2)")
    [ -z "$found" ] && echo "ok   $1 includes only $2" && return
    printf 'FAIL %s may include only %s\n%s\n' "$1" "$2" "$found" && fail=1
}
includes core 'core/'
includes server 'core/|proto/|server/|hdl/(registers|knead_hash).h'
includes clients 'core/|proto/|server/|clients/|hdl/(registers|knead_hash).h|knead_hand.h' # the last one to copy, as its users do

# circles FOLDER...: check that the modules of these folders have no include circle.
circles() {
    local found
    found=$(grep -rnoE '^ *# *include +"(core|server|clients)/[^"]+\.h"' --include='*.[ch]' "$@" |
        sed -E 's/^([^:]+)\.[ch]:[^"]*"([^"]+)\.h"/\1 \2/; s/_parts\>//g' | awk '$1 != $2' | sort -u |
        tsort 2>&1 >/dev/null | awk '/a loop:$/ { printf "\n "; next } { printf " %s", $2 }')
    [ -z "$found" ] && echo "ok   no include circle in $*" && return
    printf 'FAIL include circles, each module includes the next:%s\n' "$found" && fail=1
}
circles core server clients

# core may use C library headers without clocks, threads, sockets or files. Only the scene parser uses YAML, and only the
# ensemble threads.
system='assert|complex|errno|float|immintrin|inttypes|limits|math|stdalign|stdarg|stdbool|stddef|stdint|stdio|stdlib|string'
found=$(grep -rnE '^ *# *include +<' --include='*.[ch]' core | grep -vE "<($system)\.h>" | grep -vE '^core/scene/[^:]*:[0-9]+: *#include <(yaml|ctype|sys/stat)\.h>|^core/ensemble.c:[0-9]+:#include <pthread.h>')
[ -z "$found" ] && echo "ok   core includes no clock, thread, socket or file header but the ensemble" || { printf 'FAIL %s\n' "$found" && fail=1; }

# libknead.a may call libm and these functions of libc. bcmp is clang's memcmp for tests of equality. (Names with __
# come from the compiler: assertions, sanitizers.)
libc='abort|aligned_alloc|bcmp|calloc|free|malloc|memcmp|memcpy|memmove|memset|qsort|snprintf|strcmp|strlen|strncmp|strspn|vsnprintf|pthread_(cond|mutex)_[a-z]+|pthread_(create|join)'
symbols() { nm -g "$@" | awk 'NF == 2 && $1 == "U" || NF == 3 { sub(/@.*/, "", $NF); print $NF }'; }
lib=$KN_BUILD/core/libknead.a
known() { symbols --defined-only "$lib" && symbols -D --defined-only "$(cc -print-file-name=libm.so.6)"; }
foreign=$(comm -23 <(symbols --undefined-only "$lib" | sort -u) <(known | sort -u) |
    grep -vE "^(__|_GLOBAL_OFFSET_TABLE_|($libc)\$)")
[ -z "$foreign" ] && echo "ok   libknead calls libm, memory and strings" || { printf 'FAIL libknead calls %s\n' $foreign && fail=1; }

# A shared function is defined in one library only, so that a program may link any of the libraries together.
libraries=$(find "$KN_BUILD" -name 'libknead*.a' ! -path '*/hdl/*')
twice=$(for one in $libraries; do symbols --defined-only "$one" | grep -E '^kn_' | sort -u; done | sort | uniq -d)
[ -n "$libraries" ] && [ -z "$twice" ] && echo "ok   no name is defined by two libraries" ||
    { printf 'FAIL defined by two libraries: %s\n' "$twice" && fail=1; }

# The servo reaches the lattice through server/backend/backend.h only.
found=$(grep -rnE '\b(kn_step|kn_scratch_create|kn_state_reset) *\(' --include='*.c' server | grep -v '^server/backend/')
[ -z "$found" ] && echo "ok   only server/backend steps the lattice" || { printf 'FAIL %s\n' "$found" && fail=1; }

# The top level holds the folders of the system and the files that every project has there. Without git it is not judged.
allowed='CMakeLists.txt|CMakePresets.json|README.md|LICENSE|CHANGELOG.md|CONTRIBUTING.md|server|core|hdl|clients|proto|tests|bench'
found=$(git ls-files 2>/dev/null | sed 's#/.*##' | sort -u | grep -vE "^(\..*|$allowed)\$")
[ -z "$found" ] && echo "ok   the top level holds nothing else" || { printf 'FAIL at the top level: %s\n' $found && fail=1; }

# The file that clients copy depends on no other file and is plain C99.
if grep -qE '^ *# *include +"(core/contact_model.h)"' core/contact_model.c &&
    ! grep -hE '^ *# *include +"' core/contact_model.[ch] | grep -v contact_model.h &&
    cc -std=c99 -pedantic -Wall -Wextra -Wconversion -Werror -I. -fsyntax-only core/contact_model.c; then
    echo "ok   contact_model is C99 and includes nothing else"
else
    echo "FAIL contact_model is to be C99 and to include nothing else" && fail=1
fi
exit $fail

#!/usr/bin/env bash
# The verdict of tests/run: which test results, and which records of a night, let a change pass.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70 # defines check

# One test for each kind of result, played by ctest itself.
cat >CMakeLists.txt <<'END'
cmake_minimum_required(VERSION 3.25)
project(results NONE)
enable_testing()
add_test(NAME core.good COMMAND true)
add_test(NAME core.bad COMMAND false)
add_test(NAME core.long COMMAND sleep 60)
add_test(NAME core.gone COMMAND ${CMAKE_BINARY_DIR}/none)
add_test(NAME core.left COMMAND sh -c "echo 'skipped: <no card> here'; exit 77")
set_tests_properties(core.left PROPERTIES SKIP_RETURN_CODE 77)
set_tests_properties(core.long PROPERTIES TIMEOUT 1)
END
cmake -S . -B played >/dev/null && ctest --test-dir played --output-junit "$PWD/tests.xml" >/dev/null 2>&1
"$KN_SOURCE/tests/rows" tests.xml >rows
result() { awk -v t="core.$1" '$1 == t { $1 = $2 = ""; print substr($0, 3) }' rows; }
check "a test that passed is recorded as passed" [ "$(result good)" = passed ]
for test in bad long gone; do check "a test that is $test is recorded as failed" grep -q '^failed' <(result $test); done
check "a test that cannot run is recorded as skipped with its reason" [ "$(result left)" = "skipped <no card> here" ]

# verdict SENTENCE EXIT STRICT LINE [ROW...]: judge core.a, which passed, and e2e.b and core.c with the given rows
verdict() {
    printf 'release %s\n' core.a e2e.b core.c >wanted
    printf 'release %s\n' "core.a 1.0 passed" "${@:5}" >rows
    "$KN_SOURCE/tests/summary" wanted rows "$3" >said
    check "$1" eval "[ $? = $2 ] && grep -qx '$4' said" || cat said
}
verdict "a run passes if all expected tests passed" 0 1 '3 passed, 0 failed, 0 skipped' "e2e.b 1.0 passed" "core.c 1.0 passed"
verdict "a failed test fails the run" 1 1 'failed  release core.c: why' "e2e.b 1.0 passed" "core.c 1.0 failed why"
verdict "a test that failed twice fails the run" 1 0 'failed  release e2e.b' "e2e.b 1.0 failed" "e2e.b 1.0 failed" "core.c 1.0 passed"
verdict "a test that did not run fails the run" 1 0 'not run release core.c' "e2e.b 1.0 passed"
verdict "a passed second attempt counts and is reported" 0 1 'again   release e2e.b: passed in attempt 2' "e2e.b 1.0 failed" "e2e.b 1.0 passed" \
    "core.c 1.0 passed"
verdict "a skipped end-to-end test does not fail a user's run" 0 0 'skipped release e2e.b: why' "e2e.b 1.0 skipped why" "core.c 1.0 passed"
verdict "a skipped end-to-end test fails CI" 1 1 'skipped release e2e.b: why' "e2e.b 1.0 skipped why" "core.c 1.0 passed"
verdict "any other skipped test does not fail CI" 0 1 'skipped release core.c: why' "e2e.b 1.0 passed" "core.c 1.0 skipped why"
verdict "any skipped test fails the nightly run" 1 2 'skipped release core.c: why' "e2e.b 1.0 passed" "core.c 1.0 skipped why"
"$KN_SOURCE/tests/summary" /dev/null /dev/null 0 >said
check "a run without any test fails" [ $? = 1 ]
printf 'release %s\n' core.a e2e.b >wanted
printf 'release core.a 1.0 %s\n' failed passed >rows

# Records in a git history of their own.
command -v git >/dev/null || { echo "no git here: records are left out" && exit $failed; }
for name in "${!GIT_@}"; do unset "$name"; done
export GIT_CONFIG_GLOBAL=/dev/null GIT_CONFIG_SYSTEM=/dev/null
source "$KN_SOURCE/tests/record.sh"
commit() { git add -A && git -c user.name=test -c user.email=test@localhost commit -q --allow-empty -m "$1"; }
judged() { record_judge >said; }
refused() { ! judged && grep -q "$1" said; }
git init -q history && cd history || exit 70
mkdir -p hdl server/backend tests/timed core
touch {hdl,server/backend,tests/timed,core}/a
commit start
check "a missing record is refused" refused 'there is none'
record_write "$(git rev-parse HEAD)" ../wanted ../rows red >/dev/null
commit red
check "the record of a failed run is refused" refused 'expected a green one'
record_write "$(git rev-parse HEAD)" ../wanted ../rows green >/dev/null
commit green
check "the record of a passed run is accepted" judged
check "the record counts attempts and names the tests that did not run" \
    [ "$(tail -2 $record | tr '\n' ,)" = 'release core.a 1.0 2 passed,release e2e.b 0 0 missing,' ]
for folder in hdl server/backend tests/timed; do
    echo changed >$folder/a
    commit changed
    check "a record does not cover a changed $folder" refused 'changed since'
    git reset -q --hard HEAD~
done
echo changed >core/a
check "an unchanged folder counts as the same" record_same hdl
check "a changed folder counts as different" eval '! record_same hdl core'
for ((i = 1; i < record_age_max; i++)); do commit $i; done
check "a record of $record_age_max commits ago is accepted" judged
commit last
check "an older record is refused" refused 'expected at most'
exit $failed

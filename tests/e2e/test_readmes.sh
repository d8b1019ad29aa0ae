#!/usr/bin/env bash
# The ```sh blocks of all READMEs, run as test_tutorials.sh runs those of the tutorials; most use knead probe.
# night: every page at its own pace
source "$KN_SOURCE/tests/e2e/test_tutorials.sh" README.md

#!/usr/bin/env bash
# The live page in Chromium as without WebGL: all checks of test_web.sh on pictures that knead web draws.
# night: a minute or more, and the drawing in software takes both processors
source "$KN_SOURCE/tests/e2e/test_web.sh" picture

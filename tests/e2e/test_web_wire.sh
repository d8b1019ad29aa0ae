#!/usr/bin/env bash
# knead web against whoever is no page, or a bad one: refused in words, and neither the pages nor the servo notice.
exec /usr/bin/python3 "$KN_SOURCE/tests/e2e/web_wire.py"

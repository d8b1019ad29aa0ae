#!/usr/bin/env bash
# knead web against invalid or misbehaving clients: they are refused in words, and neither the pages nor the servo are
# affected.
exec /usr/bin/python3 "$KN_SOURCE/tests/e2e/web_wire.py"

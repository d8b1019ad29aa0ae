#!/usr/bin/env bash
# knead web's orders, of several pages at once: each answered once and by its own page, recordings stopped by number.
exec /usr/bin/python3 "$KN_SOURCE/tests/e2e/web_orders.py"

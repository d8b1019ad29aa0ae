#!/usr/bin/env bash
# Orders to knead web from several pages at once: each is answered once and by its own page's queue. Recordings are
# stopped by number.
exec /usr/bin/python3 "$KN_SOURCE/tests/e2e/web_orders.py"

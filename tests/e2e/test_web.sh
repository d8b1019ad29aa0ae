#!/usr/bin/env bash
# The live page in Chromium, pressed by mouse. At night also by keys and finger, reset, left during a press, and
# viewed in light and dark.
for program in chromium chromedriver; do
    [ -x /usr/bin/$program ] || { echo "skipped: no $program here (packages chromium, chromium-driver)"; exit 77; }
done
/usr/bin/python3 -c 'import selenium' 2>/dev/null || { echo "skipped: no selenium here (package python3-selenium)"; exit 77; }
exec /usr/bin/python3 "$KN_SOURCE/tests/e2e/web_page.py" "$@"

"""Run the ```sh blocks of a page in one shell, as its reader types them, and compare what they print with the page.

A ```text block holds lines of the output of the block before it, in order; other lines may stand between them. Words must be the
same, numbers within TOLERANCE; ... stands for anything. A command that fails, or a promised line that does not come, is a failure.

    page_blocks.py PAGE [SETUP]      SETUP: lines for the shell before the first block
"""
import os
import re
import subprocess
import sys
import time

TOLERANCE = 0.05  # of a number, or one unit of its last digit where that is more
PATIENCE_S = 300
NUMBER = r'[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?'


def blocks(text):
    found = []
    for kind, body in re.findall(r'^```(sh|text)\n(.*?)^```', text, re.M | re.S):
        if kind == 'sh':
            found.append((body, []))
        else:
            found[-1][1].extend(line.split() for line in body.splitlines() if line.strip() not in ('', '...'))
    return found


def agrees(promised, line):
    parts = re.split(rf'({NUMBER}|\.\.\.)', ' '.join(promised))
    numbers = [part for part in parts[1::2] if part != '...']
    parts[::2] = [re.escape(part) for part in parts[::2]]
    parts[1::2] = ['.*' if part == '...' else f'({NUMBER})' for part in parts[1::2]]
    match = re.fullmatch(''.join(parts), ' '.join(line.split()))
    return bool(match) and all(
        abs(float(is_) - float(said)) <= max(TOLERANCE * abs(float(said)), 1.001 * 10.0 ** -len(said.partition('.')[2]))
        for said, is_ in zip(numbers, match.groups()))


def missing(promised, output):
    """Return the first promised line that the output lacks, or None."""
    lines = iter(output.splitlines())
    return next((' '.join(p) for p in promised if not any(agrees(p, line) for line in lines)), None)


def run(page, setup):
    failures = 0
    output = open('output', 'a')
    shell = subprocess.Popen(['bash'], stdin=subprocess.PIPE, stdout=output, stderr=output, text=True)
    shell.stdin.write(f"set -E\ntrap 'echo \"[failed: $BASH_COMMAND]\"' ERR\n{setup}\n")
    for number, (body, promised) in enumerate(blocks(open(page).read()), 1):
        start, end = os.path.getsize('output'), time.monotonic() + PATIENCE_S
        open('block', 'w').write(body)
        shell.stdin.write(f". ./block </dev/null\necho '[done {number}]'\n")
        shell.stdin.flush()
        while True:  # a server in the background speaks when it likes
            time.sleep(0.1)
            told = open('output', 'rb').read()[start:].decode()
            done, lacks = f'[done {number}]' in told, missing(promised, told)
            if done and not lacks or time.monotonic() > end or shell.poll() is not None or done and '[failed' in told:
                break
        wrong = not done and 'it does not end' or '[failed' in told and 'a command failed' or lacks and f'not said: {lacks}'
        failures += bool(wrong)
        print(f'{"FAIL" if wrong else "ok  "} {os.path.basename(page)} {number}: {body.splitlines()[0]}', flush=True)
        if wrong:
            print(f'{wrong}\n{told}')
            break
    shell.kill()
    return failures


sys.exit(run(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else ''))

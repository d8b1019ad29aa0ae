"""Run the ```sh blocks of a tutorial, or of a section of a README, in one shell, as their reader types them, and compare what they print with the page.

A ```text block holds lines of the output of the block before it, in order; other lines may stand between them. Words must be the
same, numbers within TOLERANCE; ... stands for anything. A command that fails, or a promised line that does not come, is a failure.

    page_blocks.py PAGE      KNEAD_USR: where /usr of the page is
"""
import os
import re
import signal
import subprocess
import sys
import time

TOLERANCE = 0.05  # of a number, or one unit of its last digit where that is more
PATIENCE_S, SERVER_S = 600, 20  # for a block to end; then for a server to say what it says
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
    parts[1::2] = ['.*?' if part == '...' else f'({NUMBER})' for part in parts[1::2]]
    match = re.fullmatch(''.join(parts), ' '.join(line.split()))
    return bool(match) and all(
        abs(float(is_) - float(said)) <= max(TOLERANCE * abs(float(said)), 1.001 * 10.0 ** -len(said.partition('.')[2]))
        for said, is_ in zip(numbers, match.groups()))


def missing(promised, output):
    """Return the first promised line that the output lacks, or None."""
    lines = iter(output.splitlines())
    return next((' '.join(p) for p in promised if not any(agrees(p, line) for line in lines)), None)


def run(page, text):
    shell = subprocess.Popen(['bash'], stdin=subprocess.PIPE, stdout=open('output', 'a'), stderr=subprocess.STDOUT, text=True,
                             start_new_session=True)
    shell.stdin.write('set -E\ntrap \'echo "[failed: $BASH_COMMAND]"\' ERR\nsudo() { "$@"; }\npython3() { /usr/bin/python3 "$@"; }\n')  # Debian's
    for number, (body, promised) in enumerate(blocks(text), 1):
        start, end = os.path.getsize('output'), time.monotonic() + PATIENCE_S
        with open('block', 'w') as file:
            file.write(body.replace('/usr/', os.environ['KNEAD_USR'] + '/'))
        shell.stdin.write(f". ./block </dev/null\necho '[done {number}]'\n")
        shell.stdin.flush()
        while True:  # a server in the background speaks when it likes
            time.sleep(0.1)
            with open('output', 'rb') as file:
                file.seek(start)
                told = file.read().decode()
            done, failed, lacks = f'[done {number}]' in told, '[failed' in told, missing(promised, told)
            if done:
                end = min(end, time.monotonic() + SERVER_S)
            if done and (failed or not lacks) or time.monotonic() > end:
                break
        wrong = failed or not done or lacks
        print(f'{"FAIL" if wrong else "ok  "} {os.path.basename(page)} {number}: {body.splitlines()[0]}', flush=True)
        if wrong:
            print(f'{"" if done else "it does not end"}\nnot said: {lacks}\n{told}')
            break
    os.killpg(shell.pid, signal.SIGKILL)  # what the page left running, too
    return bool(wrong)


page = sys.argv[1]
text = open(page).read()
sessions = re.split('(?m)^(?=## )', text) if page.endswith('README.md') else [text]
sys.exit(any(run(page, session) for session in sessions if blocks(session)))

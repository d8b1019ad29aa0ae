#!/usr/bin/env python3
"""Steps of 10 ms from Python beside the same from C: 64 states of 144 nodes, two steps an action, by turns.

    PYTHONPATH=build/release/python bench/learner.py      (after cmake --build --preset release)
"""
import os
import re
import subprocess
import time

import numpy as np

import knead

PROGRAM = os.path.join(os.path.dirname(knead.__file__), '../../bin/bench_learner')


def python_rate(states=64):
    """Return simulated time per time of the wall, with one thread."""
    batch = knead.Model(dt_s=0.01).batch(states)
    random = np.random.default_rng(1)
    batch.attached[:, 0], batch.position_m[:, 0] = True, (0, 0, 0.046)
    begin = time.monotonic()
    for action in range(50):
        batch.velocity_m_s[:, 0, :2] = random.uniform(-0.01, 0.01, (states, 2))
        batch.velocity_m_s[:, 0, 2] = -0.015 if action < 40 else 0.02
        batch.step(2)
        observation = np.concatenate([batch.force_n[:, 0], batch.top_m()], axis=1)
    assert observation.shape == (states, 39)
    return states * 50 * 0.02 / (time.monotonic() - begin)


def c_rate():
    text = subprocess.run([PROGRAM, '--batch'], capture_output=True, text=True, check=True).stdout
    return float(re.search(r'\|   144 \|       1 \| *\S+ *\| *([\d.]+) x', text)[1])


rates = [(python_rate(), c_rate()) for _ in range(3)]
best = [max(r) for r in zip(*rates)]
print(f'Python {best[0]:.1f} x, C {best[1]:.1f} x real time on one thread: Python has {100 * best[0] / best[1]:.0f} % of C')

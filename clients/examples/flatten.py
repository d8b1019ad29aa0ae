"""Learn to flatten dough: an environment in the form that learners expect, and a cross-entropy search on it.

    flatten.py [--states N] [--threads N] [--rounds N] [--picture FILE.png]

A plate of 2 x 6 cm presses a block of dough of 5 x 5 x 3 cm. An action is one press: where along x, and how low the
plate goes. An episode is six presses and 1 s of rest. The goal: a top that is 20 mm high everywhere.
"""
import argparse
import subprocess
import time

import numpy as np

import knead

DOUGH = """
version: 1
object: {size: [5 cm, 5 cm, 3 cm], spacing: 1 cm, structure: diagonals}
material: dough
gravity: 0 m/s^2
support: bonded
device: bench
probes: [{name: plate, shape: plate, size: [2 cm, 6 cm]}]
"""
GOAL_M, PRESSES, PRESS_S, REST_S, ABOVE_M = 0.020, 6, 0.5, 1.0, 0.032
LOW, HIGH = np.array([-0.025, 0.012]), np.array([0.025, 0.026])  # of an action: x and height of the plate, m


class Flatten:
    """N blocks of dough at once. An observation is the wrench on the plate, its x and height, and the top's heights."""

    def __init__(self, states, threads=2):
        self.batch = knead.Model(DOUGH, dt_s=0.01).batch(states, threads)

    def reset(self):
        """Return the observations of N fresh blocks, (N, 8 + top)."""
        self.batch.reset()
        self.count = 0
        return self.observe()

    def observe(self):
        b = self.batch
        return np.concatenate([b.force_n[:, 0], b.torque_n_m[:, 0], b.position_m[:, 0, ::2], b.top_m()], axis=1)

    def steps(self, seconds):
        self.batch.step(round(seconds / self.batch.model.dt_s))

    def step(self, action):
        """Press once: action (N, 2), x and lowest height of the plates in m. Return observations, rewards and the end."""
        b, action = self.batch, np.clip(action, LOW, HIGH)
        b.attached[:] = False  # lifted, the plate goes to its place
        b.step()
        b.attached[:], b.position_m[:, 0, 0], b.position_m[:, 0, 2] = True, action[:, 0], ABOVE_M
        b.velocity_m_s[:, 0, 2] = (action[:, 1] - ABOVE_M) / PRESS_S
        self.steps(PRESS_S)
        b.velocity_m_s[:, 0, 2] = 0
        self.steps(0.1)
        observation = self.observe()
        b.velocity_m_s[:, 0, 2] = 0.1
        self.steps(0.2)
        self.count += 1
        if self.count < PRESSES:
            return observation, np.zeros(len(b)), False
        b.attached[:], b.velocity_m_s[:] = False, 0
        self.steps(REST_S)
        return self.observe(), -np.abs(b.top_m() - GOAL_M).max(axis=1), True


def play(env, plans, seen=lambda env: None):
    """Play a plan of presses (N, PRESSES, 2) on each state and return the rewards (N,)."""
    env.reset()
    for press in range(PRESSES):
        seen(env)
        reward = env.step(plans[:, press])[1]
    seen(env)
    return reward


def search(env, rounds, seed=1):
    """Cross-entropy search: draw plans around a mean, keep the best eighth, draw around these. Return the best plan."""
    random, best, record = np.random.default_rng(seed), (None, -np.inf), []
    mean, spread = np.tile((LOW + HIGH) / 2, (PRESSES, 1)), np.tile((HIGH - LOW) / 3, (PRESSES, 1))
    for r in range(rounds):
        plans = np.clip(random.normal(mean, spread, (len(env.batch), PRESSES, 2)), LOW, HIGH)
        rewards = play(env, plans)
        elite = np.argsort(rewards)[-max(2, len(plans) // 8):]
        mean, spread = plans[elite].mean(axis=0), plans[elite].std(axis=0) + 1e-5
        if rewards[elite[-1]] > best[1]:
            best = plans[elite[-1]], rewards[elite[-1]]
        record.append(-1e3 * best[1])
        print(f'round {r + 1:2}: off by {record[-1]:.3f} mm at most', flush=True)
    return best[0], record


def picture(path, tops, x_m):
    """Draw the profile of the top before the first press, after each press, and at the end. Needs gnuplot."""
    across = np.unique(x_m.round(6))
    data = [[(1e3 * x, 1e3 * top[x_m.round(6) == x].mean()) for x in across] for top in tops]
    text = [f"set term pngcairo size 700, 300; set output '{path}'; set xlabel 'x, mm'; set ylabel 'height of the top, mm'",
            'set yrange [17:32]; set key outside']
    names = ['before'] + [f'press {i}' for i in range(1, PRESSES)] + ['at rest']
    text.append('plot ' + ', '.join(f"'-' with lines lw {3 if n[0] != 'p' else 1} title '{n}'" for n in names) +
                f", {1e3 * GOAL_M} dt 2 lc 'black' title 'goal'")
    text += ['\n'.join(f'{x} {z}' for x, z in line) + '\ne' for line in data]
    subprocess.run(['gnuplot'], input='\n'.join(text), text=True, check=True)


def main():
    options = argparse.ArgumentParser()
    for name, value in ('states', 64), ('threads', 2), ('rounds', 12):
        options.add_argument('--' + name, type=int, default=value)
    options.add_argument('--picture')
    options = options.parse_args()
    begin = time.monotonic()
    plan, _ = search(Flatten(options.states, options.threads), options.rounds)
    again = Flatten(1, threads=1)
    tops, at = [], again.batch.model.rest_m[again.batch.model.top, 0]
    off_mm = -1e3 * play(again, plan[None], lambda env: tops.append(env.batch.top_m()[0]))[0]
    if options.picture:
        picture(options.picture, tops, at)
    top = 1e3 * again.batch.top_m()[0]
    print('presses at x, down to', *(f'{1e3 * x:+.1f}, {1e3 * z:.1f};' for x, z in plan), 'mm')
    print(f'top  {top.min():.2f} to {top.max():.2f} mm, goal {1e3 * GOAL_M:.0f} mm, off by {off_mm:.3f} mm at most')
    print(f'hash {again.batch.hash()[0]:016x}')
    print(f'{time.monotonic() - begin:.0f} s')


if __name__ == '__main__':
    main()

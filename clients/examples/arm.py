# A rigid two-joint arm presses dough: at 100 Hz it gives its fingertip's pose to Knead and gets the wrench on it. Replace
# the class Arm by your simulator's arm. Run it twice: the same hash.
import numpy as np

import knead

SCENE = """
version: 1
object: {size: [5 cm, 5 cm, 3 cm], spacing: 1 cm, structure: diagonals}
material: dough
gravity: 0 m/s^2
support: bonded
device: bench
probes: [{name: finger, shape: sphere, radius: 1.5 cm, friction: 0.5, coupling: 2000 N/m, damping: 20 N*s/m}]
"""
DT_S, LINK_M, ELBOW_KG, TIP_KG = 0.01, 0.25, 1.0, 0.5


class Arm:
    """Two links in the plane y = 0, each 25 cm, with their masses at elbow and tip; gravity is balanced."""

    def __init__(self):
        self.q, self.dq, self.base = np.array([0.6, 1.6]), np.zeros(2), np.array([-0.20, 0.05])

    def tip(self):
        """Return position and velocity of the tip (x, z), and the Jacobian."""
        a, b = self.q[0], self.q[0] + self.q[1]
        j = LINK_M * np.array([[np.cos(a) + np.cos(b), np.cos(b)], [-np.sin(a) - np.sin(b), -np.sin(b)]])
        return self.base + LINK_M * np.array([np.sin(a) + np.sin(b), np.cos(a) + np.cos(b)]), j @ self.dq, j

    def step(self, goal, force_n):
        """Move for 10 ms: a spring and a damper pull the tip to the goal; the dough pushes it with force_n."""
        for _ in range(10):
            x, v, j = self.tip()
            torque = j.T @ (400 * (goal - x) - 40 * v + force_n)
            c, s = LINK_M**2 * TIP_KG * np.cos(self.q[1]), LINK_M**2 * TIP_KG * np.sin(self.q[1])
            tip = LINK_M**2 * TIP_KG
            mass = np.array([[LINK_M**2 * ELBOW_KG + 2 * tip + 2 * c, tip + c], [tip + c, tip]])
            turning = s * np.array([-2 * self.dq[0] * self.dq[1] - self.dq[1]**2, self.dq[0]**2])
            self.dq = self.dq + 0.001 * np.linalg.solve(mass, torque - turning)
            self.q = self.q + 0.001 * self.dq


arm, state = Arm(), knead.Model(SCENE, dt_s=DT_S).state()
finger, force = state['finger'], np.zeros(2)
for tick in range(300):  # 3 s: above the dough, down, along, up
    t = tick * DT_S
    goal = np.array([0.01 if t > 1.5 else 0, 0.06 if t < 0.5 or t > 2.2 else 0.03])
    arm.step(goal, force)
    x, v, _ = arm.tip()
    finger.position_m, finger.velocity_m_s = (x[0], 0, x[1]), (v[0], 0, v[1])
    state.step()
    force = finger.force_n[::2]
    if tick % 25 == 24:
        print(f'{t + DT_S:.2f} s   tip {1e3 * x[0]:6.1f} {1e3 * x[1]:6.1f} mm   force {force[0]:6.2f} {force[1]:6.2f} N')
print(f'hash {state.hash():016x}')

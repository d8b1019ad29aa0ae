"""Knead from Python: the force that a soft, permanently deforming object puts on a tool.

In a program of your own (needs numpy; all numbers in SI units, the same bits as in C):

    model = knead.Model('dough.yaml')      # or knead.Model(): a block of dough under a ball
    state = model.state()
    finger = state['finger']
    finger.position_m = 0, 0, 0.05
    finger.velocity_m_s = 0, 0, -0.01
    state.step(10)                         # 10 time steps; the pose moves with its velocity
    print(finger.force_n)

    batch = model.batch(64, threads=2)     # 64 states at once

As a hand of a running kneadd (needs nothing but Python): knead.Hand('finger').

Logs of kneadd as tables: knead.read_log('press.lcmlog'). Fits of measured curves: knead.identify('creep', 'curve.csv').
"""
from knead.hand import Hand
from knead.results import identify, read_log

__all__ = ['Batch', 'Error', 'Hand', 'Model', 'Scene', 'State', 'Tool', 'Touch', 'identify', 'read_log', 'version']


def __getattr__(name):
    """Load the library when it is first needed: Hand, identify and read_log do without it."""
    if name in ('Batch', 'Error', 'Model', 'Scene', 'State', 'Tool', 'Touch', 'version'):
        import knead.model
        return getattr(knead.model, name)
    raise AttributeError(f"module 'knead' has no attribute '{name}'")

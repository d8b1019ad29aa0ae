# The Python package knead as a program uses it: shapes, laws, equal bits by every way, refusals. Runs with PYTHONPATH.
import os
import sys
import weakref

sys.path.insert(0, os.path.join(os.environ["KN_SOURCE"], "tests/e2e"))
import numpy as np

import knead
import served
from served import check

SCENES = os.environ["KN_SOURCE"] + "/core/scenes/"


def refused(call, *words):  # return whether the call raises an error whose one line has these words
    try:
        call()
    except (knead.Error, ValueError, KeyError, OSError) as error:
        line = str(error)
        return "\n" not in line.strip() and all(w in line for w in words) or print("    ", type(error), line)
    return False


def press(state, tool, x=0.0):
    finger = state[tool]
    finger.position_m, finger.velocity_m_s = (x, 0, 0.046), (0, 0, -0.01)
    state.step(600)
    return finger


scene = knead.Scene(SCENES + "dough-small.yaml")
model = knead.Model(scene)
state = model.state()
finger = press(state, "finger")
check("a scene gives a model with its nodes, tools and step", (model.nodes, model.tools, model.dt_s) == (144, ("plate", "finger"), 1e-3))
check("a press gives a force upwards, work, and a torque of three numbers",
      finger.force_n[2] > 1 and finger.work_j > 0 and finger.torque_n_m.shape == (3,) and finger.contacts > 0, finger.force_n)
touch = finger.touch()
face = 0.03**2 / 64
check("the map of pressures adds up to the force along the normal",
      abs(touch.pressure_pa.sum() * face / (finger.force_n @ touch.normal) - 1) < 1e-9, touch.pressure_pa.sum() * face, finger.force_n)
check("nodes, surface, stress and permanent strain have the shapes that are written",
      state.positions_m().shape == (144, 3) and state.surface_m().shape[1] == 3 and model.triangles.max() < len(state.surface_m())
      and state.stress_pa().shape == (144,) and state.residual_strain().max() > 0.01)
check("the dough is dented where the finger is", state.positions_m()[model.top, 2].min() < 0.028)

saved, hash_then = state.snapshot(), state.hash()
finger.velocity_m_s = 0, 0, 0.02
state.step(300)
moved = state.hash()
state.restore(saved)
check("a snapshot brings back the state", state.hash() == hash_then != moved)
finger.position_m, finger.velocity_m_s = finger.position_m - [0, 0, 0.006], (0, 0, 0.02)
other = knead.Model(SCENES + "dough-small.yaml", "material.k1=1 kPa").state()
check("another material refuses the snapshot", refused(lambda: other.restore(saved), "another material"))
state.reset()
check("a reset gives the untouched object", state.hash() == model.state().hash() and state.tick == 0)

alone = [model.state() for _ in range(5)]
for i, s in enumerate(alone):
    press(s, "finger", 0.002 * i)
hashes = []
for threads in 1, 2, 3:
    batch = model.batch(5, threads)
    batch.attached[:, 1] = True
    batch.position_m[:, 1], batch.velocity_m_s[:, 1] = [(0.002 * i, 0, 0.046) for i in range(5)], (0, 0, -0.01)
    batch.step(600)
    hashes.append(batch.hash())
check("a batch has the bits of states alone, for 1, 2 and 3 threads",
      all((h == [s.hash() for s in alone]).all() for h in hashes), hashes)
check("a batch has the shapes that are written", batch.force_n.shape == (5, 2, 3) and batch.top_m().shape == (5, len(model.top))
      and batch.positions_m().shape == (5, 144, 3) and (batch.force_n[:, 1] == [s["finger"].force_n for s in alone]).all())
twice = model.batch(1)
twice.attached, twice.position_m, twice.velocity_m_s = [[False, True]], (0, 0, 0.046), (0, 0, -0.01)
for _ in range(30):
    twice.step(20)
check("assigned arrays are read, and 30 x 20 steps have the bits of 600", twice.hash()[0] == alone[0].hash(), twice.hash())
def write():
    twice.force_n[:] = 0
check("forces cannot be written", refused(write, "read-only"))
felt = twice.force_n.copy()
twice.reset([])
check("a reset of no state resets none", twice[0].tick == 600 and (twice.force_n == felt).all())
twice.reset()
check("a reset forgets forces, velocities and the touch", not twice.force_n.any() and not twice.velocity_m_s.any()
      and twice[0]["finger"].touch().area_m2 == 0)
rest = knead.Model().rest_m
check("the rest positions outlive their model and cannot be written", rest.shape == (144, 3) and not rest.flags.writeable and rest.max() == 0.03)
check("a state of a batch reads like one alone", (batch[3].stress_pa() == alone[3].stress_pa()).all() and batch[-1].hash() == alone[4].hash())

check("an unknown tool is refused by its name", refused(lambda: state["thumb"], "thumb", "plate, finger"))
check("a scene that is not there is refused in one line", refused(lambda: knead.Scene("missing.yaml"), "missing.yaml"))
check("a scene is found by its name", knead.Scene("dough-small").text == scene.text)
check("a key that a scene does not know is refused", refused(lambda: knead.Scene(SCENES + "dough-small.yaml", "object.colour=red"), "colour"))
check("a step of 0 s is refused", refused(lambda: knead.Model(dt_s=0.0), "dt must be"))
check("0 steps, 0 states and a single step within a batch are refused",
      refused(lambda: state.step(0), "0 steps") and refused(lambda: model.batch(0), "count") and refused(lambda: batch[0].step(), "batch.step()"))
state["finger"].position_m = np.nan, 0, 0
check("a position that is no number is an error, and the force is 0", refused(state.step, "not finite") and not state["finger"].force_n.any())
state.reset()
state["finger"].position_m = 0, 0, 1
check("after a reset it goes on", not refused(state.step))
kept = weakref.ref(model)
del scene, model, alone, batch, state, finger, other, s, twice
check("a model ends with its last state", kept() is None)

if len(sys.argv) > 1:  # a log of kneadd, and a measured curve
    log = knead.read_log(sys.argv[1])
    force, pose = log["KNEAD_FORCE_plate"], log["KNEAD_POSE_plate"]
    check("a log is tables: poses and forces in order", len(force) > 500 and force["contact_force_n"].shape == (len(force), 3)
          and (np.diff(force["tick"]) > 0).all() and force["contact_force_n"][:, 2].max() > 1 and pose["position_m"].shape[1] == 3)
    check("messages with texts are objects", "version: 1" in log["KNEAD_SCENE"][0].text)
    open("damaged.lcmlog", "wb").write(open(sys.argv[1], "rb").read()[:-5])
    check("a damaged log is refused", refused(lambda: knead.read_log("damaged.lcmlog"), "damaged"))
    check("a missing curve is refused", refused(lambda: knead.identify("creep", "missing.csv"), "missing.csv"))
    fit = knead.identify("creep", sys.argv[2])
    check("a fit of a curve is a dict with its parameters", "k1" in str(fit), str(fit)[:300])
sys.exit(served.failed)

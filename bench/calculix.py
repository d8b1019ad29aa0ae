#!/usr/bin/python3
# Is `knead identify press` worth something on lumps of another law and another solver? CalculiX presses soft lumps, and the
# fit of one press predicts the others.
#
#     apt-get install -y calculix-ccx python3-numpy
#     PATH=$PWD/build/release/bin:$PATH bench/calculix.py [--lumps 20] [--only 0,3] [--dir DIR]      hours; DIR keeps what is done
#
# Lump: block of 4 x 4 x 2 cm, base held, a quarter of it in n^3 C3D8 elements, large deformation. It is elastic (E, nu), and the
# deviator creeps by Norton's law, rate = A stress^n. In every second lump a neo-Hookean network lies beside it, so that the force
# relaxes to a rest. Presses: a ball of 1.5 cm (fitted); held out: the same at 4 times the speed, a ball of 2.5 cm, and a plate of
# 2 x 2 cm that sticks. Balls have frictionless penalty contact. Units of the decks: N, mm, s, MPa.
import argparse, csv, json, os, re, subprocess, time
import numpy as np

HALF, HIGH, N, NEAR = 20.0, 20.0, 7, 0.7  # the first of N elements is NEAR of their mean size
NOISE, READ_HZ, ABOVE_MM, HOLD_S = 0.01, 100, 0.5, 1.0


def fine_near_zero(length):
    s = np.linspace(0, 1, N + 1)
    return length * (NEAR * s + (1 - NEAR) * s**2)


def write_deck(path, lump, radius, steps):
    """radius: of the ball; None: the plate. steps: (seconds, depth at the end, largest increment)"""
    side, up = fine_near_zero(HALF), HIGH - fine_near_zero(HIGH)[::-1]
    side[np.argmin(abs(side - 10))] = 10  # the plate's edge
    m, cells, nodes = N + 1, range(N), range(N + 1)
    node = lambda i, j, k: 1 + i + m * (j + m * k)
    brick = lambda at: [at(a, b, c) for c in (0, 1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    lines = ["*NODE"] + [f"{node(i, j, k)},{side[i]:.6f},{side[j]:.6f},{up[k]:.6f}" for k in nodes for j in nodes for i in nodes]
    bricks = [brick(lambda a, b, c: node(i + a, j + b, k + c)) for k in cells for j in cells for i in cells]

    def elements(name, first, rows, material):
        lines.extend([f"*ELEMENT,TYPE=C3D8,ELSET={name}"] + [",".join(map(str, [first + e] + q)) for e, q in enumerate(rows)])
        lines.extend([f"*MATERIAL,NAME=M{name}"] + material + [f"*SOLID SECTION,ELSET={name},MATERIAL=M{name}"])

    def node_set(name, members):
        lines.extend([f"*NSET,NSET={name}"] + [f"{v}," for v in members])

    E, nu = lump["E"], lump["nu"]
    flows = E * (1 - lump["rest"])
    elements("FLOWS", 1, bricks, ["*ELASTIC", f"{flows:.9g},{nu:.9g}", "*CREEP,LAW=NORTON", f"{lump['A']:.9g},{lump['n']:.9g},0"])
    if lump["rest"] > 0:
        rests = E * lump["rest"]
        c10, d1 = rests / (4 * (1 + nu)), 6 * (1 - 2 * nu) / rests
        elements("RESTS", 1001, bricks, ["*HYPERELASTIC,NEO HOOKE", f"{c10:.9g},{d1:.9g}"])
    node_set("BASE", [node(i, j, 0) for j in nodes for i in nodes])
    node_set("X0", [node(0, j, k) for j in nodes for k in nodes[1:]])
    node_set("Y0", [node(i, 0, k) for i in nodes for k in nodes[1:]])
    if radius:  # a patch of the ball; all its nodes are moved
        angle = np.tan(np.radians(np.arange(-6, 58, 3.0)))
        w, first = len(angle), 3000
        at = lambda a, b, c: first + a + w * (b + w * c)
        lines.append("*NODE,NSET=TOOL")
        for c, r in enumerate((radius, 0.8 * radius)):
            for b in range(w):
                for a in range(w):
                    d = np.array([angle[a], angle[b], -1])
                    x = r * d / np.linalg.norm(d) + [0, 0, HIGH + radius]
                    lines.append(f"{at(a, b, c)},{x[0]:.6f},{x[1]:.6f},{x[2]:.6f}")
        shell = [brick(lambda p, q, c: at(a + p, b + q, c)) for b in range(w - 1) for a in range(w - 1)]
        elements("BALL", 3000, shell, ["*ELASTIC", f"{100 * E:.9g},0.3"])
        node_set("TOP", [node(i, j, N) for j in nodes for i in nodes if np.hypot(side[i], side[j]) < 0.95 * radius])
        lines += ["*SURFACE,NAME=SB", "BALL,S1", "*SURFACE,NAME=ST,TYPE=NODE", "TOP,", "*SURFACE INTERACTION,NAME=SI",
                  "*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR", f"{50 * E:.9g},0,0",
                  "*CONTACT PAIR,INTERACTION=SI,TYPE=NODE TO SURFACE", "ST,SB"]
    else:
        node_set("TOOL", [node(i, j, N) for j in nodes for i in nodes if max(side[i], side[j]) <= 10])
    lines += ["*BOUNDARY", "BASE,1,3", "X0,1,1", "Y0,2,2"]
    for seconds, depth, most in steps:  # without AMPLITUDE=RAMP a *VISCO step loads at once
        lines += ["*STEP,NLGEOM,AMPLITUDE=RAMP,INC=10000", "*VISCO,CETOL=0.05",
                  f"{most:.9g},{seconds:.9g},{1e-6 * seconds:.3g},{most:.9g}", "*BOUNDARY", "TOOL,1,2", f"TOOL,3,3,{-depth:.9g}",
                  "*NODE PRINT,NSET=BASE,TOTALS=ONLY", "RF", "*END STEP"]
    with open(path + ".inp", "w") as f:
        f.write("\n".join(lines) + "\n")


def press(folder, name, lump, radius, depth, speed, leave):
    """Return times and forces of the press, from ccx or from an earlier run of it."""
    path, down = os.path.join(folder, name), depth / speed
    steps = [(down, depth, down / 20), (0.2, depth, 0.02), (HOLD_S - 0.2, depth, 0.05)] + ([(down, 0, down / 20)] if leave else [])
    if not os.path.exists(path + ".npy"):
        write_deck(path, lump, radius, steps)
        subprocess.run(["ccx", name], cwd=folder, capture_output=True, timeout=600)
        text = open(path + ".dat").read()
        rows = re.findall(r"time\s+(\S+)\s+\S+\s+\S+\s+(\S+)", text)
        got = np.array([[0, 0]] + [[float(t), 4 * float(force)] for t, force in rows])
        for end in (".inp", ".frd", ".cvg", ".12d"):
            if os.path.exists(path + end): os.remove(path + end)
        if got[-1, 0] < sum(s[0] for s in steps) - 1e-6: raise RuntimeError(f"ccx stopped {name} at {got[-1, 0]:.3g} s")
        np.save(path + ".npy", got)
    time_s, force = np.load(path + ".npy").T
    corner = np.cumsum([0, down, HOLD_S, down])
    return time_s, force, lambda t: np.interp(t, corner, [0, depth, depth, 0 if leave else depth])


def write_csv(path, time_s, force, depth_at, speed, tool, dice):
    before = ABOVE_MM / speed
    t = np.arange(-before, time_s[-1], min(1 / READ_HZ, 0.02 * ABOVE_MM / speed * 5))
    depth = np.where(t < 0, t * speed, depth_at(t))
    read = np.interp(t, time_s, force) + NOISE * force.max() * dice.standard_normal(len(t))
    with open(path, "w") as f:
        f.write(f"# tool: {tool}\ntime_s,force_N,depth_mm\n")
        for row in zip(t + before, read, depth): f.write("%.5g,%.6g,%.6g\n" % row)


def draw_lump(dice, i):
    log = lambda low, high: low * (high / low) ** dice.random()
    E, n, decay = log(0.003, 0.1), dice.uniform(1, 4), log(0.2, 3)
    return dict(E=E, nu=dice.uniform(0.3, 0.47), n=n, A=(0.1 * E) ** (1 - n) / (E * decay), decay=decay,
                rest=dice.uniform(0.1, 0.5) if i % 2 else 0, depth=dice.uniform(3, 5), speed=log(5, 20), leave=i % 4 > 1)


def measure(folder, lump, dice):
    d, v = lump["depth"], lump["speed"]
    for name, radius, depth, speed, leave, tool in (
            ("fit", 15, d, v, lump["leave"], "ball"), ("fast", 15, d, 4 * v, False, "ball"),
            ("big", 25, d, v, False, "big"), ("plate", None, 0.6 * d, v, False, "plate")):
        t, f, depth_at = press(folder, name, lump, radius, depth, speed, leave)
        if name == "fit":
            lump["relax"] = 1 - np.interp(d / v + HOLD_S, t, f) / np.interp(d / v, t, f)
            if not 0.2 <= lump["relax"] <= 0.7: return False
        write_csv(os.path.join(folder, name + ".csv"), t, f, depth_at, speed, tool, dice)
    return True


def identify(folder):
    with open(os.path.join(folder, "block.yaml"), "w") as f:
        f.write("version: 1\nobject: {size: [4 cm, 4 cm, 2 cm], spacing: 1 cm, diagonal_stiffness: 0.08, pressure: cells, "
                "inside_pressure: 1 atm}\nmaterial: dough\nsupport: bonded\ngravity: 0 m/s^2\n"
                "device: bench\nprobes:\n  - {name: ball, shape: sphere, radius: 1.5 cm}\n  - {name: big, shape: sphere, radius: 2.5 cm}\n"
                "  - {name: plate, shape: plate, size: [2 cm, 2 cm]}\n")
    held = [v for name in ("fast", "big", "plate") for v in ("--held", name + ".csv")]
    begin = time.time()
    said, bands = os.path.join(folder, "said.json"), "bands.csv"
    if not os.path.exists(said):
        command = ["knead", "identify", "press", "fit.csv", *held, "--object", "block.yaml", "--tool", "ball",
                   "--compliance", "0 mm/N", "--csv", bands, "--json", "--out", "mine.yaml", "--anyway"]
        r = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=1800)
        with open(said, "w") as f: json.dump([r.returncode, r.stdout, r.stderr, time.time() - begin], f)
    code, text, complaint, seconds = json.load(open(said))
    out = dict(code=code, seconds=seconds)
    if code: return dict(out, error=complaint.strip()[-300:])
    told = json.loads(text[text.index("{"):])
    out.update(left={p["name"]: p["left"] for p in told["presses"]}, band={p["name"]: p["band"] for p in told["presses"]})
    rows = list(csv.DictReader(open(os.path.join(folder, bands))))
    for name in out["left"]:
        of = [[float(q[k]) for k in ("force_n", "fit_n", "band_n")] for q in rows if q["press"] == name]
        force, fit, band = np.array(of).T
        out.setdefault("inside", {})[name] = float(np.mean(abs(force - fit) <= band))
        out.setdefault("bias", {})[name] = float(np.sum(fit - force) / np.sum(force))
    return out


def main():
    p = argparse.ArgumentParser()
    p.add_argument("--lumps", type=int, default=20)
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--dir", default="lumps")
    p.add_argument("--only", default="")
    opt = p.parse_args()
    only, results = [int(v) for v in opt.only.split(",") if v], []
    names = ("fit", "fast", "big", "plate")
    print("lump  E kPa   nu    n  rest relax | left %: fit  fast   big plate | in band %: fast big plate | band %: fast big plate | s")
    for i in only or range(opt.lumps):
        for draw in range(20):
            dice = np.random.default_rng([opt.seed, i, draw])
            lump, folder = draw_lump(dice, i), os.path.join(opt.dir, f"{opt.seed}-{i:02d}-{draw}")
            os.makedirs(folder, exist_ok=True)
            try:
                if measure(folder, lump, dice): break
            except Exception as e: print(f"{i:4d}  ccx: {e}", flush=True)
        else: continue
        r = identify(folder)
        head = f"{i:4d} {1e3 * lump['E']:6.1f} {lump['nu']:.2f} {lump['n']:.2f} {lump['rest']:5.2f} {lump['relax']:.2f}  |"
        if r["code"]:
            print(head, f"exit {r['code']} after {r['seconds']:.0f} s: {r['error']}", flush=True)
            continue
        row = lambda of, which: " ".join(f"{100 * of[k]:5.1f}" for k in which)
        print(head, "     ", row(r["left"], names), "|     ", row(r["inside"], names[1:]), "|   ", row(r["band"], names[1:]),
              f"| {r['seconds']:.0f}", "refused" if r["left"]["fit"] > 0.15 else "", flush=True)
        results.append(dict(r, lump=lump))
    good = [r for r in results if r["left"]["fit"] <= 0.15]
    print(f"\n{len(results)} fits, {len(results) - len(good)} refused (more than 15 % left)")
    for k in names[1:]:
        left, inside = [np.array([r[of][k] for r in good]) for of in ("left", "inside")]
        print(f"{k:6s} held-out error <= 10 %: {np.mean(left <= 0.1):.0%} of the lumps, median {np.median(left):.1%}, "
              f"worst {left.max():.1%}; "
              f"force too high by {np.median([r['bias'][k] for r in good]):+.0%} (median); readings in the band: {inside.mean():.0%}")


main()

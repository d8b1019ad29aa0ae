# The text of RESULTS.md, made from the measures of bench/papers, and the statements that the numbers must confirm.
import platform
import re
import subprocess

GF = 0.00980665  # N
# The same equations by an independent integrator: load, gf -> displacement cm and stress gf/cm^2 at release, residual
# and recovered cm 70 s later.
APART = {10: (0.0363, 9.64, 0.0158, 0.0205), 30: (0.210, 23.7, 0.159, 0.051), 50: (0.473, 26.3, 0.416, 0.058),
         70: (0.648, 24.6, 0.594, 0.054), 90: (0.746, 22.8, 0.696, 0.050)}
STRUCTURES = {"a": "(a) diagonals", "b": "(b) grid + 2 % diagonals + 1 atm", "c": "(c) diagonals + 1 atm",
              "grid": "grid only"}
MATERIALS = {"dough-viscoelastic": "viscoelastic", "dough-plastic": "plastic", "dough": "rheological"}
GRAVITY = {"gravity-dough": "dough, eq. 7 damper", "gravity-gas": "dough with gas, (c)",
           "gravity-plastic": "plastic dough, eq. 7 damper",
           "gravity-linear": "linear damper c2(50 gf/cm2) = 1387 gf s/cm3",
           "gravity-grid": "dough, grid only, leaning 2 % at first"}

HEAD = """# The two papers' figures, measured

Written by `{command}` on {machine};
do not edit. Paper 1 is *Construction of virtual rheological objects*, which identifies the dough and compares
structures; paper 2, in Japanese, has viscoelastic, plastic and rheological objects of one three-element model.

Where a number comes from: **measured** is what the paper's authors measured on real dough; **model** is what the
paper's own equation or simulation says; **ours** is this program. What was not at hand: every photograph and
picture of the papers (paper 1's Fig. 10 of the real block, the computed shapes of its Figs 11 and 12, its measured
curves of Figs 6 to 9, paper 2's Figs 3 to 6). So shapes are compared with the papers' sentences, not with their
pictures. Two things are reconstructions: the order of paper 1's Fig. 2 (g)-(k) (`knead element --catalogue` says
which entries the text forces), and the middle branch of paper 2's eq. 7, for which paper 1's eq. 6 stands.
"""

CREEP = """## Paper 1, Figs 6 to 9: creep of a 1 cm cube

`knead creep dough --load 10gf,30gf,50gf,70gf,90gf`: 60 s loaded, 70 s not, one element; `creep.png`. The text
prints numbers of one test, 50 gf; the other loads are what its model predicts, not its data. Ours, and in italics
another integrator of the same equations, written apart:

{family}
{fifty}
The authors fitted the parameters to this very test: the difference is what the element misses with the numbers that
they print.

A lattice of 3 x 3 x 3 cells with the same numbers does not follow the element. Displacement in cm after 60 s under
the weight, which a level plate carries; the block slides on the table and sticks to the plate
(`knead creep dough --lattice 3x3x3`, with the structures (a) to (c) of Fig. 4):

{lattice}
Two causes. The element's section grows as its height falls, as if it kept its volume. A lattice without gas (a) loses
volume instead, so its section does not grow, its stress stays higher, and it runs away. With gas (b, c), the edges that
flattening stretches sideways resist it ever more. And edges do not share the load evenly: gamma makes a block under a
small constant stress creep as the element does, within 0.1 % where the damper is constant (to 4 gf/cm2), 11 % about
10 gf/cm2, where only the sides along the load thin, 7 % from 20 to 70 (`tests/physics/test_creep.c`).

"""

BLOCK = """## Paper 1, Figs 10 to 12: a 5 x 5 x 3 cm block under a 1 cm plate

1 cm/s to 1 cm, {hold} s there, lifted; the plate sticks and is as long as the block. `structures-3d.png`,
`structures-2d.png`, the side faces in `profile-3d.png` and `profile-2d.png`, `force.png`.

| statement of the paper | whose | here |
|---|---|---|
| side faces expand at the deformed shape (Fig. 10) | measured, no number | all structures that stand |
| with diagonals, (a), "quite smaller" than the real ones (Fig. 11) | model against measured | (a) is least |
| they expand more in (b) and (c) than in (a) (Fig. 12) | model | see "to (a)" |
| the sides of (b) are "more similar" to the real ones (Figs 12, 10) | model against measured | no photograph |
| how the block was held | not said | bonded; beside it the peak when it slides on the table |

(b) has 2 % diagonals, because a grid with pressure alone shears away as a mechanism. Fig. 12 is two-dimensional,
and so is the last part of the table, a slice 5 cm thick. All its numbers are ours. Bulge: greatest way outwards of
the faces across x and y at the end of the hold; cell: least V/V0 of a cell at any time, below 0 inside out; dip:
greatest fall of the force while the plate goes down at full speed; end: force at the end of the hold; left: depth
of the dent after the release.

{table}
Without gas the force of (a) falls by {dip} gf on the way down: the dough flows, and at 0.5 cm cells beside the plate's
edge fold (`force.png`; black in the two-dimensional pictures). With gas it rises to the end and no cell folds.

"""

THREE = """## Paper 2, Figs 3 to 6: three materials

Initial, deformed, stationary: `materials-2d.png`, `materials-3d.png`. The paper prints neither constants nor sizes
nor numbers for these figures, only what happens (model): a viscoelastic object returns (Fig. 4), a plastic one
stays (Fig. 5), a rheological one does some of both (Fig. 3), and in three dimensions the sides bulge (Fig. 6).
Ours: the dough of paper 1 by paper 2's rules (`dough-viscoelastic`: a_min = a_max = 1; `dough-plastic`: k = 0 and
c1 >> c2; `dough`) on `disc.msh`, triangles 5 cm thick under a 3 cm plate, and on `block.msh`, tetrahedra whose
whole top goes down; held 5 s. Left: depth of the dent {rest} s after the release began; left of all nodes: |u| then
/ |u| when pressed.

{table}
"""

WEIGHT = """## Paper 2, section 6: keeping its shape under gravity

The paper's statement (model, no numbers): with a plain damper rheological and plastic objects lose their shape in
the course of time, with the force-dependent one (eq. 7) they keep it. Ours: the same block, spacing 1 cm, under
9.81 m/s^2, beside what `knead check` predicts from the material alone:

{table}
"""

LATTICES = """## The same press on a grid and on tetrahedra

Ours alone, no paper has it; `lattices.png`. Peak force of the press above (diagonals, no gas, bonded), which comes
0.3 mm down. All these lattices have one E, but each its own nu, and its own G over that of an isotropic body of its E
and nu; only those that agree in these, too, have a force in common to converge to. So each net stands beside the grid
that is most like it.{none}

A grid whose springs are all alike (nu 0.35, G 2.3 times isotropic) and regular tetrahedra, six to each of its cubes:

{regular}
A grid whose diagonals are 3/11 as stiff as its sides (nu 1/4, G isotropic: the only such grid), and tetrahedra as Gmsh
likes them, with lines where the plate's edges are. Each free net is another net, a few per cent off in its own way:

{free}
{gas}"""

GAS = """And with gas, (c), pressed 1 cm, where the force is greatest. Tetrahedra lock: the gas of each holds its own
volume, and there are five or six of them for each cell of a grid and only as many nodes to move.

{table}
"""


def table(head, rows):
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    return "".join("| " + " | ".join(str(c) for c in row) + " |\n" for row in lines)


def cm(metres, digits=3):
    return f"{100 * metres:.{digits}f}"


def percent(share, digits=1):
    return f"{100 * share:.{digits}f} %"


def gf(newton):
    return f"{newton / GF:.0f}"


class Claims:
    def __init__(self):
        self.rows = []

    def add(self, statement, value, met):
        self.rows.append((statement, value, "yes" if met else "no"))


def under(block, element):  # displacement of a lattice under a weight, and by how much it differs from the element's
    if len(block) == 1:
        return f"flat after {block[0]:g} s"
    return f"{block[3]:.4f} ({100 * (block[3] / element - 1):+.0f} %)"


def creep(both, claims):
    rows, family = both["element"], []
    lattice = [[f"{load} gf", f"{rows[load][3]:.4f}", *(under(both[kind][load], rows[load][3]) for kind in "abc")]
               for load in sorted(rows)]
    for load, (_, stress, _, strain, back, left) in sorted(rows.items()):
        other = [f"*{v:g}*" for v in APART[load]]
        family.append([f"{load} gf", f"{strain:.4f} {other[0]}", f"{stress:.2f} {other[1]}", f"{left:.4f} {other[2]}",
                       f"{back:.4f} {other[3]}"])
    _, stress, height, strain, back, _ = rows[50]
    fifty = [("stress at release, gf/cm2", "28", "-", f"{stress:.2f} ({100 * (stress / 28 - 1):+.1f} %)"),
             ("displacement that eq. 4 makes of that stress, cm", "0.44", "-",
              f"{strain:.4f} ({100 * (strain / 0.44 - 1):+.1f} %)"),
             ("height that eq. 4 makes of it, cm", "0.56", "-", f"{height:.4f}"),
             ("what bounces back, cm", "-", "0.0596 (eq. 5, from 28)", f"{back:.4f}")]
    claims.add("creep at 50 gf: 26.33 gf/cm2 and 0.5266 cm after 60 s", f"{stress:.2f}, {height:.4f}",
               abs(stress - 26.33) < 0.01 and abs(height - 0.5266) < 1e-4)
    worst = max(abs(r[3] / APART[load][0] - 1) for load, r in rows.items())
    claims.add("creep at 10 to 90 gf as the other integrator has it, within 1 %", percent(worst, 2), worst < 0.01)
    return CREEP.format(
        family=table(["load", "displacement cm", "P gf/cm2", "residual cm", "recovered cm"], family),
        fifty=table(["50 gf", "measured", "model", "ours"], fifty),
        lattice=table(["load", "element", "(a)", "(b)", "(c)"], lattice))


def structure_row(name, d, a, other):
    def bulge(key):
        return [cm(d[key]), "-" if d is a else f"{d[key] / a[key]:.1f}"]
    return [name, *bulge("bulge_x_m"), *(bulge("bulge_y_m") if other else ["-", "-"]), percent(d["volume"]),
            f"{d['least_cell']:.2f}", gf(d["peak_n"]), gf(other["peak_n"]) if other else "-", gf(d["end_n"]),
            gf(d["dip_n"]), cm(d["left_m"], 2)]


def structures(done, quick, claims):
    rows, h = [], "1" if quick else "0.5"
    for key, label in [("block-1", "3-D, 1 cm"), ("block-0.5", "3-D, 0.5 cm"), ("flat-0.5", "2-D, 0.5 cm")]:
        for s, name in STRUCTURES.items():
            d = done.get(f"{key}-{s}")
            if d and s == "grid":
                rows.append((f"{label}: {name}", *["-"] * 6, gf(d["peak_n"]), "-", gf(d["end_n"]), "-", "falls"))
            elif d:
                other = done.get(f"sliding{key[5:]}-{s}") if key.startswith("block") else None
                rows.append(structure_row(f"{label}: {name}", d, done[f"{key}-a"], other))
    a = done[f"block-{h}-a"]
    for name, least, limit in (("b", 3, 0.015), ("c", 2, 0.03)):
        d = done[f"block-{h}-{name}"]
        for k in "xy":
            r = d[f"bulge_{k}_m"] / a[f"bulge_{k}_m"]
            claims.add(f"bulge along {k}: ({name})/(a) at least {least}, h = {h} cm", f"{r:.2f}", r >= least)
        if not quick:  # the volume recovers while the plate stands still
            claims.add(f"volume of ({name}) changes by at most {percent(limit)}, h = {h} cm", percent(d["volume"], 2),
                       abs(d["volume"]) <= limit)
        claims.add(f"dip of ({name}) at most 1 % of its peak", percent(d["dip_n"] / d["peak_n"], 2),
                   d["dip_n"] <= 0.01 * d["peak_n"])
        claims.add(f"no cell of ({name}) inside out", f"{d['least_cell']:.2f}", d["least_cell"] > 0)
    head = ["lattice", "bulge x cm", "to (a)", "bulge y cm", "to (a)", "volume", "cell", "peak gf", "sliding", "end gf",
            "dip gf", "left cm"]
    return BLOCK.format(hold=3 if quick else 30, dip=gf(a["dip_n"]), table=table(head, rows))


def materials(done, quick, claims):
    rows = []
    for shape, name in (("disc", "2-D"), ("tets", "3-D")):
        for m, kind in MATERIALS.items():
            d = done[f"{shape}-{m}"]
            rows.append((f"{name} {kind}", cm(d["pressed_m"], 2), cm(d["left_m"]), cm(d["pressed_m"] - d["left_m"]),
                         percent(d["left_m"] / d["pressed_m"]), percent(d["left_share"]), cm(d["bulge_x_m"])))
        v, p, r = (done[f"{shape}-{m}"]["left_share"] for m in MATERIALS)
        claims.add(f"{name}: residual viscoelastic < rheological < plastic",
                   f"{percent(v)}, {percent(r)}, {percent(p)}", v < r < p)
        claims.add(f"{name}: viscoelastic leaves less than 5 %, plastic more than 95 %", f"{percent(v)}, {percent(p)}",
                   v < 0.05 and p > 0.95)
    bulges = [done[f"tets-{m}"]["bulge_x_m"] for m in MATERIALS]
    claims.add("3-D: the sides of all three bulge", ", ".join(cm(b, 2) for b in bulges) + " cm", min(bulges) > 1e-3)
    return THREE.format(rest=20 if quick else 60, table=table(
        ["object", "pressed cm", "left cm", "came back cm", "left", "left of all nodes", "bulge x cm"], rows))


def gravity(done, guesses, claims):
    rows = []
    for key, name in GRAVITY.items():
        d, g = done[key], guesses[key]
        falls = key == "gravity-grid"
        sag = f"half its height in {d['fallen_s']:.2f} s" if falls else f"{percent(d['sag'], 2)} in 300 s"
        rows.append((name, sag, f"{g[0]} {100 * g[1]:.2g} %" if g else "no number: a warning"))
    dough, linear, grid = (done["gravity-" + k] for k in ("dough", "linear", "grid"))
    guess = guesses["gravity-dough"][1]
    claims.add("dough sags at most 1.6 % in 300 s under 1 g", percent(dough["sag"], 2), dough["sag"] <= 0.016)
    claims.add("a linear damper of the press-time viscosity: more than 50 %", percent(linear["sag"], 0),
               linear["sag"] > 0.5)
    claims.add("grid only falls within 1 s", f"{grid['fallen_s']:.2f} s", 0 < grid["fallen_s"] <= 1)
    claims.add("knead check predicts the dough's sag within 10 %", percent(guess),
               abs(guess / dough["sag"] - 1) < 0.1)
    return WEIGHT.format(table=table(["object", "its top comes down, ours", "predicted, ours"], rows))


def monotone(peaks):  # by ever smaller steps as well
    steps = [a - b for a, b in zip(peaks, peaks[1:])]
    return all(s > 0 for s in steps) and all(b < a for a, b in zip(steps, steps[1:]))


def pair(done, facts, grid, net):  # table of the two, peaks of both, and the net's deviation from the grid's
    rows, peaks, net_peaks, apart = [], [], [], []
    for n in range(1, 5):
        g, d = done.get(f"lattice-{grid}-{n}"), done.get(f"lattice-{net}-{n}")
        if not g:
            continue
        peaks.append(g["peak_n"])
        row = [f"{10 / n:.3g} mm", g["nodes"], f"{g['peak_n']:.2f}"] + ["-"] * 4
        if d:
            net_peaks.append(d["peak_n"])
            apart.append(d["peak_n"] / g["peak_n"] - 1)
            row[3:] = [d["nodes"], f"{d['peak_n']:.2f}", f"{100 * apart[-1]:+.1f} %",
                       ", ".join(facts["moduli"][f"lattice-{net}-{n}"])]
        rows.append(row)
    head = ["spacing", "grid nodes", "peak N", "net nodes", "peak N", "to the grid", "nu, G"]
    return table(head, rows), peaks, net_peaks, apart


def refined(claims, name, peaks):
    if len(peaks) > 2:
        claims.add(f"peak of refined {name} converges, monotonically", ", ".join(f"{p:.2f}" for p in peaks) + " N",
                   monotone(peaks))


def lattices(done, facts, claims):
    regular, alike, net, apart = pair(done, facts, "grid", "regular")
    if apart:
        claims.add("peak of tetrahedra on the grid's nodes within 10 % of the grid's", ", ".join(map(percent, apart)),
                   max(map(abs, apart)) <= 0.1)
    refined(claims, "grids", alike)
    refined(claims, "regular tetrahedra", net)
    free, even, net, apart = pair(done, facts, "isotropic", "free")
    if apart:
        claims.add("peak of free tetrahedra within 10 % of the isotropic grid's", ", ".join(map(percent, apart)),
                   max(map(abs, apart)) <= 0.1)
    refined(claims, "free tetrahedra", net)
    refined(claims, "isotropic grids", even)
    none = "" if facts["gmsh"] else " Gmsh is not installed here: grids only."
    return LATTICES.format(none=none, gas=gas(done), regular=regular, free=free)


def gas(done):
    rows = []
    for n in (1, 2):
        for kind in ("grid", "regular", "free"):
            if f"gas-{kind}-{n}" in done:
                d, grid = done[f"gas-{kind}-{n}"], done[f"gas-grid-{n}"]
                rows.append((f"{kind}, {10 / n:g} mm", d["elements"], f"{d['peak_n']:.1f}",
                             f"{100 * (d['peak_n'] / grid['peak_n'] - 1):+.0f} %", percent(d["volume"]),
                             f"{d['least_cell']:.2f}", cm(d["bulge_x_m"]), cm(d["bulge_y_m"])))
    head = ["lattice", "cells", "peak N", "to the grid", "volume", "cell", "bulge x cm", "bulge y cm"]
    return GAS.format(table=table(head, rows)) if rows else ""


def machine():
    with open("/proc/cpuinfo") as f:
        model = re.search(r"model name\s*: (.*)", f.read())
    return model[1].strip() if model else platform.machine()


def compiler():
    found = subprocess.run(["cc", "--version"], capture_output=True, text=True).stdout.splitlines()
    return found[0] if found else "an unknown compiler"


def results(done, facts):
    claims = Claims()
    body = [creep(facts["creep"], claims), structures(done, facts["quick"], claims),
            materials(done, facts["quick"], claims), gravity(done, facts["predicted"], claims),
            lattices(done, facts, claims)]
    head = HEAD.format(command="bench/papers" + (" --quick" if facts["quick"] else ""),
                       machine=f"{machine()}, {compiler()}")
    said = "## Statements, and whether these numbers bear them out\n\n"
    said += table(["statement", "ours", "holds"], claims.rows) + "\n"
    return (head + "\n" + said + "".join(body)).rstrip() + "\n", claims.rows

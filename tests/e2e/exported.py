# Read the output of knead export with VTK.
#     exported.py log FOLDER CSV NODES EDGES | rest FOLDER VOLUME | flat FOLDER AREA | ply FILE FOLDER ARRAY
import csv, math, sys, xml.etree.ElementTree as xml
import served, vtk
from served import check
from vtk.util.numpy_support import vtk_to_numpy as numbers

def read(path):
    reader = vtk.vtkXMLUnstructuredGridReader()
    said = []
    reader.AddObserver("ErrorEvent", lambda *a: said.append(a))
    reader.SetFileName(path)
    reader.Update()
    if said: check("VTK reads " + path, False)
    return reader.GetOutput()

def array(data, name): return numbers(data.GetArray(name)).astype(float)
def points(grid): return numbers(grid.GetPoints().GetData()).astype(float)

def volumes(grid, what="Volume"):
    size = vtk.vtkCellSizeFilter()
    size.SetInputData(grid)
    size.Update()
    return array(size.GetOutput().GetCellData(), what)

# only for cells at rest: under load the sides of a cube are bent, and the cube is not convex any more
def invalid(grid):
    judge = vtk.vtkCellValidator()
    judge.SetInputData(grid)
    judge.Update()
    return int((array(judge.GetOutput().GetCellData(), "ValidityState") != 0).sum())

# Return {time: {name: file}}. The parts of a time are numbered from 0.
def collection(folder, name):
    times = {}
    for one in xml.parse(f"{folder}/{name}.pvd").getroot().iter("DataSet"):
        at = times.setdefault(float(one.get("timestep")), {})
        if int(one.get("part")) != len(at): check("the parts of a moment are numbered", False, one.attrib)
        at[one.get("name")] = f"{folder}/{one.get('file')}"
    return times

def log(folder, table, nodes, edges):
    times, lines = collection(folder, "object"), collection(folder, "edges")
    rows = {round(float(r["time_s"]), 3): r for r in csv.DictReader(open(table)) if r["probe"] == "plate"}
    at = list(times)
    check("there is a moment every 0.1 s from 0 on", all(abs(t - 0.1 * i) < 1e-9 for i, t in enumerate(at)) and len(at) > 8, at)
    check("the edges have the same moments", list(lines) == at)
    worst_rest = worst_depth = worst_force = worst_tool = worst_strain = worst_time = 0
    deepest, least, most_off, sticks, stress, speed = 0, 1e9, 0, 0, 0, 0
    for t, files in times.items():
        grid = read(files["object"])
        x, u = points(grid), array(grid.GetPointData(), "displacement_m")
        force = array(grid.GetPointData(), "contact_force_n")
        if t == 0: rest, rest_volume, bad = x - u, volumes(grid), invalid(grid)
        if grid.GetNumberOfPoints() != nodes: check("the export has as many nodes as the scene", False, grid.GetNumberOfPoints())
        worst_rest = max(worst_rest, abs(x - u - rest).max())
        worst_time = max(worst_time, abs(numbers(grid.GetFieldData().GetArray("TimeValue"))[0] - t))
        least = min(least, volumes(grid).min())
        most_off = max(most_off, abs(volumes(grid) / rest_volume - array(grid.GetCellData(), "volume_ratio")).max())
        row, tool = rows.get(round(t, 3)), read(files["plate"])
        if not row:
            if tool.GetNumberOfPoints(): check("a tool without a session has no points", False)
            continue
        told = [float(row[f"contact_f{k}_n"]) for k in "xyz"]
        worst_force = max(worst_force, abs(force.sum(axis=0) + told).max())
        given, place = array(tool.GetPointData(), "force_n"), points(tool)
        worst_tool = max(worst_tool, abs(given.sum(axis=0) - [float(row[f"f{k}_n"]) for k in "xyz"]).max(),
                         abs(place[0] - [float(row[f"proxy_{k}_m"]) for k in "xyz"]).max(),
                         abs(place[1:].min(axis=0)[2] - float(row["proxy_z_m"])))
        if told[2] > 1: # nodes held by the plate are at the plate
            held = force[:, 2] < 0
            stress = max(stress, array(grid.GetPointData(), "von_mises_stress_pa").max())
            speed = max(speed, -array(grid.GetPointData(), "velocity_m_s")[held][:, 2].min())
            sticks = max(sticks, abs(x[held][:, 2] - float(row["proxy_z_m"])).max())
            depth = rest[:, 2].max() - float(row["proxy_z_m"])
            if depth > deepest:
                deepest = depth
                worst_depth = abs(-u[:, 2].min() - depth)
        wire = read(lines[t]["edges"])
        ends = numbers(wire.GetCells().GetConnectivityArray()).reshape(-1, 2)
        length = lambda p: ((p[ends[:, 0]] - p[ends[:, 1]]) ** 2).sum(axis=1) ** 0.5
        worst_strain = max(worst_strain, abs(length(x) / length(rest) - 1 - array(wire.GetCellData(), "strain")).max())
        if len(ends) != edges: check("the export has as many edges as the scene", False, len(ends))
    check("each file states its time", worst_time < 1e-9, worst_time)
    check("points minus displacements give the shape at rest", worst_rest < 1e-8, worst_rest)
    check("every cell is valid and has a volume above 0", bad == 0 and least > 0, bad, least)
    check("the volumes at rest add up to the block's", abs(rest_volume.sum() - 75e-6) < 1e-10, rest_volume.sum())
    check("volume_ratio is VTK's volume divided by the volume at rest", most_off < 0.02, most_off)
    check("the contact forces of the nodes equal the CSV's, N", worst_force < 1e-4, worst_force)
    check("the tool has the position of the CSV's proxy and its force", worst_tool < 1e-5, worst_tool)
    check("nodes under the plate are at the plate's height", 0 < sticks < 2e-5, sticks)
    check(f"the dent is as deep as the plate: {1e3 * deepest:.2f} mm", deepest > 0.004 and worst_depth < 1e-4, worst_depth)
    check(f"the speed of the plate has the right magnitude: {1e3 * speed:.2f} mm/s", 0.004 < speed < 0.02)
    check(f"the stress has the right magnitude: {stress:.0f} Pa", 2e3 < stress < 1e6)
    check("the strain of an edge follows from its ends", worst_strain < 1e-5, worst_strain)
    grid = read(times[at[-1]]["object"])
    left, u = array(grid.GetPointData(), "residual_strain"), array(grid.GetPointData(), "displacement_m")
    check("dough keeps residual strain and a dent", left.max() > 0.02 and (u ** 2).sum(axis=1).max() ** 0.5 > 5e-4, left.max())

def rest(folder, volume, size=volumes):
    (time, files), = collection(folder, "object").items()
    grid = read(files["object"])
    check("at rest every cell is valid and has a volume above 0", invalid(grid) == 0 and size(grid).min() > 0, invalid(grid))
    check("the cells fill the object", abs(size(grid).sum() / volume - 1) < 1e-3, size(grid).sum(), volume)
    check("at rest displacements and contact forces are 0", abs(array(grid.GetPointData(), "displacement_m")).max() == 0 and
          abs(array(grid.GetPointData(), "contact_force_n")).max() == 0)
    check("edges are lines", read(collection(folder, "edges")[0.0]["edges"]).GetCellType(0) == vtk.VTK_LINE)

def ply(path, most):
    reader = vtk.vtkPLYReader()
    reader.SetFileName(path)
    reader.Update()
    mesh = reader.GetOutput()
    edges, size = vtk.vtkFeatureEdges(), vtk.vtkMassProperties()
    for one in edges, size: one.SetInputData(mesh)
    edges.FeatureEdgesOff()
    edges.ManifoldEdgesOff()
    edges.Update()
    normals, colours = numbers(mesh.GetPointData().GetNormals()), numbers(mesh.GetPointData().GetScalars())
    check("the surface has no holes", edges.GetOutput().GetNumberOfCells() == 0)
    check("the surface encloses 85 to 100 % of the block's volume", 0.85 < size.GetVolume() / 75e-6 < 1.001, size.GetVolume())
    check("the normals have length 1", abs((normals ** 2).sum(axis=1) - 1).max() < 1e-5)
    top = points(mesh)[:, 2] > points(mesh)[:, 2].max() - 5e-4
    check("the normals of the top point up", top.any() and normals[top][:, 2].min() > 0.45, normals[top][:, 2])
    check("the vertices have colours", colours.shape[1] == 3 and len({tuple(c) for c in colours}) > 5)
    quality = qualities(path)
    check(f"the largest value, {quality.max():.6g}, is VTK's largest value of the nodes", abs(quality.max() / most - 1) < 1e-5, most)

def qualities(path): # vtkPLYReader drops these properties
    import numpy
    text = open(path, "rb").read()
    count = int(text.split(b"element vertex ")[1].split()[0])
    kind = numpy.dtype([("x", "<f4", 3), ("n", "<f4", 3), ("quality", "<f4"), ("rgb", "u1", 3)])
    return numpy.frombuffer(text, kind, count, text.index(b"end_header\n") + 11)["quality"]

def most(folder, name): # over all nodes, at the last moment
    times = collection(folder, "object")
    grid = read(times[max(times)]["object"])
    values = array(grid.GetPointData(), name)
    return ((values ** 2).sum(axis=1) ** 0.5 if values.ndim > 1 else values).max()

what, *rest_of = sys.argv[1:]
if what == "log": log(rest_of[0], rest_of[1], int(rest_of[2]), int(rest_of[3]))
elif what == "rest": rest(rest_of[0], float(rest_of[1]))
elif what == "flat": rest(rest_of[0], float(rest_of[1]), lambda grid: volumes(grid, "Area"))
elif what == "ply": ply(rest_of[0], most(rest_of[1], rest_of[2]))
sys.exit(served.failed)

#ifndef KN_CORE_SCENE_KEYS_H
#define KN_CORE_SCENE_KEYS_H
// The table of all keys of a scene. It drives reading, checking, `knead check --keys` and the canonical text.
// A new key is one line here. Rules between keys are in draft.c.
//
//     id, when, path, type, count, unit, least, most, default, member, meaning
//
// when     condition under which the key is relevant: a damper's parameter needs that damper, a radius a round tool
// count    1, or the length of a list [a, b, c]; an EXTENT may leave out the value along y
// unit     unit of the member and of the canonical text; any unit of the same dimension can be read. "": a bare number
// default  text as in a file; NULL: required; "": may be absent; "(...)": computed in draft.c
// member   member of kn_draft; of kn_probe_def for the keys of a probe, of kn_draft_surface for those of a tool's
//          file, of kn_draft_part for those of a union's part
#include "core/scene/units.h"
#include <stddef.h>
#include <stdint.h>

// clang-format off
// A quality point: a named setting between speed and accuracy. Its values replace those of solver.KEY and of
// object.spacing.
#define KN_QUALITY_KEYS(X, POINT, path, member)                                                                       \
  X(POINT##_ITERATIONS, ALWAYS, path "iterations", INTEGER, 1, "", 1, 1000, "",                                       \
    member.iterations, "instead of solver.iterations")                                                                \
  X(POINT##_ITERATIONS_MAX, ALWAYS, path "iterations_max", INTEGER, 1, "", 1, 1000, "",                               \
    member.iterations_max, "instead of solver.iterations_max")                                                        \
  X(POINT##_TOLERANCE, ALWAYS, path "tolerance", REAL, 1, "", 0, 1, "",                                               \
    member.tolerance, "instead of solver.tolerance")                                                                  \
  X(POINT##_PASSES, ALWAYS, path "passes", INTEGER, 1, "", 1, 20, "",                                                 \
    member.passes, "instead of solver.passes")                                                                        \
  X(POINT##_LINEARIZATION, ALWAYS, path "linearization", CHOICE, 1, "blend|secant|tangent", 0, 0, "",                 \
    member.linearization, "instead of solver.linearization")                                                          \
  X(POINT##_PRECISION, ALWAYS, path "precision", CHOICE, 1, "f32|f64", 0, 0, "",                                      \
    member.precision, "instead of solver.precision")                                                                  \
  X(POINT##_SPACING, BLOCK, path "spacing", REAL, 1, "m", 1e-5, 1, "",                                                \
    member.spacing_m, "instead of object.spacing")

#define KN_SCENE_KEYS(X)                                                                                              \
  X(VERSION, ALWAYS, "version", INTEGER, 1, "", 1, 1, NULL,                                                           \
    scene.version, "version of this file format")                                                                     \
  X(SIZE, BLOCK, "object.size", EXTENT, 3, "m", 1e-5, 10, NULL,                                                       \
    size_m, "size of a block along x, y, z, or of a flat object along x, z: each a whole number of spacings")         \
  X(SPACING, BLOCK, "object.spacing", REAL, 1, "m", 1e-5, 1, NULL,                                                    \
    scene.model.spacing_m, "side of a lattice cell")                                                                  \
  X(MESH, ALWAYS, "object.mesh", PATH, 1, ".msh", 0, 0, "",                                                               \
    mesh_path,                                                                                                        \
    "Gmsh file of tetrahedra or of flat triangles, instead of a block; path relative to the scene's folder")          \
  X(MESH_UNIT, MESH, "object.mesh_unit", CHOICE, 1, "m|cm|mm|um", 0, 0, NULL,                                         \
    mesh_unit, "unit of the mesh's coordinates")                                                                      \
  X(MESH_HASH, MESH, "object.mesh_hash", HASH, 1, "", 0, 0, "",                                                       \
    mesh_hash, "hash of the mesh file; a file with another hash is refused")                                          \
  X(THICKNESS, ALWAYS, "object.thickness", REAL, 1, "m", 1e-5, 10, "",                                                \
    scene.model.thickness_m, "thickness of a flat object, along y")                                                   \
  X(STRUCTURE, BLOCK, "object.structure", CHOICE, 1, "diagonals|axis", 0, 0, "diagonals",                             \
    scene.model.structure, "edges of a cell: with face and body diagonals, or sides only")                            \
  X(DIAGONAL_STIFFNESS, DIAGONALS, "object.diagonal_stiffness", REAL, 1, "", 0.003, 1, "1",                           \
    scene.model.diagonal_stiffness, "stiffness of a diagonal, relative to that of a side")                            \
  X(ACCURACY, DIAGONALS, "object.accuracy", REAL, 1, "", 0, 0.5, "",                                                  \
    scene.accuracy,                                                                                                   \
    "share of the force that cells twice as wide away from the tools may cost; none, 0: no wider cells")              \
  X(MARGIN, DIAGONALS, "object.margin", REAL, 1, "m", 1e-5, 1, "",                                                    \
    margin_m, "margin of cells of spacing around the reach of the tools; none: 0.7 widths of the widest tool")        \
  X(PRESSURE, ALWAYS, "object.pressure", CHOICE, 1, "none|cells|object", 0, 0, "none",                                \
    scene.model.pressure, "gas enclosed in each cell, or in the object as a whole; it keeps the volume")              \
  X(INSIDE_PRESSURE, PRESSURE, "object.inside_pressure", REAL, 1, "Pa", 100, 1e8, "1 atm",                            \
    scene.model.inside_pressure_pa, "absolute pressure of that gas at rest")                                          \
  X(SKIN, BLOCK, "object.skin", CHOICE, 1, "spline|bilinear", 0, 0, "",                                               \
    scene.model.skin,                                                                                                 \
    "shape of the skin between nodes, as tools feel it; none: spline, smoother under tools of less than 2 spacings")  \
  X(VARIANT, ALWAYS, "material.variant", CHOICE, 1, "rheological|viscoelastic|plastic", 0, 0, "rheological",          \
    variant, "the material as written, or its variant by the second paper's rules; short form: material: NAME")       \
  X(K1, ALWAYS, "material.k1", MODULUS, 1, "Pa", 0, 1e9, NULL,                                                        \
    scene.model.material.k1_pa, "spring of the Voigt element")                                                        \
  X(C1, ALWAYS, "material.c1", MODULUS, 1, "Pa*s", 0, 1e9, NULL,                                                      \
    scene.model.material.c1_pa_s, "dashpot of the Voigt element")                                                     \
  X(DAMPER, ALWAYS, "material.damper", CHOICE, 1, "none|constant|exponential|ramp", 0, 0, NULL,                       \
    scene.model.material.damper,                                                                                      \
    "law of the damper in series with the Voigt element; the damper keeps the deformation")                           \
  X(C2, CONSTANT, "material.c2", MODULUS, 1, "Pa*s", 1e-6, 1e12, NULL,                                                \
    scene.model.material.c2_pa_s, "viscosity of the constant damper")                                                 \
  X(ALPHA, EXPONENTIAL, "material.alpha", MODULUS, 1, "Pa*s", 1e-6, 1e15, NULL,                                       \
    scene.model.material.alpha_pa_s, "the damper's viscosity is alpha exp(-beta |stress|)")                           \
  X(BETA, EXPONENTIAL, "material.beta", REAL, 1, "1/Pa", 0, 1, NULL,                                                  \
    scene.model.material.beta_per_pa, "beta in the law of material.alpha: the damper softens as the stress rises")    \
  X(C_MAX, RAMP, "material.c_max", MODULUS, 1, "Pa*s", 1e-6, 1e15, NULL,                                              \
    scene.model.material.c_max_pa_s, "the damper's viscosity up to the stress p0")                                    \
  X(C_MIN, RAMP, "material.c_min", MODULUS, 1, "Pa*s", 1e-6, 1e15, NULL,                                              \
    scene.model.material.c_min_pa_s,                                                                                  \
    "the damper's viscosity from the stress p1 on; an exponential damper may have c_max, c_min instead of alpha, beta") \
  X(P0, FORCE, "material.p0", REAL, 1, "Pa", 0, 1e9, NULL,                                                      \
    scene.model.material.p0_pa, "stress up to which the damper's viscosity is constant")                              \
  X(P1, FORCE, "material.p1", REAL, 1, "Pa", 1e-6, 1e9, NULL,                                                   \
    scene.model.material.p1_pa, "stress from which on the damper's viscosity is constant")                            \
  X(STROKE, ALWAYS, "material.stroke", REAL, 2, "", 0, 1, "",                                                         \
    scene.model.material.stroke, "a_min, a_max: end stops of the damper, see core/material.h; none: no stops")        \
  X(RATIO, ALWAYS, "material.ratio", REAL, 1, "", 0, 1, "",                                                           \
    scene.model.material.ratio,                                                                                       \
    "a0: share of the Voigt element in an edge as made, only with a stroke; none: 0.2, or c2/(c1 + c2) without k1")   \
  X(SPECIMEN_HEIGHT, ALWAYS, "material.specimen_height", REAL, 1, "m", 1e-4, 10, "",                                  \
    specimen_height_m, "factor on k1, c1, c2, alpha, c_max and c_min that are given per height (Pa/m, gf/cm^3)")      \
  X(DENSITY, ALWAYS, "density", REAL, 1, "kg/m^3", 1, 3e4, NULL,                                                      \
    scene.model.density_kg_m3, "density of the object")                                                               \
  X(GRAVITY, ALWAYS, "gravity", REAL, 1, "m/s^2", 0, 100, "0 m/s^2",                                                  \
    scene.model.gravity_m_s2, "gravity, downwards along -z")                                                          \
  X(SUPPORT, ALWAYS, "support", CHOICE, 1, "bonded|frictionless|none|friction", 0, 0, NULL,                           \
    scene.model.support,                                                                                              \
    "the base is glued, slides on the table, is free, or lies on a table with friction and can be lifted")            \
  X(SUPPORT_FRICTION, TABLE, "support_friction", REAL, 1, "", 0, 10, "0.5",                                           \
    scene.model.support_friction,                                                                                     \
    "Coulomb friction of that table while the object slides; a fifth more until it slides")                           \
  X(PROFILE, ALWAYS, "device.profile", CHOICE, 1, "touch|bench|falcon|omega|unknown", 0, 0, NULL,                     \
    profile, "device of the hand or of the virtual hand; short form: device: touch, or a file.yaml with device:")     \
  X(CLAMP, ALWAYS, "device.clamp", REAL, 1, "N", 0.1, 100, "(profile)",                                               \
    scene.limits.clamp_n, "largest force on a hand")                                                                  \
  X(TORQUE_CLAMP, ALWAYS, "device.torque_clamp", REAL, 1, "N*m", 1e-3, 10, "(0.05 m * clamp)",                        \
    scene.limits.torque_clamp_n_m, "largest torque on a hand")                                                        \
  X(GUARD, ALWAYS, "device.guard", REAL, 1, "N/ms", 0.1, 100, "4 N/ms", scene.limits.guard_n_per_ms,                  \
    "impulse guard: largest change of force for each ms since the last tick with a pose, for at most device.hold")    \
  X(BRAKE_SPEED, ALWAYS, "device.brake_speed", REAL, 1, "m/s", 0.05, 5, "1.2 m/s",                                    \
    scene.limits.brake_m_s, "speed above which a hand is only damped")                                                \
  X(BRAKE_DAMPING, ALWAYS, "device.brake_damping", REAL, 1, "N*s/m", 0.01, 10, "1.5 N*s/m",                           \
    scene.limits.brake_n_s_per_m, "damping above device.brake_speed")                                                 \
  X(HOLD, ALWAYS, "device.hold", INTEGER, 1, "ms", 1, 3, "3 ms",                                                      \
    scene.limits.hold_ms, "time for which a force is held without a pose")                                            \
  X(ZERO, ALWAYS, "device.zero", INTEGER, 1, "ms", 4, 20, "20 ms",                                                    \
    scene.limits.zero_ms, "time after the last pose at which the force is 0")                                         \
  X(RAMP, ALWAYS, "device.ramp", INTEGER, 1, "ms", 200, 5000, "200 ms",                                               \
    scene.limits.ramp_up_ms, "time in which the gain rises from 0 to 1 at engagement")                                \
  X(FLOW, ALWAYS, "device.flow", INTEGER, 1, "ms", 200, 5000, "200 ms",                                               \
    scene.limits.flow_ms, "time for which poses must flow before that rise")                                          \
  X(DEVICE_MASS, ALWAYS, "device.mass", REAL, 1, "kg", 1e-3, 100, "(profile)",                                        \
    scene.device.mass_kg, "mass of the device, as felt at its tip")                                                   \
  X(DEVICE_DAMPING, ALWAYS, "device.damping", REAL, 1, "N*s/m", 0, 1e3, "(profile)",                                  \
    scene.device.damping_n_s_m, "viscous friction of the device's mechanics")                                         \
  X(DEVICE_FRICTION, ALWAYS, "device.friction", REAL, 1, "N", 0, 10, "(profile)",                                     \
    scene.device.friction_n, "dry friction of the device's mechanics")                                                \
  X(DEVICE_ENCODER, ALWAYS, "device.encoder", REAL, 1, "m", 0, 0.01, "(profile)",                                     \
    scene.device.encoder_m, "step of the device's positions")                                                         \
  X(DEVICE_WORKSPACE, ALWAYS, "device.workspace", REAL, 3, "m", 1e-3, 10, "(profile)",                                \
    scene.device.workspace_m, "extent of the device's workspace along its own axes")                                  \
  X(DEVICE_STIFFNESS, ALWAYS, "device.stiffness_limit", REAL, 1, "N/m", 1, 1e7, "(profile)",                          \
    scene.device.stiffness_limit_n_m, "stiffest wall that the device renders cleanly, as its makers or users say")    \
  X(DEVICE_FORCE_AXES, ALWAYS, "device.force_axes", INTEGER, 1, "", 0, 3, "(profile)",                                \
    scene.device.force_axes, "number of axes of force with a motor")                                                  \
  X(DEVICE_TORQUE_AXES, ALWAYS, "device.torque_axes", INTEGER, 1, "", 0, 3, "(profile)",                              \
    scene.device.torque_axes, "number of axes of torque with a motor")                                                \
  X(DEVICE_ROUND_TRIP, ALWAYS, "device.round_trip", REAL, 1, "s", 0, 0.2, "1 ms",                                     \
    scene.device.round_trip_s, "time from sending a pose to receiving its force")                                     \
  X(DEVICE_COUPLING, ALWAYS, "device.coupling", REAL, 1, "N/m", 1, 1e7, "(profile, round_trip)",                      \
    scene.device.hand.stiffness_n_m, "stiffness of the virtual coupling as the hand feels it, see core/coupling.h")   \
  X(DEVICE_COUPLING_DAMPING, ALWAYS, "device.coupling_damping", REAL, 1, "N*s/m", 0, 1e4, "(profile, round_trip)",    \
    scene.device.hand.damping_n_s_m, "damping of the virtual coupling as the hand feels it")                          \
  X(DEVICE_FORCE_SCALE, ALWAYS, "device.force_scale", REAL, 1, "", 1e-3, 100, "1",                                    \
    scene.limits.force_scale, "force on the hand, relative to the object's force")                                    \
  X(DEVICE_BASIS, ALWAYS, "device.basis", REAL, 3, "", -3, 3, "([1, 2, 3])",                                          \
    scene.device.basis, "the device's axes along the scene's x, y, z: 1, 2, 3, negative for backwards")               \
  X(DEVICE_POSITION, ALWAYS, "device.position", REAL, 3, "m", -10, 10, "(origin)",                                    \
    scene.device.position_m, "position of the device's origin in the scene")                                          \
  X(DEVICE_ROTATION, ALWAYS, "device.rotation", REAL, 4, "", -1, 1, "([1, 0, 0, 0])",                                 \
    scene.device.rotation_wxyz, "rotation of the device, applied after basis: unit quaternion w, x, y, z")            \
  X(DEVICE_SCALE, ALWAYS, "device.scale", REAL, 1, "", 1e-3, 1e3, "1",                                                \
    scene.device.scale, "scale of lengths: metres in the scene for one metre of the device")                          \
  X(KIND, ALWAYS, "solver.kind", CHOICE, 1, "implicit|rk4|fixed", 0, 0, "implicit",                                   \
    scene.model.solver.kind,                                                                                          \
    "rk4: the papers' method, refused above its stable step; fixed: integers, as in a circuit")                       \
  X(PRECISION, ALWAYS, "solver.precision", CHOICE, 1, "f32|f64", 0, 0, "(f32; others f64)",                           \
    scene.model.solver.precision, "floating-point format of the lattice")                                             \
  X(LINEARIZATION, ALWAYS, "solver.linearization", CHOICE, 1, "blend|secant|tangent", 0, 0, "blend",                  \
    scene.model.solver.linearization, "linearisation of the material law in a step")                                  \
  X(ISA, ALWAYS, "solver.isa", CHOICE, 1, "auto|base|avx2|avx512", 0, 0, "auto",                                      \
    scene.model.solver.isa, "instruction set; all give the same bits")                                                \
  X(DT, ALWAYS, "solver.dt", REAL, 1, "s", 1e-9, 0.1, "1 ms",                                                         \
    scene.model.solver.dt_s, "time step")                                                                             \
  X(ITERATIONS, ALWAYS, "solver.iterations", INTEGER, 1, "", 1, 1000, "4",                                            \
    scene.model.solver.iterations,                                                                                    \
    "iterations of every step, by conjugate gradients; fixed: by Jacobi's method, default 8, at most 32")             \
  X(ITERATIONS_MAX, ALWAYS, "solver.iterations_max", INTEGER, 1, "", 1, 1000, "24",                                   \
    scene.model.solver.iterations_max, "largest number of iterations, used while the residual is above the tolerance") \
  X(TOLERANCE, ALWAYS, "solver.tolerance", REAL, 1, "", 0, 1, "1e-3",                                                 \
    scene.model.solver.tolerance,                                                                                     \
    "tolerated residual, relative to the largest of the recent steps; 0: never more than solver.iterations")          \
  X(PASSES, ALWAYS, "solver.passes", INTEGER, 1, "", 1, 20, "1",                                                      \
    scene.model.solver.passes, "linearisations per step; fixed: default 2, at most 15")                               \
  X(MASS_SCALE, ALWAYS, "solver.mass_scale", REAL, 1, "", 1, 1e9, "1",                                                \
    scene.model.solver.mass_scale, "factor on the inertia, not on the weight; gives rk4 a stable step")               \
  X(BUDGET, ALWAYS, "solver.budget", REAL, 1, "s", 1e-5, 1e-3, "",                                                    \
    scene.budget_s,                                                                                                   \
    "time budget of a tick: after 10 consecutive ticks above it the server takes a lower point; none: 0.8 ms")        \
  X(CHOSEN, ALWAYS, "quality.chosen", CHOICE, 1, "fast|balanced|accurate|own", 0, 0, "",                              \
    chosen, "quality point in force; own: the values of solver; short form: quality: NAME, --quality NAME")           \
  KN_QUALITY_KEYS(X, FAST, "quality.fast.", fast)                                                                     \
  KN_QUALITY_KEYS(X, BALANCED, "quality.balanced.", balanced)                                                         \
  KN_QUALITY_KEYS(X, ACCURATE, "quality.accurate.", accurate)                                                         \
  X(MESH_RATE, ALWAYS, "mesh.rate", REAL, 1, "Hz", 30, 60, "30 Hz",                                                   \
    scene.mesh_hz, "meshes published per second")                                                                     \
  X(MESH_MEASURES, ALWAYS, "mesh.measures", CHOICE, 1, "none|stress|residual|both", 0, 0, "",                         \
    scene.mesh_measures,                                                                                              \
    "values that a mesh has besides positions: von Mises stress, residual strain; none: no values")

#define KN_PROBE_KEYS(X)                                                                                              \
  X(PROBE_NAME, ALWAYS, "probes.NAME.name", NAME, 1, "", 0, 0, NULL,                                                  \
    name, "name of the probe; its channels are KNEAD_POSE_NAME, KNEAD_FORCE_NAME; at most 4 probes")                  \
  X(PROBE_SHAPE, ALWAYS, "probes.NAME.shape", CHOICE, 1, "plate|sphere|capsule|box|cross|cylinder|union|mesh", 0, 0, NULL, \
    shape, "plate: a level rectangle that sticks; the other shapes turn with their pose, see core/shape.h")           \
  X(PROBE_SIZE, PLATE, "probes.NAME.size", REAL, 2, "m", 1e-4, 10, NULL,                                              \
    size_m, "size of the plate along x and y")                                                                        \
  X(PROBE_EXTENT, BOX, "probes.NAME.extent", REAL, 3, "m", 1e-4, 10, NULL,                                            \
    size_m, "box along x, y, z; cross: arm length, arm width, height")                                                \
  X(PROBE_RADIUS, ROUND, "probes.NAME.radius", REAL, 1, "m", 1e-4, 1, NULL,                                           \
    radius_m, "radius: at least one spacing, 1.5 spacings advised")                                                   \
  X(PROBE_LENGTH, LONG, "probes.NAME.length", REAL, 1, "m", 1e-4, 10, NULL,                                           \
    length_m, "capsule, cylinder: length along z, upwards from the pose")                                             \
  X(PROBE_EDGE, EDGED, "probes.NAME.edge", REAL, 1, "m", 0, 1, "",                                                    \
    edge_m, "radius of the edges; none: sharp")                                                                       \
  X(PROBE_FOUNDATION, TOOL, "probes.NAME.foundation", REAL, 1, "N/m^3", 1e3, 1e12, "2.5e7 N/m^3",                     \
    foundation_n_m3, "stiffness of the contact per area")                                                             \
  X(PROBE_FRICTION, TOOL, "probes.NAME.friction", REAL, 1, "", 0, 100, "",                                            \
    friction, "Coulomb friction while the contact slides; a fifth more until it slides; none: frictionless")          \
  X(PROBE_ADHESION, TOOL, "probes.NAME.adhesion", REAL, 1, "Pa", 0, 1e7, "",                                          \
    adhesion_pa, "tension that the contact carries before it lets go; none: no adhesion")                             \
  X(PROBE_GRIP, TOOL, "probes.NAME.grip", REAL, 1, "N", 0, 100, "",                                                   \
    grip_n, "largest force with which button 1 ties the contact to the tool; none: no grip")                          \
  X(PROBE_COUPLING, TOOL, "probes.NAME.coupling", REAL, 1, "N/m", 0, 1e6, "",                                         \
    coupling_n_m,                                                                                                     \
    "spring between pose and tool; 0: the tool follows rigidly; none: the device's, with device: bench 0")            \
  X(PROBE_COUPLING_DAMPING, TOOL, "probes.NAME.damping", REAL, 1, "N*s/m", 0, 1e4, "",                       \
    coupling_n_s_m, "damping of that spring; none: the device's")                                                     \
  X(PROBE_REACH, ALWAYS, "probes.NAME.reach", REAL, 4, "m", -10, 10, "",                                              \
    reach_m, "[x, x, y, y]: limits of the probe's centre; required by object.accuracy")

// Keys of a tool whose shape is the closed surface of a file.
#define KN_SURFACE_KEYS(X)                                                                                            \
  X(SURFACE, SURFACE, "probes.NAME.mesh", PATH, 1, ".stl|.obj", 0, 0, NULL,                                           \
    path, "closed surface in the tool's frame; path relative to the scene's folder")                                  \
  X(SURFACE_UNIT, SURFACE, "probes.NAME.mesh_unit", CHOICE, 1, "m|cm|mm|um", 0, 0, NULL,                              \
    unit, "unit of the surface's coordinates")                                                                        \
  X(SURFACE_HASH, SURFACE, "probes.NAME.mesh_hash", HASH, 1, "", 0, 0, "",                                            \
    hash, "hash of the surface file; a file with another hash is refused")                                            \
  X(SURFACE_CELL, SURFACE, "probes.NAME.mesh_cell", REAL, 1, "m", 1e-5, 1, "",                                        \
    cell_m,                                                                                                           \
    "cell side of the surface's grid of distances; none: an eighth of the spacing, or up to a third to fit in 8 MiB")

// Keys of one part of a union: shapes and sizes as for a probe, and the part's place in the tool.
#define KN_PART_KEYS(X)                                                                                               \
  X(PART_SHAPE, ALWAYS, "probes.NAME.parts.N.shape", CHOICE, 1, "sphere|capsule|box|cross|cylinder", 0, 0, NULL,      \
    kind, "shape of part N of a union, N from 1; at most 8 parts in the list, a cross counts twice")                  \
  X(PART_EXTENT, BOX, "probes.NAME.parts.N.extent", REAL, 3, "m", 1e-4, 10, NULL,                                     \
    as.size_m, "as for a probe")                                                                                      \
  X(PART_RADIUS, ROUND, "probes.NAME.parts.N.radius", REAL, 1, "m", 1e-4, 1, NULL,                                    \
    as.radius_m, "as for a probe")                                                                                    \
  X(PART_LENGTH, LONG, "probes.NAME.parts.N.length", REAL, 1, "m", 1e-4, 10, NULL,                                    \
    as.length_m, "as for a probe, along the part's own z")                                                            \
  X(PART_EDGE, EDGED, "probes.NAME.parts.N.edge", REAL, 1, "m", 0, 1, "",                                             \
    as.edge_m, "radius of the edges; none: sharp")                                                                    \
  X(PART_AT, ALWAYS, "probes.NAME.parts.N.at", REAL, 3, "m", -10, 10, "",                                             \
    at_m, "position of the part's origin in the tool; none: the tool's origin")                                       \
  X(PART_TURN, ALWAYS, "probes.NAME.parts.N.turn", REAL, 3, "rad", -6.3, 6.3, "",                                     \
    turn_rad, "rotation about x, then y, then z of the tool, e.g. [0 deg, 90 deg, 0 deg]; none: no rotation")
// clang-format on

#define KN_KEY_ID(id, ...) KN_KEY_##id,
typedef enum kn_key_id {
    KN_SCENE_KEYS(KN_KEY_ID) KN_PROBE_KEYS(KN_KEY_ID) KN_SURFACE_KEYS(KN_KEY_ID) KN_PART_KEYS(KN_KEY_ID) KN_KEY_COUNT
} kn_key_id;
#undef KN_KEY_ID

typedef enum kn_key_when {
    KN_WHEN_ALWAYS,
    KN_WHEN_BLOCK,       // the object is a block: the scene has no key object.mesh
    KN_WHEN_MESH,        // the object is a mesh: the scene has the key object.mesh
    KN_WHEN_DIAGONALS,   // object.structure is diagonals
    KN_WHEN_PRESSURE,    // object.pressure is not none
    KN_WHEN_CONSTANT,    // material.damper is constant
    KN_WHEN_EXPONENTIAL, // material.damper is exponential
    KN_WHEN_RAMP,        // material.damper is ramp
    KN_WHEN_FORCE,       // material.damper is exponential or ramp
    KN_WHEN_TABLE,       // support is friction
    // the conditions from here on are those on a tool's shape
    KN_WHEN_PLATE,  // the tool's shape is plate
    KN_WHEN_TOOL,   // the tool's shape is any but plate
    KN_WHEN_ROUND,  // the tool's shape is sphere, capsule or cylinder
    KN_WHEN_LONG,   // the tool's shape is capsule or cylinder
    KN_WHEN_BOX,    // the tool's shape is box or cross
    KN_WHEN_EDGED,  // the tool's shape is box, cross or cylinder
    KN_WHEN_SURFACE // the tool's shape is mesh
} kn_key_when;

typedef enum kn_key_type {
    KN_TYPE_REAL,    // double
    KN_TYPE_MODULUS, // double; also per metre of specimen height; its range is checked after multiplying by the height
    KN_TYPE_EXTENT,  // double[3]; two values are x and z, with y = 0
    KN_TYPE_INTEGER, // int
    KN_TYPE_CHOICE,  // enum or int: index of a word in the list of words in the column `unit`
    KN_TYPE_NAME,    // char[KN_NAME_MAX], [a-z0-9_]+
    KN_TYPE_PATH,    // char[KN_PATH_MAX], printable UTF-8 with a file ending listed in the column `unit`: ".stl|.obj"
    KN_TYPE_HASH     // uint64_t, 16 hexadecimal digits
} kn_key_type;

typedef struct kn_key {
    kn_key_when when;
    const char *path;
    kn_key_type type;
    int count;
    const char *unit; // unit of the value; CHOICE: the allowed words; PATH: the allowed file endings
    double least, most;
    const char *fallback;
    size_t offset; // offset of the member in its struct [bytes]
    const char *meaning;
} kn_key;

extern const kn_key kn_keys[KN_KEY_COUNT];

#define KN_PATH_MAX 1024
#define KN_LINE_MAX 256 // size of a buffer for a clause or a key's description, NUL included [bytes]

// Read count texts into the member at field. On failure, return false and store the problem without the expectation:
// "'7' has no unit". per_height (MODULUS only, else may be NULL) becomes true if the value must still be multiplied by
// the specimen height.
bool kn_key_read(const kn_key *key, void *field, const char *const *text, int count, bool *per_height,
                 char problem[KN_LINE_MAX]);

// Return true if YAML can hold the text between quotes without change: UTF-8 without control characters and line
// breaks.
bool kn_key_quotable(const char *text);

// Return the index of a word in a list of words "a|b|c", or -1 if the list does not contain the word.
int kn_choice_of(const char *words, const char *word);

// Describe the values that the key expects: "a list of 3, each from 1e-05 to 10 m".
const char *kn_key_expects(const kn_key *key, char text[KN_LINE_MAX]);

// Print the member as canonical text: "[0.05 m, 0.05 m, 0.03 m]". It has as many digits as are needed to read the same
// bits back. Not for a PATH, which may be longer.
const char *kn_key_print(const kn_key *key, const void *field, char text[KN_LINE_MAX]);

// Return the key at a path ("material.k1"), or NULL if there is none. is_group becomes true if keys exist below the
// path.
const kn_key *kn_key_find(const char *path, bool *is_group);

// Suggest a correction of an unknown path: "did you mean material.k1?" or "expected one of: k1, c1".
const char *kn_key_suggest(const char *path, char text[KN_LINE_MAX]);

#endif

#ifndef KN_CORE_SCENE_KEYS_H
#define KN_CORE_SCENE_KEYS_H
// The table of all keys of a scene. Reading, checking, `knead check --keys` and the canonical text all follow this
// table. To add a key, add one entry. Rules that involve several keys are in draft.c. The columns are:
//
//     id, when, path, type, count, unit, least, most, default, member, meaning
//
// when     condition under which the key is relevant: e.g. c2 needs a constant damper, a radius needs a round tool
// count    number of values: 1, or the length of a list [a, b, c]; an EXTENT may omit the value along y
// unit     unit of the stored value and of the canonical text; a file may use any unit of the same dimension;
//          "": no unit
// default  default as it would be written; NULL: the key is required; "": the key may be absent; "(...)": computed from
//          other keys after reading
// member   member that holds the value: of kn_draft for a key of the scene, of kn_probe_def for a key of a probe, of
//          kn_draft_surface for a key of a tool's surface file, of kn_draft_part for a key of a union's part
// meaning  help line of `knead check --keys`; after "none:" the effect of leaving out the key
#include "core/scene/units.h"
#include <stddef.h>
#include <stdint.h>

// clang-format off
// A quality point: a named setting between speed and accuracy. Its values replace those of solver.KEY and of
// object.spacing.
#define KN_QUALITY_KEYS(X, POINT, path, member)                                                                       \
  X(POINT##_ITERATIONS, ALWAYS, path "iterations", INTEGER, 1, "", 1, 1000, "",                                       \
    member.iterations, "replaces solver.iterations at this quality point")                                            \
  X(POINT##_ITERATIONS_MAX, ALWAYS, path "iterations_max", INTEGER, 1, "", 1, 1000, "",                               \
    member.iterations_max, "replaces solver.iterations_max at this quality point")                                    \
  X(POINT##_TOLERANCE, ALWAYS, path "tolerance", REAL, 1, "", 0, 1, "",                                               \
    member.tolerance, "replaces solver.tolerance at this quality point")                                              \
  X(POINT##_PASSES, ALWAYS, path "passes", INTEGER, 1, "", 1, 20, "",                                                 \
    member.passes, "replaces solver.passes at this quality point")                                                    \
  X(POINT##_LINEARIZATION, ALWAYS, path "linearization", CHOICE, 1, "blend|secant|tangent", 0, 0, "",                 \
    member.linearization, "replaces solver.linearization at this quality point")                                      \
  X(POINT##_PRECISION, ALWAYS, path "precision", CHOICE, 1, "f32|f64", 0, 0, "",                                      \
    member.precision, "replaces solver.precision at this quality point")                                              \
  X(POINT##_SPACING, BLOCK, path "spacing", REAL, 1, "m", 1e-5, 1, "",                                                \
    member.spacing_m, "replaces object.spacing at this quality point")

#define KN_SCENE_KEYS(X)                                                                                              \
  X(VERSION, ALWAYS, "version", INTEGER, 1, "", 1, 1, NULL,                                                           \
    scene.version, "version of this file format")                                                                     \
  X(LABEL, ALWAYS, "label", TEXT, 1, "", 0, 0, "",                                                                    \
    scene.label, "what the object stands for and how well, in words; knead check and the web page show it")           \
  X(SIZE, BLOCK, "object.size", EXTENT, 3, "m", 1e-5, 10, NULL,                                                       \
    size_m, "size of a block along x, y, z, or of a flat object along x, z: each a whole number of spacings")         \
  X(SPACING, BLOCK, "object.spacing", REAL, 1, "m", 1e-5, 1, NULL,                                                    \
    scene.model.spacing_m, "side of a lattice cell")                                                                  \
  X(MESH, ALWAYS, "object.mesh", PATH, 1, ".msh", 0, 0, "",                                                           \
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
    scene.model.diagonal_stiffness, "stiffness of a diagonal edge, relative to the stiffness of a side")              \
  X(ACCURACY, DIAGONALS, "object.accuracy", REAL, 1, "", 0, 0.5, "",                                                  \
    scene.accuracy,                                                                                                   \
    "relative error of the force that wider cells away from the tools may cause; none or 0: no wider cells")          \
  X(MARGIN, DIAGONALS, "object.margin", REAL, 1, "m", 1e-5, 1, "",                                                    \
    margin_m, "margin of fine cells around the reach of the tools; none: 0.7 times the width of the widest tool")     \
  X(PRESSURE, ALWAYS, "object.pressure", CHOICE, 1, "none|cells|object", 0, 0, "none",                                \
    scene.model.pressure, "gas enclosed in each cell or in the whole object; it resists changes of volume")           \
  X(INSIDE_PRESSURE, PRESSURE, "object.inside_pressure", REAL, 1, "Pa", 100, 1e8, "1 atm",                            \
    scene.model.inside_pressure_pa, "absolute pressure of the enclosed gas at rest")                                  \
  X(FORCE_FACTOR, ALWAYS, "object.force_factor", REAL, 1, "", 0.3, 3, "",                                             \
    scene.model.force_factor,                                                                                         \
    "factor on the forces of a lattice of this spacing, as knead tradeoff --spacing finds it; none: 1")               \
  X(SKIN, BLOCK, "object.skin", CHOICE, 1, "spline|bilinear", 0, 0, "",                                               \
    scene.model.skin,                                                                                                 \
    "shape of the skin between nodes in contact; none: spline, smoother under tools of a radius below 2 spacings")    \
  X(VARIANT, ALWAYS, "material.variant", CHOICE, 1, "rheological|viscoelastic|plastic", 0, 0, "rheological",          \
    variant,                                                                                                          \
    "rheological: values as written; others by rules of the second paper; short form: material: NAME-VARIANT")        \
  X(K1, ALWAYS, "material.k1", MODULUS, 1, "Pa", 0, 1e9, NULL,                                                        \
    scene.model.material.k1_pa, "modulus of the spring in the Voigt element")                                         \
  X(C1, ALWAYS, "material.c1", MODULUS, 1, "Pa*s", 0, 1e9, NULL,                                                      \
    scene.model.material.c1_pa_s, "viscosity of the dashpot in the Voigt element")                                    \
  X(DAMPER, ALWAYS, "material.damper", CHOICE, 1, "none|constant|exponential|ramp", 0, 0, NULL,                       \
    scene.model.material.damper,                                                                                      \
    "law of the damper in series with the Voigt element; the deformation of this damper stays")                       \
  X(C2, CONSTANT, "material.c2", MODULUS, 1, "Pa*s", 1e-6, 1e12, NULL,                                                \
    scene.model.material.c2_pa_s, "viscosity of the constant damper")                                                 \
  X(ALPHA, EXPONENTIAL, "material.alpha", MODULUS, 1, "Pa*s", 1e-6, 1e15, NULL,                                       \
    scene.model.material.alpha_pa_s, "the damper's viscosity is alpha exp(-beta |stress|)")                           \
  X(BETA, EXPONENTIAL, "material.beta", REAL, 1, "1/Pa", 0, 1, NULL,                                                  \
    scene.model.material.beta_per_pa, "beta in the viscosity alpha exp(-beta |stress|) of the damper")                \
  X(C_MAX, RAMP, "material.c_max", MODULUS, 1, "Pa*s", 1e-6, 1e15, NULL,                                              \
    scene.model.material.c_max_pa_s, "the damper's viscosity up to the stress p0")                                    \
  X(C_MIN, RAMP, "material.c_min", MODULUS, 1, "Pa*s", 1e-6, 1e15, NULL,                                              \
    scene.model.material.c_min_pa_s,                                                                                  \
    "the damper's viscosity above the stress p1; an exponential damper may have c_max, c_min instead of alpha, beta") \
  X(P0, FORCE, "material.p0", REAL, 1, "Pa", 0, 1e9, NULL,                                                            \
    scene.model.material.p0_pa, "stress up to which the damper's viscosity is constant")                              \
  X(P1, FORCE, "material.p1", REAL, 1, "Pa", 1e-6, 1e9, NULL,                                                         \
    scene.model.material.p1_pa, "stress above which the damper's viscosity is constant")                              \
  X(STROKE, ALWAYS, "material.stroke", REAL, 2, "", 0, 1, "",                                                         \
    scene.model.material.stroke,                                                                                      \
    "[a_min, a_max]: end stops of the damper, as the share of the Voigt element in an edge; none: no stops")          \
  X(RATIO, ALWAYS, "material.ratio", REAL, 1, "", 0, 1, "",                                                           \
    scene.model.material.ratio,                                                                                       \
    "a0: share of the Voigt element in a new edge; only with a stroke; none: 0.2, or c2/(c1 + c2) if k1 is 0")        \
  X(SPECIMEN_HEIGHT, ALWAYS, "material.specimen_height", REAL, 1, "m", 1e-4, 10, "",                                  \
    specimen_height_m,                                                                                                \
    "height of a specimen: factor on k1, c1, c2, alpha, c_max and c_min that are given per height (Pa/m, gf/cm^3)")   \
  X(DENSITY, ALWAYS, "density", REAL, 1, "kg/m^3", 1, 3e4, NULL,                                                      \
    scene.model.density_kg_m3, "density of the object")                                                               \
  X(GRAVITY, ALWAYS, "gravity", REAL, 1, "m/s^2", 0, 100, "0 m/s^2",                                                  \
    scene.model.gravity_m_s2, "gravity, downwards along -z")                                                          \
  X(SUPPORT, ALWAYS, "support", CHOICE, 1, "bonded|frictionless|none|friction", 0, 0, NULL,                           \
    scene.model.support,                                                                                              \
    "bonded: base glued; frictionless: base slides on a table; none: free; friction: lies on a table, can be lifted") \
  X(SUPPORT_FRICTION, TABLE, "support_friction", REAL, 1, "", 0, 10, "0.5",                                           \
    scene.model.support_friction,                                                                                     \
    "coefficient of friction of the table while the object slides; 1.2 times as much while the object sticks")        \
  X(SUPPORT_DEPTH, MESH, "support_depth", REAL, 1, "m", 0, 10, "",                                                    \
    scene.model.support_depth_m, "height up to which the support holds the nodes of a mesh; none: only the lowest")   \
  X(PROFILE, ALWAYS, "device.profile", CHOICE, 1, "touch|bench|falcon|omega|unknown", 0, 0, NULL,                     \
    profile,                                                                                                          \
    "haptic device; bench: the virtual hand; short form: device: NAME, or device: FILE.yaml, a file of yours")        \
  X(CLAMP, ALWAYS, "device.clamp", REAL, 1, "N", 0.1, 100, "(profile)",                                               \
    scene.limits.clamp_n, "largest force on a hand")                                                                  \
  X(TORQUE_CLAMP, ALWAYS, "device.torque_clamp", REAL, 1, "N*m", 1e-3, 10, "(0.05 m * clamp)",                        \
    scene.limits.torque_clamp_n_m, "largest torque on a hand")                                                        \
  X(GUARD, ALWAYS, "device.guard", REAL, 1, "N/ms", 0.1, 100, "4 N/ms", scene.limits.guard_n_per_ms,                  \
    "impulse guard: largest change of force per ms; n times as large after n ms without a pose, n <= device.hold")    \
  X(BRAKE_SPEED, ALWAYS, "device.brake_speed", REAL, 1, "m/s", 0.05, 5, "1.2 m/s",                                    \
    scene.limits.brake_m_s, "speed of the hand above which the force is only a damping force")                        \
  X(BRAKE_DAMPING, ALWAYS, "device.brake_damping", REAL, 1, "N*s/m", 0.01, 10, "1.5 N*s/m",                           \
    scene.limits.brake_n_s_per_m, "damping at speeds above device.brake_speed")                                       \
  X(RATE, ALWAYS, "device.rate", REAL, 1, "Hz", 66.7, 5000, "",                                                       \
    scene.rate_hz, "poses per second that the device sends; none: 1000 Hz")                                    \
  X(HOLD, ALWAYS, "device.hold", INTEGER, 1, "ms", 1, 15, "(device.rate)",                                            \
    scene.limits.hold_ms,                                                                                             \
    "the last force is held for so long without a pose: two periods of device.rate, 3 to 15 ms")                       \
  X(ZERO, ALWAYS, "device.zero", INTEGER, 1, "ms", 4, 20, "20 ms",                                                    \
    scene.limits.zero_ms, "time after the last pose at which the force is 0")                                         \
  X(RAMP, ALWAYS, "device.ramp", INTEGER, 1, "ms", 200, 5000, "200 ms",                                               \
    scene.limits.ramp_up_ms, "time in which the gain rises from 0 to 1 at engagement")                                \
  X(FLOW, ALWAYS, "device.flow", INTEGER, 1, "ms", 200, 5000, "200 ms",                                               \
    scene.limits.flow_ms, "time for which poses must arrive before the gain rises (device.ramp)")                     \
  X(DEVICE_MASS, ALWAYS, "device.mass", REAL, 1, "kg", 1e-3, 100, "(profile)",                                        \
    scene.device.mass_kg, "mass of the device, as felt at its tip")                                                   \
  X(DEVICE_DAMPING, ALWAYS, "device.damping", REAL, 1, "N*s/m", 0, 1e3, "(profile)",                                  \
    scene.device.damping_n_s_m, "viscous friction of the device's mechanics")                                         \
  X(DEVICE_FRICTION, ALWAYS, "device.friction", REAL, 1, "N", 0, 10, "(profile)",                                     \
    scene.device.friction_n, "dry friction of the device's mechanics")                                                \
  X(DEVICE_ENCODER, ALWAYS, "device.encoder", REAL, 1, "m", 0, 0.01, "(profile)",                                     \
    scene.device.encoder_m, "resolution of the device's positions")                                                   \
  X(DEVICE_WORKSPACE, ALWAYS, "device.workspace", REAL, 3, "m", 1e-3, 10, "(profile)",                                \
    scene.device.workspace_m, "extent of the device's workspace along its own axes")                                  \
  X(DEVICE_STIFFNESS, ALWAYS, "device.stiffness_limit", REAL, 1, "N/m", 1, 1e7, "(profile)",                          \
    scene.device.stiffness_limit_n_m, "stiffest wall that the device renders without vibration, as published")        \
  X(DEVICE_FORCE_AXES, ALWAYS, "device.force_axes", INTEGER, 1, "", 0, 3, "(profile)",                                \
    scene.device.force_axes, "number of axes along which motors make a force")                                        \
  X(DEVICE_TORQUE_AXES, ALWAYS, "device.torque_axes", INTEGER, 1, "", 0, 3, "(profile)",                              \
    scene.device.torque_axes, "number of axes about which motors make a torque")                                      \
  X(DEVICE_ROUND_TRIP, ALWAYS, "device.round_trip", REAL, 1, "s", 0, 0.2, "1 ms",                                     \
    scene.device.round_trip_s, "time from sending a pose to receiving its force")                                     \
  X(DEVICE_COUPLING, ALWAYS, "device.coupling", REAL, 1, "N/m", 1, 1e7, "(profile, round_trip)",                      \
    scene.device.hand.stiffness_n_m, "stiffness of the virtual coupling as the hand feels it, see core/coupling.h")   \
  X(DEVICE_COUPLING_DAMPING, ALWAYS, "device.coupling_damping", REAL, 1, "N*s/m", 0, 1e4, "(profile, round_trip)",    \
    scene.device.hand.damping_n_s_m, "damping of the virtual coupling as the hand feels it")                          \
  X(DEVICE_FORCE_SCALE, ALWAYS, "device.force_scale", REAL, 1, "", 1e-3, 100, "1",                                    \
    scene.limits.force_scale, "force on the hand, relative to the object's force")                                    \
  X(DEVICE_BASIS, ALWAYS, "device.basis", REAL, 3, "", -3, 3, "([1, 2, 3])",                                          \
    scene.device.basis, "device axis (1, 2, 3) along each of the scene's x, y, z; negative: it points backwards")     \
  X(DEVICE_POSITION, ALWAYS, "device.position", REAL, 3, "m", -10, 10, "(origin)",                                    \
    scene.device.position_m, "position of the device's origin in the scene")                                          \
  X(DEVICE_ROTATION, ALWAYS, "device.rotation", REAL, 4, "", -1, 1, "([1, 0, 0, 0])",                                 \
    scene.device.rotation_wxyz, "rotation of the device, applied after basis: unit quaternion w, x, y, z")            \
  X(DEVICE_SCALE, ALWAYS, "device.scale", REAL, 1, "", 1e-3, 1e3, "1",                                                \
    scene.device.scale, "scale of lengths: metres in the scene for one metre of the device")                          \
  X(KIND, ALWAYS, "solver.kind", CHOICE, 1, "implicit|rk4|fixed", 0, 0, "implicit",                                   \
    scene.model.solver.kind,                                                                                          \
    "method of a step; rk4: the papers' method, refused if dt is not stable; fixed: integers, as in a circuit")       \
  X(PRECISION, ALWAYS, "solver.precision", CHOICE, 1, "f32|f64", 0, 0, "(f32; others f64)",                           \
    scene.model.solver.precision, "floating-point format of the lattice")                                             \
  X(LINEARIZATION, ALWAYS, "solver.linearization", CHOICE, 1, "blend|secant|tangent", 0, 0, "blend",                  \
    scene.model.solver.linearization, "linearisation of the material law in a step")                                  \
  X(ISA, ALWAYS, "solver.isa", CHOICE, 1, "auto|base|avx2|avx512", 0, 0, "auto",                                      \
    scene.model.solver.isa, "instruction set; every choice gives the same bits")                                      \
  X(DT, ALWAYS, "solver.dt", REAL, 1, "s", 1e-9, 0.1, "1 ms",                                                         \
    scene.model.solver.dt_s, "time step")                                                                             \
  X(ITERATIONS, ALWAYS, "solver.iterations", INTEGER, 1, "", 1, 1000, "4",                                            \
    scene.model.solver.iterations,                                                                                    \
    "conjugate gradient iterations of every step; kind fixed: Jacobi iterations, default 8, at most 32")              \
  X(ITERATIONS_MAX, ALWAYS, "solver.iterations_max", INTEGER, 1, "", 1, 1000, "24",                                   \
    scene.model.solver.iterations_max, "largest number of iterations, used while the residual is above the tolerance")\
  X(TOLERANCE, ALWAYS, "solver.tolerance", REAL, 1, "", 0, 1, "1e-3",                                                 \
    scene.model.solver.tolerance,                                                                                     \
    "tolerated residual, relative to the largest residual of the last second; 0: always solver.iterations")           \
  X(PASSES, ALWAYS, "solver.passes", INTEGER, 1, "", 1, 20, "1",                                                      \
    scene.model.solver.passes, "linearisations per step; kind fixed: default 2, at most 15")                          \
  X(MASS_SCALE, ALWAYS, "solver.mass_scale", REAL, 1, "", 1, 1e9, "1",                                                \
    scene.model.solver.mass_scale,                                                                                    \
    "factor on the inertia, not on the weight; a larger factor makes a longer dt of rk4 stable")                      \
  X(BUDGET, ALWAYS, "solver.budget", REAL, 1, "s", 1e-5, 1e-3, "",                                                    \
    scene.budget_s,                                                                                                   \
    "time budget of a tick; if 10 ticks in a row exceed it, the server takes a faster quality point; none: 0.8 ms")   \
  X(THREADS, ALWAYS, "solver.threads", INTEGER, 1, "", 1, 2, "",                                                      \
    scene.threads, "threads of a step in kneadd, each on a processor of its own; the bits are the same; none: 1")     \
  X(CHOSEN, ALWAYS, "quality.chosen", CHOICE, 1, "fast|balanced|accurate|own", 0, 0, "",                              \
    chosen, "quality point in use; own: the values under solver; short form: quality: NAME, --quality NAME")          \
  KN_QUALITY_KEYS(X, FAST, "quality.fast.", fast)                                                                     \
  KN_QUALITY_KEYS(X, BALANCED, "quality.balanced.", balanced)                                                         \
  KN_QUALITY_KEYS(X, ACCURATE, "quality.accurate.", accurate)                                                         \
  X(MESH_RATE, ALWAYS, "mesh.rate", REAL, 1, "Hz", 30, 60, "30 Hz",                                                   \
    scene.mesh_hz, "meshes published per second")                                                                     \
  X(MESH_MEASURES, ALWAYS, "mesh.measures", CHOICE, 1, "none|stress|residual|both", 0, 0, "",                         \
    scene.mesh_measures,                                                                                              \
    "values of the nodes in a published mesh: von Mises stress, residual strain; none: positions only")

#define KN_PROBE_KEYS(X)                                                                                              \
  X(PROBE_NAME, ALWAYS, "probes.NAME.name", NAME, 1, "", 0, 0, NULL,                                                  \
    name, "name of the probe; its channels are KNEAD_POSE_NAME, KNEAD_FORCE_NAME; at most 4 probes")                  \
  X(PROBE_SHAPE, ALWAYS, "probes.NAME.shape", CHOICE, 1, "plate|sphere|capsule|box|cross|cylinder|union|mesh",        \
    0, 0, NULL,                                                                                                       \
    shape, "plate: a level rectangle; the other shapes turn with their pose, see core/shape.h")                        \
  X(PROBE_SIZE, PLATE, "probes.NAME.size", REAL, 2, "m", 1e-4, 10, NULL,                                              \
    size_m, "size of the plate along x and y")                                                                        \
  X(PROBE_SURFACE, PLATE, "probes.NAME.surface", CHOICE, 1, "sticks|slides", 0, 0, "",                                \
    surface, "sticks: the skin moves with the plate; slides: it slides on it without friction; none: sticks")         \
  X(PROBE_EXTENT, BOX, "probes.NAME.extent", REAL, 3, "m", 1e-4, 10, NULL,                                            \
    size_m, "box: size along x, y, z; cross: arm length, arm width, height")                                          \
  X(PROBE_RADIUS, ROUND, "probes.NAME.radius", REAL, 1, "m", 1e-4, 1, NULL,                                           \
    radius_m, "radius: at least one spacing of the lattice, 1.5 spacings advised")                                    \
  X(PROBE_LENGTH, LONG, "probes.NAME.length", REAL, 1, "m", 1e-4, 10, NULL,                                           \
    length_m, "capsule, cylinder: length along z, upwards from the pose")                                             \
  X(PROBE_EDGE, EDGED, "probes.NAME.edge", REAL, 1, "m", 0, 1, "",                                                    \
    edge_m, "radius to which the edges are rounded; none: sharp edges")                                               \
  X(PROBE_FOUNDATION, TOOL, "probes.NAME.foundation", REAL, 1, "N/m^3", 1e3, 1e12, "2.5e7 N/m^3",                     \
    foundation_n_m3, "stiffness of the contact per area")                                                             \
  X(PROBE_FRICTION, TOOL, "probes.NAME.friction", REAL, 1, "", 0, 100, "",                                            \
    friction, "coefficient of friction while the contact slides; 1.2 times as much while it sticks; none: 0")         \
  X(PROBE_ADHESION, ALWAYS, "probes.NAME.adhesion", REAL, 1, "Pa", 0, 1e7, "",                                        \
    adhesion_pa, "tension at which the contact tears off; none: no adhesion")                                         \
  X(PROBE_GRIP, TOOL, "probes.NAME.grip", REAL, 1, "N", 0, 100, "",                                                   \
    grip_n, "largest force with which the contact is tied to the tool while button 1 is pressed; none: no grip")      \
  X(PROBE_COUPLING, TOOL, "probes.NAME.coupling", REAL, 1, "N/m", 0, 1e6, "",                                         \
    coupling_n_m,                                                                                                     \
    "stiffness of the spring between pose and tool; 0: rigid; none: the coupling of the device, 0 for device bench")  \
  X(PROBE_COUPLING_DAMPING, TOOL, "probes.NAME.damping", REAL, 1, "N*s/m", 0, 1e4, "",                                \
    coupling_n_s_m, "damping of the spring between pose and tool; none: the coupling_damping of the device")          \
  X(PROBE_REACH, ALWAYS, "probes.NAME.reach", REAL, 4, "m", -10, 10, "",                                              \
    reach_m, "[x_min, x_max, y_min, y_max]: limits of the probe's centre; required by object.accuracy")

// Keys of a tool whose shape is the closed surface of a file.
#define KN_SURFACE_KEYS(X)                                                                                            \
  X(SURFACE, SURFACE, "probes.NAME.mesh", PATH, 1, ".stl|.obj", 0, 0, NULL,                                           \
    path, "file of a closed surface in the tool's frame; path relative to the scene's folder")                        \
  X(SURFACE_UNIT, SURFACE, "probes.NAME.mesh_unit", CHOICE, 1, "m|cm|mm|um", 0, 0, NULL,                              \
    unit, "unit of the surface's coordinates")                                                                        \
  X(SURFACE_HASH, SURFACE, "probes.NAME.mesh_hash", HASH, 1, "", 0, 0, "",                                            \
    hash, "hash of the surface file; a file with another hash is refused")                                            \
  X(SURFACE_CELL, SURFACE, "probes.NAME.mesh_cell", REAL, 1, "m", 1e-5, 1, "",                                        \
    cell_m,                                                                                                           \
    "cell side of the grid of distances to the surface; none: spacing/8, or wider to fit 8 MiB, up to spacing/3")

// Keys of one part of a union: the part's shape and sizes, named like those of a probe, and its place in the tool.
#define KN_PART_KEYS(X)                                                                                               \
  X(PART_SHAPE, ALWAYS, "probes.NAME.parts.N.shape", CHOICE, 1, "sphere|capsule|box|cross|cylinder", 0, 0, NULL,      \
    kind, "shape of part N of a union, N from 1; at most 8 parts, of which a cross counts as two")                    \
  X(PART_EXTENT, BOX, "probes.NAME.parts.N.extent", REAL, 3, "m", 1e-4, 10, NULL,                                     \
    as.size_m, "box: size along the part's x, y, z; cross: arm length, arm width, height")                            \
  X(PART_RADIUS, ROUND, "probes.NAME.parts.N.radius", REAL, 1, "m", 1e-4, 1, NULL,                                    \
    as.radius_m, "radius of a part that is a sphere, capsule or cylinder; at least one spacing of the lattice")       \
  X(PART_LENGTH, LONG, "probes.NAME.parts.N.length", REAL, 1, "m", 1e-4, 10, NULL,                                    \
    as.length_m, "capsule, cylinder: length along the part's own z, upwards from the part's origin")                  \
  X(PART_EDGE, EDGED, "probes.NAME.parts.N.edge", REAL, 1, "m", 0, 1, "",                                             \
    as.edge_m, "radius to which the part's edges are rounded; none: sharp edges")                                     \
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
    // the conditions below concern the shape of a tool
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
    KN_TYPE_MODULUS, // double; may be given per metre of specimen height; draft.c multiplies, then checks the range
    KN_TYPE_EXTENT,  // double[3]: extents along x, y, z; a list of two values gives x and z, and y becomes 0
    KN_TYPE_INTEGER, // int
    KN_TYPE_CHOICE,  // enum or int: index of a word in the list of words in the column `unit`
    KN_TYPE_NAME,    // char[KN_NAME_MAX]: text of the characters a-z 0-9 _
    KN_TYPE_PATH,    // char[KN_PATH_MAX]: printable UTF-8; the column `unit` lists the file endings: ".stl|.obj"
    KN_TYPE_TEXT,    // char[KN_PATH_MAX]: printable UTF-8
    KN_TYPE_HASH     // uint64_t, 16 hexadecimal digits
} kn_key_type;

typedef struct kn_key {
    kn_key_when when;
    const char *path;
    kn_key_type type;
    int count;
    const char *unit; // unit of the value; CHOICE: the allowed words "a|b|c"; PATH: the allowed file endings
    double least, most;
    const char *fallback;
    size_t offset; // offset of the member in the struct that holds the value [bytes]
    const char *meaning;
} kn_key;

extern const kn_key kn_keys[KN_KEY_COUNT];

#define KN_PATH_MAX 1024
#define KN_LINE_MAX 256 // size of a buffer for a key's path, help line or part of a message, NUL included [bytes]

// Return true if the value is a text of up to KN_PATH_MAX - 1 bytes, which the canonical text quotes.
static inline bool kn_key_long(const kn_key *key) { return key->type == KN_TYPE_PATH || key->type == KN_TYPE_TEXT; }

// Read `count` texts as the value of a key and store the value at `field`. On failure return false and write into
// `problem` what is wrong, e.g. "'7' has no unit". If the key is a MODULUS, *per_height becomes true if the value is
// given per metre of specimen height, else false. For any other key, per_height may be NULL.
bool kn_key_read(const kn_key *key, void *field, const char *const *text, int count, bool *per_height,
                 char problem[KN_LINE_MAX]);

// Return true if a text can stand between single quotes in YAML and is read back unchanged: valid UTF-8 without control
// characters and line breaks.
bool kn_key_quotable(const char *text);

// Return the index of a word in a list of words "a|b|c", or -1 if the list does not contain the word.
int kn_choice_of(const char *words, const char *word);

// Write into `text` which values the key expects, e.g. "a list of 3, each from 1e-05 to 10 m", and return `text`.
const char *kn_key_expects(const kn_key *key, char text[KN_LINE_MAX]);

// Write the value at `field` into `text` as canonical text, e.g. "[0.05 m, 0.05 m, 0.03 m]", and return `text`. A real
// number has as many digits as are needed to read the same bits back. Do not call with a PATH, which may be longer.
const char *kn_key_print(const kn_key *key, const void *field, char text[KN_LINE_MAX]);

// Return the key with a path such as "material.k1", or NULL if there is no such key. *is_group becomes true if the path
// is a mapping that holds keys, such as "material".
const kn_key *kn_key_find(const char *path, bool *is_group);

// Write into `text` a correction of an unknown path, and return `text`: "did you mean material.k1?" or "expected one
// of: k1, c1".
const char *kn_key_suggest(const char *path, char text[KN_LINE_MAX]);

// Compare a wrong word with a valid one, to find a suggestion for "did you mean ...?". Return true if `word` is similar
// to `wrong`, and more so than all words that were compared before. *edits must be 0 before the first comparison; it
// becomes the number of edits that turn `wrong` into the best word, and stays 0 if no word is similar.
bool kn_word_nearer(const char *wrong, const char *word, int *edits);

#endif

#ifndef KN_CLIENTS_COMMANDS_H
#define KN_CLIENTS_COMMANDS_H
// The subcommands of `knead SUBCOMMAND ...`. A new subcommand needs one line here and a function kn_<name>_main.
//
//     X(name, "summary, as `knead --help` prints it")
//
// argv[0] of kn_<name>_main is "knead <name>". Every subcommand answers --help itself: on stdout, with exit code 0.
// `knead NAME --version` is answered in main.c. Results go to stdout. Errors go to stderr, one line each.
#include "clients/cli/command.h"

#define KN_COMMANDS(X)                                                                                                 \
    X(batch, "play a list of knead commands here, on other machines or by Slurm; one table of their results")          \
    X(check, "describe a scene: size, cost, warnings; list the keys of a scene")                                       \
    X(completion, "print the bash or zsh completion of knead, kneadd and knead-simdev")                                \
    X(creep, "virtual rheometer: load a specimen, then unload it; height, recovery, residual")                         \
    X(ctl, "control a running kneadd: status, reset, undo, set, quality, snapshot, estop, recover ...")                \
    X(demo, "serve a block of dough, press it once, and serve a page where the mouse presses it")                      \
    X(devices, "list haptic devices on this machine: how to use each, what is missing and how to fix it")              \
    X(doctor, "check this machine for real time, LCM, devices and wake-up latency; print a fix for each problem")      \
    X(element, "analyse an element of springs and dampers: which material it is, impedance, response")                 \
    X(export, "export a recording to ParaView, MeshLab and tables: shape, stress, forces over time")                   \
    X(hand, "use a real haptic device on a running kneadd; not tested with hardware")                                  \
    X(identify, "fit material and structure to a measured creep, press, relaxation, sweep or shape, with uncertainty") \
    X(latency, "measure the latency of kneadd, from pose to force over LCM, and that of a bare LCM echo")              \
    X(mesh, "fill a closed surface (OBJ or STL) with tetrahedra for a scene, or check a mesh")                         \
    X(probe, "a virtual hand that moves a tool on a running kneadd: press, poke, swing; force table, recording")       \
    X(relax, "virtual rheometer: compress a specimen and hold it; decay of the stress")                                \
    X(replay, "replay a log through the code of kneadd; the forces are the same bit for bit")                          \
    X(stability, "test the solvers on thousands of small scenes with extreme values against exact solutions")          \
    X(sweep, "virtual rheometer: oscillate a specimen; storage and loss modulus against frequency")                    \
    X(touch, "show the contact of a tool live: pressures, area, centre, slip")                                         \
    X(tpa, "virtual rheometer: bite twice; hardness, cohesiveness, adhesiveness, chewiness")                           \
    X(tradeoff, "measure speed and accuracy on a recorded press; choose the quality points fast, balanced, accurate")  \
    X(view, "write a picture or a film of an object: live, recorded or at rest; needs no screen")                      \
    X(web, "serve a web page with the live object and a tool for the visitor; print its address")                      \
    X(zwidth, "simulate the stiffest wall that a device can render, for several delays and frictions")

#define KN_COMMAND(name, summary) int kn_##name##_main(int argc, char **argv);
KN_COMMANDS(KN_COMMAND)
#undef KN_COMMAND

// Run the subcommand argv[1] of the program argv[0] (knead/main.c). Return an exit code.
int kn_command_run(int argc, char **argv);

#endif

#ifndef KN_CLIENTS_COMMANDS_H
#define KN_CLIENTS_COMMANDS_H
// The subcommands of `knead SUBCOMMAND ...`. A new subcommand needs one line here and a file <name>.c with
// kn_<name>_main.
//
//     X(name, "summary, as `knead --help` prints it")
//
// argv[0] of kn_<name>_main is "knead <name>". Every subcommand answers --help itself: on stdout, with exit code 0.
// `knead NAME --version` is answered in main.c. Results go to stdout. Errors go to stderr, one line each.
#define KN_COMMANDS(X)                                                                                                 \
    X(check, "says what a scene is, what it costs, what to watch for; --keys: every key there is")                     \
    X(completion, "prints what bash or zsh completes knead, kneadd and knead-simdev by")                               \
    X(creep, "virtual rheometer: a weight on a specimen, then not; height, what comes back, what stays")               \
    X(ctl, "an operator's word to a running kneadd: status, reset, quality, snapshot, restore, undo, estop ...")       \
    X(devices, "what could be a hand on this machine: how to use it, what it lacks, the fix; --json")                  \
    X(doctor, "what this machine lacks for real time, LCM and devices, how late it wakes a thread; each with the fix") \
    X(element, "springs and dampers in series and parallel: what they do by the papers' rules, and what is so")        \
    X(export, "a recording as files for ParaView, MeshLab and tables: shape, stress, forces through time")             \
    X(hand, "a real device as the hand on a running kneadd: serial paddle, SpaceNavigator, Haply; untested")           \
    X(identify, "measured creep, relaxation, sweep or shape -> material and structure, and how well they are known")   \
    X(latency, "from a pose to its force through LCM on a real kneadd, stage by stage, beside a bare echo")            \
    X(mesh, "fills a closed surface, OBJ or STL, with tetrahedra for a scene; checks a mesh and says what it has")     \
    X(probe, "a virtual hand: press, poke or swing a tool on a running kneadd; force table, recording")                \
    X(relax, "virtual rheometer: a specimen is compressed and held; how its stress falls")                             \
    X(replay, "plays a log through the daemon's own servo: the same forces, to the bit; CSV, hash, --verify")          \
    X(stability, "the solvers at the extremes, thousands of small scenes beside their converged answers")              \
    X(sweep, "virtual rheometer: a specimen is swung; storage and loss modulus against frequency")                     \
    X(touch, "what a tool touches, drawn live: pressures, area, centre, slip; --json; needs kneadd --touch")           \
    X(tpa, "virtual rheometer: two bites; hardness, cohesiveness, springiness, resilience")                            \
    X(tradeoff, "speed against accuracy under a recorded hand; picks for a budget, finds fast, balanced, accurate")    \
    X(view, "draws the object, live, recorded or at rest, without a screen: --png FILE, --video FILE")                 \
    X(web, "a page that shows the object live, with a tool in the visitor's hand; prints its address")                 \
    X(zwidth, "how stiff a wall a device can hold: simulated, against delay and friction, beside the bounds")

enum { // exit codes of all programs of this project
    KN_EXIT_OK = 0,
    KN_EXIT_FAILED = 1,   // a requested check failed, e.g. that of --verify or of a latency contract
    KN_EXIT_USAGE = 2,    // bad input: a wrong option, scene file or log
    KN_EXIT_DEVICE = 3,   // a device, the message bus or the operating system failed
    KN_EXIT_INTERNAL = 70 // error in the program itself
};

#define KN_COMMAND(name, summary) int kn_##name##_main(int argc, char **argv);
KN_COMMANDS(KN_COMMAND)
#undef KN_COMMAND

#endif

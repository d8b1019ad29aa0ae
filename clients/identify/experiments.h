#ifndef KN_CLIENTS_IDENTIFY_EXPERIMENTS_H
#define KN_CLIENTS_IDENTIFY_EXPERIMENTS_H
// The experiments of `knead identify COMMAND ...`. A new experiment needs one line in this list and one file <name>.c
// with the function kn_identify_<name>_main. That function is called with argv[0] = "knead identify <name>".
#define KN_EXPERIMENTS(X)                                                                                              \
    X(creep, "creep curves under one load or several -> k1, c1 and the damper, with intervals")                        \
    X(relax, "stress relaxation, with the way to the strain or without -> the same; which model the data support")     \
    X(shape, "a range image of a pressed lump, and the force -> structure, inside pressure, stress area")              \
    X(sweep, "storage and loss modulus over frequency -> springs and dampers, which of them the data support")

#define KN_EXPERIMENT(name, summary) int kn_identify_##name##_main(int argc, char **argv);
KN_EXPERIMENTS(KN_EXPERIMENT)
#undef KN_EXPERIMENT

#endif

#ifndef KN_CLIENTS_IDENTIFY_ROLES_H
#define KN_CLIENTS_IDENTIFY_ROLES_H
// Which column of a sheet is what was measured: by its name, whatever the instrument calls it, and its unit.
#include "clients/identify/sheet.h"

#define KN_ROLES(X)                                                                                                    \
    X(TIME, "time", "s")                                                                                               \
    X(HEIGHT, "height", "m")                                                                                           \
    X(DISPLACEMENT, "displacement", "m")                                                                               \
    X(STRAIN, "strain", "1")                                                                                           \
    X(COMPLIANCE, "compliance", "1/Pa")                                                                                \
    X(LOAD, "load", "N")                                                                                               \
    X(STRESS, "stress", "Pa")                                                                                          \
    X(MODULUS, "modulus", "Pa")                                                                                        \
    X(FREQUENCY, "frequency", "1/s")                                                                                   \
    X(STORAGE, "storage modulus", "Pa")                                                                                \
    X(LOSS, "loss modulus", "Pa")                                                                                      \
    X(TANGENT, "tan delta", "1")                                                                                       \
    X(PHASE, "phase angle", "rad")

typedef enum kn_role {
#define X(role, name, unit) KN_##role,
    KN_ROLES(X)
#undef X
        KN_ROLE_COUNT
} kn_role;

const char *kn_role_name(kn_role role);

// The column, one that is sure before others; or -1. *code: after a complaint that its unit is missing or of another kind; NULL: then there is none.
int kn_role_find(kn_sheet *s, kn_role role, int *code);

// Whether a column that was found has a unit, or the quantity's own word or letter for a name where it needs none. Else it may
// well be something else, and one of another quantity goes before it.
bool kn_role_is_sure(const kn_sheet *s, kn_role role, int column);

// The first of the roles that there is a column of, and *role which: one that is sure before one that is not.
// -1: none, or *code, KN_EXIT_OK before, says a complaint.
int kn_role_find_first(kn_sheet *s, int count, const kn_role *roles, kn_role *role, int *code);

// Several columns of one quantity, each headed by its load, "10 gf [mm]", "displacement_mm 10 gf": their number, at
// most `most`, and each one's load, N. 0: none.
int kn_role_find_loads(const kn_sheet *s, int most, int column[], double load_n[]);

#endif

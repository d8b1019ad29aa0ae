#ifndef KN_CLIENTS_IDENTIFY_ROLES_H
#define KN_CLIENTS_IDENTIFY_ROLES_H
// Roles: the quantities that columns of a sheet may hold. A column's role is found from its name, in the spellings of
// instruments, and from its unit.
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

// Return the column of a quantity, or -1. A sure column (kn_role_is_sure) is preferred. If the unit is missing or has
// another dimension, complain and set *code. If `code` is NULL, do not complain.
int kn_role_find(kn_sheet *s, kn_role role, int *code);

// Return whether a column that was found is sure: it has a unit, or its name is the quantity's own word or letter and
// needs no unit. A column that is not sure may hold something else, so a sure column of another quantity is preferred
// to it.
bool kn_role_is_sure(const kn_sheet *s, kn_role role, int column);

// Return the column of the first of `count` roles for which there is a column, and set *role to that role. A sure
// column is preferred to one that is not sure. Return -1 if there is none, or after a complaint; *code must be
// KN_EXIT_OK before the call.
int kn_role_find_first(kn_sheet *s, int count, const kn_role *roles, kn_role *role, int *code);

// Find several columns of one quantity that are headed by their loads, "10 gf [mm]" or "displacement_mm 10 gf". Store
// each column and its load, N. Return the number of columns, at most `most`.
int kn_role_find_loads(const kn_sheet *s, int most, int column[], double load_n[]);

#endif

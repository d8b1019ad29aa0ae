#ifndef KN_CLIENTS_IDENTIFY_ROLES_H
#define KN_CLIENTS_IDENTIFY_ROLES_H
// Roles: the physical quantities that columns of a sheet may hold. The role of a column is found from the column's
// name, in the spellings of instruments, and from the column's unit.
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

// Return the index of the column that holds a quantity, or -1. A column whose quantity is certain (kn_role_is_sure) is
// preferred. If the unit of the only matching column is missing or has the wrong dimension, print an error and set
// *code to an exit code. If `code` is NULL, print nothing.
int kn_role_find(kn_sheet *s, kn_role role, int *code);

// Return whether the quantity in a column that was found is certain. It is certain if the column has a unit, or if the
// quantity needs no unit and the column's name is the quantity's own word or letter. An uncertain column may hold
// something else, so a column that certainly holds another usable quantity is preferred.
bool kn_role_is_sure(const kn_sheet *s, kn_role role, int column);

// Return the column of the first of `count` roles for which the sheet has a column, and set *role to that role. A
// column whose quantity is certain (kn_role_is_sure) is preferred to an uncertain one. If there is no column, return
// -1. On an error print the error, set *code to an exit code and return -1. *code must be KN_EXIT_OK before the call.
int kn_role_find_first(kn_sheet *s, int count, const kn_role *roles, kn_role *role, int *code);

// Find several columns of one quantity that are headed by their loads, such as "10 gf [mm]" or "displacement_mm 10 gf".
// Store the index of each column in column[] and its load in load_n[]. Return the number of columns, at most `most`.
int kn_role_find_loads(const kn_sheet *s, int most, int column[], double load_n[]);

#endif

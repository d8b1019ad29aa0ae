#ifndef KN_CLIENTS_EXTREMES_H
#define KN_CLIENTS_EXTREMES_H
// What is tried at the extremes: maps of trials, one trial a cell, grouped in families. The scenes are small, some
// fifty nodes of dough at their common point, so that thousands take minutes; a family of its own makes them larger.
#include "clients/knead/trial.h"

#define KN_MAP_SIDE 16
#define KN_MAPS_MAX 96

typedef struct kn_map {
    const char *family;
    char title[80];
    const char *across, *down; // what changes along x, and from row to row
    int columns, rows;
    double x[KN_MAP_SIDE], y[KN_MAP_SIDE];
    const char *y_text[KN_MAP_SIDE]; // in place of the numbers where they are choices
    int variant;
} kn_map;

extern const char *const kn_families[];  // names, NULL-terminated, in the order of the maps
const char *kn_family_about(int family); // one line

// Fills the maps; returns their number. quick: fewer cells of each.
int kn_maps(kn_map maps[KN_MAPS_MAX], bool quick);

// The trial of a cell; free with kn_trial_free. False: memory is short.
bool kn_map_trial(const kn_map *map, int column, int row, kn_trial *trial);

#endif

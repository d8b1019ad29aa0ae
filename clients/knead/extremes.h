#ifndef KN_CLIENTS_EXTREMES_H
#define KN_CLIENTS_EXTREMES_H
// Trials of the solvers with extreme parameters (trial.h), for `knead stability`. The trials are arranged in maps, one
// trial per cell, and the maps are grouped in families. The scenes are small: some fifty nodes of dough with common
// parameters, so that thousands of trials take minutes. Only the family "size" has larger scenes.
#include "clients/knead/trial.h"

#define KN_MAP_SIDE 16
#define KN_MAPS_MAX 96

typedef struct kn_map {
    const char *family;
    char title[80];
    // Parameter that changes from column to column, and parameter that changes from row to row.
    const char *across, *down;
    int columns, rows;
    double x[KN_MAP_SIDE], y[KN_MAP_SIDE];
    const char *y_text[KN_MAP_SIDE]; // labels of the rows, if the rows are choices (e.g. materials) instead of numbers
    int variant;
} kn_map;

// Names of the families of maps, NULL-terminated, in the order of the maps.
extern const char *const kn_families[];
// Return a description of a family of maps in one line.
const char *kn_family_about(int family);

// Fill `maps` with all maps and return their number. If `quick` is true, each map has fewer cells.
int kn_maps(kn_map maps[KN_MAPS_MAX], bool quick);

// Create the trial that belongs to one cell of a map. Free it with kn_trial_free. Return false if out of memory.
bool kn_map_trial(const kn_map *map, int column, int row, kn_trial *trial);

#endif

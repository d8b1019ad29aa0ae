#ifndef KN_CLIENTS_STABILITY_ATLAS_H
#define KN_CLIENTS_STABILITY_ATLAS_H
// The maps of `knead stability` (stability_trial.h) with the outcome of every cell. A cell is one trial of the solvers
// on a small scene (stability_trial.h). Several processes try the cells in parallel. Afterwards the maps are printed,
// written to a file and drawn. Text and files do not depend on the number of processes.
#include "clients/sweep/stability_trial.h"

#define KN_STABILITY_ATLAS_JOBS_MAX 256

typedef struct kn_stability_atlas {
    kn_stability_map map[KN_STABILITY_MAPS_MAX];
    int maps;
    // Index of the first cell of each map, followed by the total number of cells. The cells of a map are numbered row
    // by row, from left to right.
    int first[KN_STABILITY_MAPS_MAX + 1];
    kn_outcome *cell; // outcome of each cell, in memory that all processes share
    double seconds;   // wall-clock duration of the survey of all cells, s
} kn_stability_atlas;

// Functions of this header that return int return an exit code. On failure they print one line on stderr.
//
// Run the trials of all cells in `jobs` parallel processes. If `quick` is true, each map has fewer cells. Only maps of
// the family `family` are included, or all maps if it is NULL.
int kn_stability_atlas_survey(kn_stability_atlas *atlas, bool quick, const char *family, int jobs);
void kn_stability_atlas_free(kn_stability_atlas *atlas);

// Print the table of the outcomes, the maps and remarks on single cells. Return true if, in every cell, the default
// solver gives a right result or refuses the scene.
bool kn_stability_atlas_print(const kn_stability_atlas *atlas);

int kn_stability_atlas_write(const kn_stability_atlas *atlas,
                             const char *path); // write the outcome of every cell as CSV
int kn_stability_atlas_draw(const kn_stability_atlas *atlas, const char *path); // draw the maps as PNG

#endif

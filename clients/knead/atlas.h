#ifndef KN_CLIENTS_ATLAS_H
#define KN_CLIENTS_ATLAS_H
// The maps of `knead stability` (extremes.h) with the outcome of every cell. A cell is one trial of the solvers on a
// small scene (trial.h). Several processes try the cells in parallel. Afterwards the maps are printed, written to a
// file and drawn. Text and files do not depend on the number of processes.
#include "clients/knead/extremes.h"

#define KN_ATLAS_JOBS_MAX 256

typedef struct kn_atlas {
    kn_map map[KN_MAPS_MAX];
    int maps;
    // Number of the first cell of each map, followed by the number of all cells. Cells are numbered row by row, from
    // left to right.
    int first[KN_MAPS_MAX + 1];
    kn_outcome *cell; // in memory that all processes share
    double seconds;   // duration of the survey
} kn_atlas;

// Functions that return int return an exit code. On failure they print one line on stderr.
//
// Try all cells with `jobs` processes. `quick`: fewer cells in each map. If `family` is NULL, all families of maps are
// included.
int kn_atlas_survey(kn_atlas *atlas, bool quick, const char *family, int jobs);
void kn_atlas_free(kn_atlas *atlas);

// Print the table, the maps and remarks on single cells. Return true if the default solver is right or refuses the
// scene in every cell.
bool kn_atlas_print(const kn_atlas *atlas);

int kn_atlas_write(const kn_atlas *atlas, const char *path); // CSV
int kn_atlas_draw(const kn_atlas *atlas, const char *path);  // PNG

#endif

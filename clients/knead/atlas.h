#ifndef KN_CLIENTS_ATLAS_H
#define KN_CLIENTS_ATLAS_H
// All maps of the extremes with what came of every cell: surveyed by processes side by side, printed, written, drawn.
// The same text and files whatever the number of processes.
#include "clients/knead/extremes.h"

#define KN_ATLAS_JOBS_MAX 256

typedef struct kn_atlas {
    kn_map map[KN_MAPS_MAX];
    int maps;
    int first[KN_MAPS_MAX + 1]; // cell of each map's first; the last: their number. Rows run from left to right
    kn_outcome *cell;           // shared with the processes
    double seconds;             // that the survey took
} kn_atlas;

// All functions that return int return an exit code and complain in one line. family NULL: all.
int kn_atlas_survey(kn_atlas *atlas, bool quick, const char *family, int jobs);
void kn_atlas_free(kn_atlas *atlas);

// Table, maps, what is to be said of single cells. Whether the default solver is right or refuses everywhere.
bool kn_atlas_print(const kn_atlas *atlas);

int kn_atlas_write(const kn_atlas *atlas, const char *path); // CSV
int kn_atlas_draw(const kn_atlas *atlas, const char *path);  // PNG

#endif

#ifndef KN_CLIENTS_IDENTIFY_SQUEEZE_H
#define KN_CLIENTS_IDENTIFY_SQUEEZE_H
// The first paper's press, section 5, on a scene's block: 1 cm down at 1 cm/s, 30 s of hold, up again. What it takes,
// what stays, and two pictures.
#include <stdint.h>

typedef struct kn_squeeze {
    int64_t ticks;
    double *time_s, *force_n; // [ticks]; ended by kn_squeeze_free
    double peak_n, held_n;    // at the end of the hold
    double pressed_m, left_m; // how far below its height at rest the lowest of the top is, then and after the tool left
} kn_squeeze;

// scene: a file. png: where the block is drawn at the end of the hold and after the tool has left. An exit code, after
// a complaint.
int kn_squeeze_run(kn_squeeze *squeeze, const char *subcommand, const char *scene, const char *const png[2]);
void kn_squeeze_free(kn_squeeze *squeeze); // zeroed is fine

#endif

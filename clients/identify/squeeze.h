#ifndef KN_CLIENTS_IDENTIFY_SQUEEZE_H
#define KN_CLIENTS_IDENTIFY_SQUEEZE_H
// Squeeze: the press of the first paper, section 5, on the block of a scene: 1 cm down at 1 cm/s, 30 s of hold, up
// again. The results are the force, the remaining dent, and two pictures.
#include <stdint.h>

typedef struct kn_squeeze {
    int64_t ticks;
    double *time_s, *force_n; // [ticks]; freed by kn_squeeze_free
    double peak_n, held_n;    // peak_n: largest force; held_n: force at the end of the hold
    // Depth of the lowest vertex of the top below the top at rest: at the end of the hold, and after the tool has left.
    double pressed_m, left_m;
} kn_squeeze;

// Run the press. scene: a file. png: paths of two pictures, at the end of the hold and after the tool has left. Return
// an exit code, after a complaint.
int kn_squeeze_run(kn_squeeze *squeeze, const char *subcommand, const char *scene, const char *const png[2]);
void kn_squeeze_free(kn_squeeze *squeeze); // a zeroed struct is fine

#endif

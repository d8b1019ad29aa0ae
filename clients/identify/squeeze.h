#ifndef KN_CLIENTS_IDENTIFY_SQUEEZE_H
#define KN_CLIENTS_IDENTIFY_SQUEEZE_H
// Squeeze: a simulated press as in the first paper, section 5, on the block of a scene. The tool moves 1 cm down at
// 1 cm/s, stays for 30 s, and moves up again. The results are the force over time, the remaining dent, and two
// pictures.
#include <stdint.h>

typedef struct kn_squeeze {
    int64_t ticks;
    double *time_s, *force_n; // [ticks]; freed by kn_squeeze_free
    double peak_n, held_n;    // peak_n: largest force; held_n: force at the end of the hold
    // Depth of the block's dent: how far the lowest vertex of the top surface is below the top at rest. pressed_m: at
    // the end of the hold; left_m: after the tool has left.
    double pressed_m, left_m;
} kn_squeeze;

// Simulate the press. `scene` is the path of a scene file. `png` holds the paths of two pictures: the block at the end
// of the hold, and after the tool has left. Return 0, or print an error and return an exit code.
int kn_squeeze_run(kn_squeeze *squeeze, const char *subcommand, const char *scene, const char *const png[2]);
void kn_squeeze_free(kn_squeeze *squeeze); // a zeroed struct is allowed

#endif

#ifndef KN_CLIENTS_LIKE_H
#define KN_CLIENTS_LIKE_H
// Whether a scene of two resolutions keeps what its object.accuracy states: a log played on it, and on the same scene
// with cells of object.spacing everywhere. Prints; returns an exit code, 1 when it does not.

// sets: as of --set; has room for one more.
int kn_like_uniform(const char *scene, const char *log, const char **sets, int count);

#endif

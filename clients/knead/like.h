#ifndef KN_CLIENTS_LIKE_H
#define KN_CLIENTS_LIKE_H
// Check if a scene with two lattice resolutions keeps its stated object.accuracy. A log is replayed on the scene itself
// and on the same scene with a uniform lattice of cells of object.spacing. Print the result and return an exit code: 1
// if the accuracy is missed.

// `sets` holds the `count` arguments of the option --set and must have room for one more.
int kn_like_uniform(const char *scene, const char *log, const char **sets, int count);

#endif

#ifndef KN_CLIENTS_LIKE_H
#define KN_CLIENTS_LIKE_H
// Check if a scene with two resolutions keeps its object.accuracy. A log is played on the scene and on the same scene
// with cells of object.spacing everywhere. Print the result and return an exit code: 1 if the accuracy is missed.

// `sets` are the `count` values of --set, with room for one more.
int kn_like_uniform(const char *scene, const char *log, const char **sets, int count);

#endif

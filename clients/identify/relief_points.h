#ifndef KN_CLIENTS_IDENTIFY_RELIEF_POINTS_H
#define KN_CLIENTS_IDENTIFY_RELIEF_POINTS_H
// How far a point is from a surface of triangles that are counter-clockwise from outside, m: > 0 outside, by the side
// of the nearest triangle (of several as near the one that it stands over most squarely).
double kn_relief_distance(const double point_m[3], const float (*now_m)[3], int triangles, const int (*triangle)[3]);

#endif

#ifndef KN_CLIENTS_IDENTIFY_RELIEF_POINTS_H
#define KN_CLIENTS_IDENTIFY_RELIEF_POINTS_H
// Return the distance of a point from a surface of triangles, m, > 0 outside. Seen from outside, the vertices of a
// triangle are counter-clockwise. The nearest triangle determines the sign. If several triangles are equally near, the
// one whose normal points most directly towards or away from the point determines the sign.
double kn_relief_distance(const double point_m[3], const float (*now_m)[3], int triangles, const int (*triangle)[3]);

#endif

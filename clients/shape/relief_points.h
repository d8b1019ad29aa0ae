#ifndef KN_CLIENTS_SHAPE_RELIEF_POINTS_H
#define KN_CLIENTS_SHAPE_RELIEF_POINTS_H
// Return the distance of a point from a surface of triangles [m]. The distance is > 0 if the point is outside the
// surface. Seen from outside, the vertices of a triangle are counter-clockwise. The triangle nearest to the point
// determines the sign. If several triangles are equally near, the sign comes from the triangle whose normal points most
// directly towards or away from the point.
double kn_relief_distance(const double point_m[3], const float (*now_m)[3], int triangles, const int (*triangle)[3]);

#endif

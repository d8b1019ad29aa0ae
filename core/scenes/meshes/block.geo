// The block of core/scenes/dough.yaml, 5 x 5 x 3 cm, in tetrahedra of 1 cm:
//     gmsh -3 -nt 1 -format msh41 block.geo -o block.msh          finer: -clscale 0.5
SetFactory("Built-in"); // mm
Point(1) = {-25, -25, 0, 10};
Point(2) = { 25, -25, 0, 10};
Point(3) = { 25,  25, 0, 10};
Point(4) = {-25,  25, 0, 10};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
out[] = Extrude {0, 0, 30} { Surface{1}; };
Physical Volume("dough") = {out[1]}; // without it the skin's triangles are saved too

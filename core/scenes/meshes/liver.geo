// A liver's shape, made from two ellipsoids, 19 x 12 x 7 cm: the right lobe, the left lobe, and a flat underside, in tetrahedra of
// 14 mm. It is nobody's liver: a shape of our own.
//     gmsh -3 -nt 1 -format msh41 liver.geo -o liver.msh
SetFactory("OpenCASCADE"); // mm
Sphere(1) = {0, 0, 0, 1};
Dilate {{0, 0, 0}, {70, 60, 45}} { Volume{1}; }
Sphere(2) = {0, 0, 0, 1};
Dilate {{0, 0, 0}, {75, 42, 27}} { Volume{2}; }
Rotate {{0, 0, 1}, {0, 0, 0}, -0.2} { Volume{2}; }
Translate {62, -8, 0} { Volume{2}; }
BooleanUnion(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
Box(4) = {-200, -200, -25, 400, 400, 200};
BooleanIntersection(5) = { Volume{3}; Delete; }{ Volume{4}; Delete; };
MeshSize {:} = 14;
Mesh.MeshSizeMax = 14;
Mesh.MeshSizeMin = 8;
Physical Volume("liver") = {5};

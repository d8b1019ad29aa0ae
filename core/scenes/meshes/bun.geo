// A bun: half a ball of 6 cm, flattened to a height of 2.4 cm, in tetrahedra of 8 mm:
//     gmsh -3 -nt 1 -format msh41 bun.geo -o bun.msh
SetFactory("OpenCASCADE"); // mm
Sphere(1) = {0, 0, 0, 30, 0, Pi/2};
Dilate {{0, 0, 0}, {1, 1, 0.8}} { Volume{1}; }
MeshSize {:} = 8;
Mesh.MeshSizeMax = 8;
Physical Volume("bun") = {1};

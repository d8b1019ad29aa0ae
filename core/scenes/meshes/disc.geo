// A disc of 5 cm that stands on a flat foot, in triangles of 4 mm; an object in two dimensions, y is its height:
//     gmsh -2 -nt 1 -format msh22 disc.geo -o disc.msh
SetFactory("OpenCASCADE"); // mm
Disk(1) = {0, 20, 0, 25};
Rectangle(2) = {-30, -10, 0, 60, 10}; // what is below the table
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
MeshSize {:} = 4;
Mesh.MeshSizeMax = 4;
Physical Surface("disc") = {3};

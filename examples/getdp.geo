// An iron core with a coil around its left leg and an air gap in the right one. Metres.
//
//   gmsh -2 -format msh22 -o getdp.msh getdp.geo
//
// Groups have numbers and no names, as in GetDP's tutorials; getdp.pro refers to them.

DefineConstant[ size = {6.5e-3, Name "size"} ];  // edge length, the same everywhere
SetFactory("OpenCASCADE");
mm = 1e-3;
Rectangle(1) = {-70*mm, -70*mm, 0, 140*mm, 140*mm};
Rectangle(2) = {-30*mm, -30*mm, 0, 60*mm, 60*mm};  // the core
Rectangle(3) = {-15*mm, -15*mm, 0, 30*mm, 30*mm};  // its window
Rectangle(4) = {15*mm, -4*mm, 0, 15*mm, 8*mm};     // the gap
Rectangle(5) = {-45*mm, -10*mm, 0, 15*mm, 20*mm};  // the coil, one side and the other
Rectangle(6) = {-15*mm, -10*mm, 0, 10*mm, 20*mm};
core() = BooleanDifference{ Surface{2}; Delete; }{ Surface{3, 4}; Delete; };
parts() = BooleanFragments{ Surface{1}; Delete; }{ Surface{core(), 5, 6}; Delete; };

coil_left() = Surface In BoundingBox{-45.1*mm, -10.1*mm, -mm, -29.9*mm, 10.1*mm, mm};
coil_right() = Surface In BoundingBox{-15.1*mm, -10.1*mm, -mm, -4.9*mm, 10.1*mm, mm};
iron() = Surface In BoundingBox{-30.1*mm, -30.1*mm, -mm, 30.1*mm, 30.1*mm, mm};
iron() -= {coil_left(), coil_right()};
air() = Surface{:};
air() -= {coil_left(), coil_right(), iron()};
rim() = CombinedBoundary{ Surface{:}; };

Physical Surface(100) = {iron()};
Physical Surface(101) = {air()};
Physical Surface(102) = {coil_left()};
Physical Surface(103) = {coil_right()};
Physical Curve(200) = {rim()};

Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;

// A plate with a bore and a pin of another metal: gmsh -3 examples/bracket.geo. Millimetres.
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 40, 20, 8};
Cylinder(2) = {10, 10, 0, 0, 0, 14, 5};
Cylinder(3) = {30, 10, -1, 0, 0, 10, 5};
BooleanDifference{ Volume{1}; Delete; }{ Volume{3}; Delete; }
BooleanFragments{ Volume{1, 2}; Delete; }{}

pin() = Volume In BoundingBox{4, 4, -1, 16, 16, 15};
plate() = Volume{:};
plate() -= {pin()};
bore() = Surface In BoundingBox{24, 4, -1, 36, 16, 9};
top() = Surface In BoundingBox{4, 4, 13, 16, 16, 15};
floor() = Surface In BoundingBox{-1, -1, -1, 41, 21, 1};
Physical Volume("pin", 1) = {pin()};
Physical Volume("plate", 2) = {plate()};
Physical Surface("bore", 3) = {bore()};
Physical Surface("top of the pin", 4) = {top()};
Physical Surface("floor", 5) = {floor()};
Mesh.MeshSizeMin = 2.5;
Mesh.MeshSizeMax = 2.5;
Mesh.MeshSizeFromCurvature = 16;

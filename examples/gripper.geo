// A quarter of a pot magnet over a plate of iron: gmsh -3 examples/gripper.geo. Millimetres, a gap of 1 mm.
SetFactory("OpenCASCADE");
gap = 1;
Cylinder(1) = {0, 0, 0, 0, 0, 6, 8, Pi/2};             // the magnet
Cylinder(2) = {0, 0, 0, 0, 0, 9, 14, Pi/2};            // the pot: an end of 3 mm, a wall of 3 mm
Cylinder(3) = {0, 0, 0, 0, 0, 6, 11, Pi/2};            // the room in it
Cylinder(4) = {0, 0, -gap - 4, 0, 0, 4, 18, Pi/2};     // the plate
Cylinder(5) = {0, 0, -45, 0, 0, 90, 45, Pi/2};         // air
BooleanDifference{ Volume{2}; Delete; }{ Volume{3}; Delete; }
BooleanFragments{ Volume{1, 2, 4, 5}; Delete; }{}

e = 0.01;
magnet() = Volume In BoundingBox{-e, -e, -e, 8 + e, 8 + e, 6 + e};
pot() = Volume In BoundingBox{-e, -e, -e, 14 + e, 14 + e, 9 + e};
pot() -= {magnet()};
plate() = Volume In BoundingBox{-e, -e, -gap - 4 - e, 18 + e, 18 + e, -gap + e};
air() = Volume{:};
air() -= {magnet(), pot(), plate()};
x0() = Surface In BoundingBox{-e, -e, -50, e, 50, 50};
y0() = Surface In BoundingBox{-e, -e, -50, 50, e, 50};
far() = CombinedBoundary{ Volume{:}; };
far() = Abs(far());
far() -= {x0(), y0()};
Physical Volume("magnet", 1) = {magnet()};
Physical Volume("pot", 2) = {pot()};
Physical Volume("plate", 3) = {plate()};
Physical Volume("air", 4) = {air()};
Physical Surface("across x", 5) = {x0()};
Physical Surface("across y", 6) = {y0()};
Physical Surface("far", 7) = {far()};
MeshSize{:} = 9;
MeshSize{ PointsOf{ Volume{magnet(), pot(), plate()}; } } = 2;
Mesh.MeshSizeExtendFromBoundary = 1;

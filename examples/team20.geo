// A quarter of TEAM problem 20, the static force on the pole of a magnet: gmsh -3 examples/team20.geo. Millimetres.
SetFactory("OpenCASCADE");
DefineConstant[ h = {4, Name "h"} ];                    // size of elements at the pole
Box(1) = {0, 0, 0, 63.5, 12.5, 25};                     // yoke: below the pole, the leg, above
Box(2) = {38.5, 0, 25, 25, 12.5, 100};
Box(3) = {13.5, 0, 125, 50, 12.5, 25};
Box(4) = {0, 0, 26.5, 12.5, 5, 98.5};                   // the pole, over a gap of 1.5 mm
Box(5) = {0, 0, 25, 18, 17, 100};                       // air in the bore of the coil
Sphere(6) = {0, 0, 75, 400};
Box(7) = {0, 0, -500, 500, 500, 1000};
BooleanUnion(8) = { Volume{1}; Delete; }{ Volume{2, 3}; Delete; };
BooleanIntersection(9) = { Volume{6}; Delete; }{ Volume{7}; Delete; };
BooleanFragments{ Volume{4, 5, 8, 9}; Delete; }{}

e = 0.01;
pole() = Volume In BoundingBox{-e, -e, 26.5 - e, 12.5 + e, 5 + e, 125 + e};
bore() = Volume In BoundingBox{-e, -e, 25 - e, 19 + e, 17 + e, 125 + e};
bore() -= {pole()};
yoke() = Volume In BoundingBox{-e, -e, -e, 63.5 + e, 12.5 + e, 150 + e};
yoke() -= {pole(), bore()};
air() = Volume{:};
air() -= {pole(), bore(), yoke()};
x0() = Surface In BoundingBox{-e, -e, -500, e, 500, 500};
y0() = Surface In BoundingBox{-e, -e, -500, 500, e, 500};
far() = CombinedBoundary{ Volume{:}; };
far() = Abs(far());
far() -= {x0(), y0()};
Physical Volume("yoke", 1) = {yoke()};
Physical Volume("pole", 2) = {pole()};
Physical Volume("bore", 3) = {bore()};
Physical Volume("air", 4) = {air()};
Physical Surface("across x", 5) = {x0()};
Physical Surface("across y", 6) = {y0()};
Physical Surface("far", 7) = {far()};
MeshSize{:} = 80;
MeshSize{ PointsOf{ Volume{yoke(), bore()}; } } = 2.5 * h;
MeshSize{ PointsOf{ Volume{pole()}; } } = h;
Mesh.MeshSizeExtendFromBoundary = 1;

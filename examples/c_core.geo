// A permanent magnet in an iron C-core with an air gap, inside an air box. Millimetres: read it with scale=1e-3.
//
//   gmsh -2 -format msh41 -setnumber size 5.6 -o c_core.msh c_core.geo
//   gmsh -2 -format msh41 -setnumber size 2.9 -o c_core_fine.msh c_core.geo
//
// Materials of examples/magnet.py: iron mu_r = 1000; magnet remanence 1.2 T along y, mu_r = 1.05.

DefineConstant[ size = {5.6, Name "size"} ];  // edge length, the same everywhere
box = 70;                                   // half the width of the air box
half = 30;                                  // half the width of the core
leg = 15;                                   // thickness of the core
inner = half - leg;
magnet = 10;                                // half the height of the magnet, in the left leg
gap = 4;                                    // half the height of the air gap, in the right leg

Point(1) = {-box, -box, 0};
Point(2) = {box, -box, 0};
Point(3) = {box, box, 0};
Point(4) = {-box, box, 0};

// Outside of the core, counter-clockwise from the upper edge of the gap, and back along the inside.
Point(5) = {half, gap, 0};
Point(6) = {half, half, 0};
Point(7) = {-half, half, 0};
Point(8) = {-half, magnet, 0};
Point(9) = {-half, -magnet, 0};
Point(10) = {-half, -half, 0};
Point(11) = {half, -half, 0};
Point(12) = {half, -gap, 0};
Point(13) = {inner, -gap, 0};
Point(14) = {inner, -inner, 0};
Point(15) = {-inner, -inner, 0};
Point(16) = {-inner, -magnet, 0};
Point(17) = {-inner, magnet, 0};
Point(18) = {-inner, inner, 0};
Point(19) = {inner, inner, 0};
Point(20) = {inner, gap, 0};

Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
For k In {5 : 19}
  Line(k) = {k, k + 1};
EndFor
Line(20) = {20, 5};
Line(21) = {17, 8};  // between magnet and iron
Line(22) = {9, 16};

Curve Loop(1) = {1 : 4};
Curve Loop(2) = {5 : 20};
Curve Loop(3) = {5, 6, 7, -21, 17, 18, 19, 20};
Curve Loop(4) = {8, 22, 16, 21};
Curve Loop(5) = {9, 10, 11, 12, 13, 14, 15, -22};
Plane Surface(1) = {1, 2};
Plane Surface(2) = {3};
Plane Surface(3) = {4};
Plane Surface(4) = {5};

Physical Surface("iron", 1) = {2, 4};
Physical Surface("magnet", 2) = {3};
Physical Surface("air", 3) = {1};
Physical Curve("outer", 4) = {1 : 4};

Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;

// A plunger actuator around the axis x = 0 (x is the distance r from it, y the height z): a plunger in a core with a
// coil, all edges rounded, in a ball of air. Millimetres: read it with scale=1e-3.
//
//   for gap in 1 2 3 4 5; do gmsh -2 -format msh41 -setnumber gap $gap -o actuator_$gap.msh actuator.geo; done
//
// Materials of examples/actuator.py: core and plunger of iron that saturates, a coil with ampere-turns. The potential
// A_phi is zero on "outer"; on "axis" it is zero of itself.

DefineConstant[ size = {1, Name "size"} ];  // 1 as drawn, 0.7 for about twice as many nodes
DefineConstant[ gap = {4, Name "gap"} ];    // between plunger and pole

box = 60;               // radius of the air around
steps = 6;              // facets of a quarter of a circle
pole = -4;              // height of the pole's face
foot = pole + gap;      // of the plunger

h_far = 7 * size;
h_core = 2 * size;
h_gap = 0.9 * size;

// A chain of lines along the axes, from corner to corner in the lists x and y, each corner rounded by the radius in
// the list radius; 0 leaves it sharp. Makes the curves `chain`, which begin at the point `first` and end at `last`.
Macro RoundedChain
  chain[] = {};
  n = #x[];
  For k In {0 : n - 1}
    If (radius[k] == 0)
      start = newp;
      Point(start) = {x[k], y[k], 0, h};
      stop = start;
    Else
      before = (k + n - 1) % n;
      after = (k + 1) % n;
      in_x = (x[k] > x[before]) - (x[k] < x[before]);  // direction of the line that comes in, and of the next
      in_y = (y[k] > y[before]) - (y[k] < y[before]);
      out_x = (x[after] > x[k]) - (x[after] < x[k]);
      out_y = (y[after] > y[k]) - (y[after] < y[k]);
      start = newp;
      Point(start) = {x[k] - radius[k] * in_x, y[k] - radius[k] * in_y, 0, h};
      centre = newp;
      Point(centre) = {x[k] + radius[k] * (out_x - in_x), y[k] + radius[k] * (out_y - in_y), 0, h};
      stop = newp;
      Point(stop) = {x[k] + radius[k] * out_x, y[k] + radius[k] * out_y, 0, h};
    EndIf
    If (k == 0)
      first = start;
    Else
      side = newl;
      Line(side) = {last, start};
      chain[] += side;
    EndIf
    If (radius[k] > 0)
      corner = newl;
      Circle(corner) = {start, centre, stop};
      Transfinite Curve {corner} = steps + 1;
      chain[] += corner;
    EndIf
    last = stop;
  EndFor
Return

h = h_core;
x[] = {0, 25, 25, 8.5, 8.5, 20, 20, 8, 8, 0};  // core: outside, the hole of the plunger, inside, the pole below it
y[] = {-20, -20, 20, 20, 14, 14, -14, -14, pole, pole};
radius[] = {0, 2.5, 2.5, 1, 1, 2, 2, 2, 1.5, 0};
Call RoundedChain;
core[] = chain[];
core_first = first;
core_last = last;

x[] = {0, 8, 8, 0};  // plunger
y[] = {foot, foot, foot + 30, foot + 30};
radius[] = {0, 1.5, 1.5, 0};
Call RoundedChain;
plunger[] = chain[];
plunger_first = first;
plunger_last = last;

x[] = {10, 18.5, 18.5, 10};  // coil
y[] = {-12, -12, 12, 12};
radius[] = {1.5, 1.5, 1.5, 1.5};
Call RoundedChain;
coil[] = chain[];
closing = newl;
Line(closing) = {last, first};
coil[] += closing;

middle = newp;
Point(middle) = {0, 5, 0};
south = newp;
Point(south) = {0, 5 - box, 0, h_far};
east = newp;
Point(east) = {box, 5, 0, h_far};
north = newp;
Point(north) = {0, 5 + box, 0, h_far};
far_0 = newl;
Circle(far_0) = {south, middle, east};
far_1 = newl;
Circle(far_1) = {east, middle, north};

below = newl;
Line(below) = {south, core_first};
in_core = newl;
Line(in_core) = {core_first, core_last};
working_gap = newl;
Line(working_gap) = {core_last, plunger_first};
in_plunger = newl;
Line(in_plunger) = {plunger_first, plunger_last};
above = newl;
Line(above) = {plunger_last, north};

l = newll;
Curve Loop(l) = {core[], -in_core};
core_surface = news;
Plane Surface(core_surface) = {l};
l = newll;
Curve Loop(l) = {plunger[], -in_plunger};
plunger_surface = news;
Plane Surface(plunger_surface) = {l};
turns = newll;
Curve Loop(turns) = {coil[]};
coil_surface = news;
Plane Surface(coil_surface) = {turns};
l = newll;
Curve Loop(l) = {below, core[], working_gap, plunger[], above, -far_1, -far_0};
air_surface = news;
Plane Surface(air_surface) = {l, turns};

Physical Surface("core", 1) = {core_surface};
Physical Surface("plunger", 2) = {plunger_surface};
Physical Surface("coil", 3) = {coil_surface};
Physical Surface("air", 4) = {air_surface};
Physical Curve("outer", 5) = {far_0, far_1};
Physical Curve("axis", 6) = {below, in_core, working_gap, in_plunger, above};

// Finer where the plunger meets the core: in the narrow gap beside it and in the working gap below.
Field[1] = Box;
Field[1].XMin = 7;
Field[1].XMax = 9;
Field[1].YMin = 12;
Field[1].YMax = 22;
Field[1].VIn = 0.5 * size;
Field[1].VOut = h_far;
Field[1].Thickness = 12;
Field[2] = Box;
Field[2].XMin = 0;
Field[2].XMax = 9;
Field[2].YMin = pole - 1;
Field[2].YMax = foot + 1;
Field[2].VIn = h_gap;
Field[2].VOut = h_far;
Field[2].Thickness = 12;
Field[3] = Min;
Field[3].FieldsList = {1, 2};
Background Field = 3;

// One pole, a sector of 45 degrees, of a permanent-magnet machine: 8 poles, 24 slots, a winding of one slot per pole
// and phase. Millimetres: read it with scale=1e-3. The pole's axis is the y-axis.
//
//   gmsh -2 -format msh41 -o motor.msh motor.geo
//
// Materials of examples/motor.py: iron mu_r = 1000; magnet remanence 1.2 T along y, mu_r = 1.05; the neighbouring pole
// is the same with the opposite sign, so that the potential on "left" is minus the one on "right".
//
// "ring" lies in the middle of the gap, in steps of the same length, and the rotor turns on it by whole steps
// (-setnumber step 6: by 3.75 degrees; turn the magnet's remanence too). Where it then sticks out of the sector on the
// left, the ring belongs to "left", and where it has left the stator alone on the right to "right".

DefineConstant[ size = {1, Name "size"} ];  // 1 as drawn, 0.7 for about twice as many nodes
DefineConstant[ step = {0, Name "step"} ];  // of the rotor, counter-clockwise: 0 to ring_steps - 1

pole = Pi / 4;          // angle of the sector
pitch = pole / 3;       // of a slot
r_shaft = 15;
r_core = 40;            // of the rotor's iron, below the magnet
r_rotor = 44;
r_ring = 44.5;
r_bore = 45;
r_outer = 80;
ring_steps = 72;
rotor = step * pole / ring_steps;  // angle of the magnet's axis from the y-axis

half_magnet = 17 * Pi / 180;
r_end = 3;              // of the magnet's round ends
r_hole = 4;             // of the hole in the rotor
at_hole = 26;

half_opening = 1.25;    // of a slot
tip = 46;               // where the opening ends
wedge = 47.5;           // where the coil begins
half_tooth = 3;         // the walls of the teeth are parallel
at_bottom = 61;         // centre of the slot's round bottom, which the walls touch

h_gap = 0.5 * size;
h_magnet = 0.9 * size;
h_slot = 0.85 * size;
h_yoke = 1.2 * size;
h_shaft = 1.15 * size;

origin = newp;
Point(origin) = {0, 0, 0};

Macro PolarPoint  // point at radius r, angle t from the y-axis, counter-clockwise
  made = newp;
  Point(made) = {-r * Sin(t), r * Cos(t), 0, h};
Return

Macro LocalPoint  // point u along the ray at angle t, v to the left of it
  made = newp;
  Point(made) = {-u * Sin(t) - v * Cos(t), u * Cos(t) - v * Sin(t), 0, h};
Return

// The ring, from right to left, an arc for every facet, so that its nodes are at their angles to rounding: what only
// the stator has, what both have, what only the rotor has.
stator_only[] = {};
both[] = {};
rotor_only[] = {};
For k In {0 : ring_steps + step}
  t = (k / ring_steps - 0.5) * pole;
  r = r_ring;
  h = h_gap;
  Call PolarPoint;
  on_ring[k] = made;
  If (k > 0)
    l = newl;
    Circle(l) = {on_ring[k - 1], origin, on_ring[k]};
    Transfinite Curve {l} = 2;
    If (k <= step)
      stator_only[] += l;
    EndIf
    If (k > step && k <= ring_steps)
      both[] += l;
    EndIf
    If (k > ring_steps)
      rotor_only[] += l;
    EndIf
  EndIf
EndFor

// The two sides: side 0 is "right", side 1 is "left". The rotor's part ends at the ring, the stator's begins there.
rotor_radii[] = {r_shaft, r_core, r_rotor};
rotor_sizes[] = {h_shaft, h_magnet, h_gap};
stator_radii[] = {r_bore, r_outer};
stator_sizes[] = {h_gap, h_yoke};
For side In {0 : 1}
  t = (side - 0.5) * pole + rotor;
  For k In {0 : 2}
    r = rotor_radii[k];
    h = rotor_sizes[k];
    Call PolarPoint;
    p~{side}~{k} = made;
  EndFor
  t = (side - 0.5) * pole;
  For k In {0 : 1}
    r = stator_radii[k];
    h = stator_sizes[k];
    Call PolarPoint;
    p~{side}~{k + 3} = made;
  EndFor
  For k In {0 : 1}
    radial~{side}~{k} = newl;
    Line(radial~{side}~{k}) = {p~{side}~{k}, p~{side}~{k + 1}};
  EndFor
  radial~{side}~{2} = newl;
  Line(radial~{side}~{2}) = {p~{side}~{2}, on_ring[side * ring_steps + step]};
  radial~{side}~{3} = newl;
  Line(radial~{side}~{3}) = {on_ring[side * ring_steps], p~{side}~{3}};
  radial~{side}~{4} = newl;
  Line(radial~{side}~{4}) = {p~{side}~{3}, p~{side}~{4}};
EndFor

// Rotor, from right to left: shaft, core with the foot of the magnet, surface with its top.
shaft = newl;
Circle(shaft) = {p_0_0, origin, p_1_0};
For side In {0 : 1}
  t = rotor + (2 * side - 1) * half_magnet;
  r = r_core;
  h = h_gap;
  Call PolarPoint;
  foot~{side} = made;
  r = r_rotor;
  Call PolarPoint;
  top~{side} = made;
  // The end's circle goes through foot and top; its centre lies inside the magnet.
  u = (r_core + r_rotor) / 2;
  v = (1 - 2 * side) * Sqrt(r_end^2 - ((r_rotor - r_core) / 2)^2);
  Call LocalPoint;
  end~{side} = newl;
  Circle(end~{side}) = {foot~{side}, made, top~{side}};
EndFor
core_0 = newl;
Circle(core_0) = {p_0_1, origin, foot_0};
core_m = newl;
Circle(core_m) = {foot_0, origin, foot_1};
core_1 = newl;
Circle(core_1) = {foot_1, origin, p_1_1};
surface_0 = newl;
Circle(surface_0) = {p_0_2, origin, top_0};
surface_m = newl;
Circle(surface_m) = {top_0, origin, top_1};
surface_1 = newl;
Circle(surface_1) = {top_1, origin, p_1_2};

t = rotor;
r = at_hole;
h = h_shaft;
Call PolarPoint;
centre = made;
For k In {0 : 3}
  u = at_hole + r_hole * Cos(k * Pi / 2);
  v = r_hole * Sin(k * Pi / 2);
  Call LocalPoint;
  around~{k} = made;
EndFor
hole[] = {};
For k In {0 : 3}
  l = newl;
  Circle(l) = {around~{k}, centre, around~{(k + 1) % 4}};
  hole[] += l;
EndFor

// Slots, from right to left. The walls are at the angle `slope` to the slot's axis.
slope = pitch / 2;
r_bottom = at_bottom * Sin(slope) - half_tooth;
half_wedge = wedge * Tan(slope) - half_tooth / Cos(slope);
last = p_0_3;       // where the bore has come to
bore[] = {};        // its arcs, the mouths of the slots included
inside[] = {};      // the inner outline of the stator, around the slots
For slot In {0 : 2}
  t = (slot - 1) * pitch;
  For side In {0 : 1}
    sign = 2 * side - 1;
    h = h_gap;
    u = Sqrt(r_bore^2 - half_opening^2);
    v = sign * half_opening;
    Call LocalPoint;
    a~{side} = made;
    u = tip;
    Call LocalPoint;
    b~{side} = made;
    h = h_slot;
    u = wedge;
    v = sign * half_wedge;
    Call LocalPoint;
    c~{side} = made;
    u = at_bottom - r_bottom * Sin(slope);
    v = sign * r_bottom * Cos(slope);
    Call LocalPoint;
    d~{side} = made;
  EndFor
  u = at_bottom;
  v = 0;
  Call LocalPoint;
  middle = made;
  u = at_bottom + r_bottom;
  Call LocalPoint;
  deepest = made;

  tooth = newl;
  Circle(tooth) = {last, origin, a_0};
  mouth = newl;
  Circle(mouth) = {a_0, origin, a_1};
  last = a_1;
  For side In {0 : 1}
    opening~{side} = newl;
    Line(opening~{side}) = {a~{side}, b~{side}};
    shoulder~{side} = newl;
    Line(shoulder~{side}) = {b~{side}, c~{side}};
    wall~{side} = newl;
    Line(wall~{side}) = {c~{side}, d~{side}};
    bottom~{side} = newl;
    Circle(bottom~{side}) = {d~{side}, middle, deepest};
  EndFor
  cover = newl;
  Line(cover) = {c_0, c_1};
  bore[] += {tooth, mouth};
  inside[] += {tooth, opening_0, shoulder_0, wall_0, bottom_0, -bottom_1, -wall_1, -shoulder_1, -opening_1};
  l = newll;
  Curve Loop(l) = {mouth, opening_1, shoulder_1, -cover, -shoulder_0, -opening_0};
  slot_air~{slot} = news;
  Plane Surface(slot_air~{slot}) = {l};
  l = newll;
  Curve Loop(l) = {cover, wall_1, bottom_1, -bottom_0, -wall_0};
  coil~{slot} = news;
  Plane Surface(coil~{slot}) = {l};
EndFor
tooth = newl;
Circle(tooth) = {last, origin, p_1_3};
bore[] += tooth;
inside[] += tooth;
outer = newl;
Circle(outer) = {p_0_4, origin, p_1_4};

l = newll;
Curve Loop(l) = {radial_0_4, outer, -radial_1_4, -inside[]};
stator = news;
Plane Surface(stator) = {l};
l = newll;
Curve Loop(l) = {radial_0_3, bore[], -radial_1_3, -both[], -stator_only[]};
gap_outside = news;
Plane Surface(gap_outside) = {l};
l = newll;
Curve Loop(l) = {radial_0_2, both[], rotor_only[], -radial_1_2, -surface_1, -surface_m, -surface_0};
gap_inside = news;
Plane Surface(gap_inside) = {l};
l = newll;
Curve Loop(l) = {core_m, end_1, -surface_m, -end_0};
magnet = news;
Plane Surface(magnet) = {l};
l = newll;
Curve Loop(l) = {core_0, end_0, -surface_0, -radial_0_1};
beside_0 = news;
Plane Surface(beside_0) = {l};
l = newll;
Curve Loop(l) = {core_1, radial_1_1, -surface_1, -end_1};
beside_1 = news;
Plane Surface(beside_1) = {l};
round = newll;
Curve Loop(round) = {hole[]};
drilled = news;
Plane Surface(drilled) = {round};
l = newll;
Curve Loop(l) = {radial_0_0, core_0, core_m, core_1, -radial_1_0, -shaft};
iron = news;
Plane Surface(iron) = {l, round};

Physical Surface("stator", 1) = {stator};
Physical Surface("rotor", 2) = {iron};
Physical Surface("magnet", 3) = {magnet};
Physical Surface("coil_a_plus", 4) = {coil_1};   // on the pole's axis
Physical Surface("coil_b_minus", 5) = {coil_2};
Physical Surface("coil_c_minus", 6) = {coil_0};
Physical Surface("slot_air", 7) = {slot_air_0, slot_air_1, slot_air_2};
Physical Surface("gap", 8) = {gap_inside, gap_outside};
Physical Surface("rotor_air", 9) = {beside_0, beside_1, drilled};
Physical Curve("outer", 10) = {outer};
Physical Curve("inner", 11) = {shaft};
Physical Curve("right", 12) = {radial_0_0, radial_0_1, radial_0_2, radial_0_3, radial_0_4, stator_only[]};
Physical Curve("left", 13) = {radial_1_0, radial_1_1, radial_1_2, radial_1_3, radial_1_4, rotor_only[]};
Physical Curve("ring", 14) = {stator_only[], both[]};

For k In {0 : 4}
  Periodic Curve {radial~{1}~{k}} = {radial~{0}~{k}} Rotate {{0, 0, 1}, {0, 0, 0}, pole};
EndFor

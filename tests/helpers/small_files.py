"""Small files as other programs write them, for readers."""

import numpy as np
from skfem import MeshTri

ABAQUS = """*HEADING
*NODE
1, 0.0, 0.0
2, 1.0, 0.0
3, 1.0, 1.0
4, 0.0, 1.0
*ELEMENT, TYPE=T2D2
1, 1, 2
*ELEMENT, TYPE=CPS3, ELSET=all of it
2, 1, 2, 3
*ELEMENT, TYPE=CPS3, ELSET=all of it
3, 1, 3, 4
*ELSET, ELSET=some, GENERATE
1, 3, 2
*ELEMENT OUTPUT, ELSET=some
S
"""
SU2 = """NDIME= 2
NELEM= 2
5 0 1 2 0
5 0 2 3 1
NPOIN= 4
0.0 0.0 0
1.0 0.0 1
1.0 1.0 2
0.0 1.0 3
NMARK= 3
MARKER_TAG= wall
MARKER_ELEMS= 1
3 0 1
MARKER_TAG= 1
MARKER_ELEMS= 1
3 1 2
MARKER_TAG= far field
MARKER_ELEMS= 2
3 2 3
3 3 0
"""
GMSH = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
1
2 1 "all"
$EndPhysicalNames
$Entities
0 0 1 0
1 0 0 0 1 1 0 1 1 0
$EndEntities
$Nodes
1 3 1 3
2 1 0 3
1
2
3
0 0 0
1 0 0
0 1 0
$EndNodes
$Elements
1 1 1 1
2 1 2 1
1 1 2 3
$EndElements
"""
# A unit square of four triangles around its centre, node 5, of which two are iron.
NODES = "*NODE\n1, 0., 0.\n2, 1., 0.\n3, 1., 1.\n4, 0., 1.\n5, .5, .5\n"
ELEMENTS = """*ELEMENT, TYPE=CPS3, ELSET=iron
11, 1, 2, 5
12, 2, 3, 5
*Element, type=cpe3, elset=air
21, 3, 4, 5
22, 4, 1, 5
"""
SQUARE = f"*HEADING\nno *NODE here\n{NODES}{ELEMENTS}"
MFEM = """MFEM mesh v1.0
# a comment
dimension
2

elements
2
1 2 0 1 2
4 2 0 2 3

boundary
2
7 1 0 1
8 1 1 2

vertices
4
2
0 0
1 0
1 1
0 1
"""
MEDIT = """MeshVersionFormatted {}
Dimension 2
Vertices 4
0 0 1
1 0 1
1 1 1
0 1 1
Triangles 2
1 2 3 1
1 3 4 4
Edges 2
1 2 7
2 3 8
End
"""
FREEFEM = "4 2 2\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n1 2 3 1\n1 3 4 4\n1 2 7\n2 3 8\n"
UCD = """# a comment
4 4 0 0 0
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
1 1 tri 1 2 3
2 4 tri 1 3 4
3 7 line 1 2
4 8 line 2 3
"""
VTK = """# vtk DataFile Version 2.0
by FreeFEM
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 4 float
0 0 0 1 0 0 1 1 0 0 1 0
CELLS 4 14
3 0 1 2 3 0 2 3 2 0 1 2 1 2
CELL_TYPES 4
5 5 3 3
CELL_DATA 4
Scalars  Label int1
LOOKUP_TABLE FreeFempp_table
1 4 7 8
"""
BY_HAND = {
    "mfem.mesh": MFEM,
    "one_line.mesh": MEDIT.format(2),
    "apart.mesh": MEDIT.format("\n2"),
    "version_3.mesh": MEDIT.format(3),
    "freefem.msh": FREEFEM,
    "ucd.inp": UCD,
    "freefem.vtk": VTK,
}
# As ElmerGrid lays it out, from a second-order mesh with points; numbers have gaps and the nodes no order.
GRID = {
    "mesh.header": "7 1 4\n3\n306 1\n203 3\n101 1\n",
    "mesh.nodes": "9 -1 0 0 0 \n1 -1 0 1 0 \n2 -1 1 0 0 \n4 -1 .5 0 0 \n5 -1 .5 .5 0 \n6 -1 0 .5 0 \n8 -1 7 7 0 \n",
    "mesh.elements": "1 3 306 9 2 1 4 5 6 \n",
    "mesh.boundary": "1 2 1 0 203 9 2 4 \n2 2 1 0 203 2 1 5 \n3 5 1 0 203 1 9 6 \n4 6 0 0 101 9 \n",
    "mesh.names": "! ----- names for bodies -----\n$ core = 3\n! ----- names for boundaries -----\n$ far away = 2\n",
}
BLOCK = """  <BeginBlock>
    <BlockName> = "{}"
    <Mu_x> = {}
    <Mu_y> = {}
    <H_c> = 0
    <H_cAngle> = 0
    <J_re> = 0
    <LamType> = 0
    <LamFill> = 1
    <BHPoints> = {}
{}  <EndBlock>
"""
HEAD = """[Format]      =  4.0
[Frequency]   =  0
[Depth]       =  2
[LengthUnits] =  {unit}
[ProblemType] =  planar
[PointProps]   = 0
[BdryProps]   = 2
  <BeginBdry>
    <BdryName> = "rim"
    <BdryType> = 0
    <A_0> = 0.5
    <A_1> = 0
    <A_2> = 0
  <EndBdry>
  <BeginBdry>
    <BdryName> = "the diameter"
    <BdryType> = 0
    <A_0> = 0
    <A_1> = 0
    <A_2> = 0
  <EndBdry>
[BlockProps]  = 2
{air}{steel}[CircuitProps]  = 1
  <BeginCircuit>
    <CircuitName> = "coil"
    <TotalAmps_re> = 2.5
    <TotalAmps_im> = 0
    <CircuitType> = 1
  <EndCircuit>
[NumPoints] = 2
-1	0	0	0
1	0	0	0
[NumSegments] = 1
0	1	-1	2	0	0
[NumArcSegments] = 2
1	0	180	5	1	0	0
0	1	180	5	1	0	0
[NumHoles] = 0
[NumBlockLabels] = 3
0	0.5	1	-1	1	0	0	100	0
0	-0.7	1	-1	0	0	0	1	0
0	-0.2	2	-1	0	0	0	1	0
"""


def disc(unit="inches"):
    """A disc of two halves, of which the lower is steel near the middle; arcs and a segment, in the format of 2013."""
    mesh = MeshTri.init_circle(4)
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    label = np.where(y > 0.0, 0, np.where(np.hypot(x, y) > 0.5, 1, 2))
    air, steel = (
        BLOCK.format("air", 1, 1, 0, ""),
        BLOCK.format("steel", 1, 1, 4, "0\t0\n1\t300\n2\t5000\n2.2\t160000\n"),
    )
    nodes = "".join(f"{x!r}\t{y!r}\t0\n" for x, y in mesh.p.T.tolist())
    elements = "".join("\t".join(map(str, row)) + "\n" for row in np.column_stack([mesh.t.T, label]).tolist())
    text = HEAD.format(unit=unit, air=air, steel=steel)
    return mesh, label, f"{text}[Solution]\n{len(mesh.p.T)}\n{nodes}{len(label)}\n{elements}1\n1\t0\n"


def written(folder, files):
    folder.mkdir(exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder

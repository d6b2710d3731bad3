"""Words of Gmsh's language that a drawing may use without being trusted."""

__all__ = ["CALLS", "CONNECTORS", "FIELDS", "FILE_WORDS", "MESSAGES", "REFUSED", "WORDS", "may_set_option"]


def words(text: str) -> frozenset[str]:
    return frozenset(text.split())


SHAPES = """
    BSpline Bezier Block Box CatmullRom Circle Compound Cone Curve Cylinder Disk Ellipse Ellipsis Ellipsoid Elliptic
    Euclidian Line Loop Nurbs Parametric Physical Plane Point PolarSphere Quadric Rectangle Ruled Sphere Spline Surface
    Torus Volume Wedge Wire
"""
CHANGES = """
    Affine BooleanCoherence BooleanCommon BooleanCut BooleanDifference BooleanFragments BooleanFuse BooleanIntersection
    BooleanSection BooleanUnion Boundary Chamfer Coherence CombinedBoundary Delete Dilate Duplicata Extrude Fillet
    HealShapes Intersect PointsOf Recursive Rotate Sewing Split Symmetry ThickSolid ThruSections Translate
    Unsplit Ellipses Model Models Physicals Embedded Options Variables Meshes Empty Views All
"""
MESHING = """
    AdaptMesh Algorithm Alternate AlternateLeft AlternateRight Background Beta Beta_HWall Beta_Symmetrical
    Beta_Symmetrical_HWall BoundaryLayer Bump Bump_HWall Characteristic ClassifySurfaces Cohomology Color ColorTable
    CreateGeometry CreateTopology Degenerated Field FromBoundary GeoEntity Hide Hole Homology Index Layers Left Length
    Mesh MeshAlgorithm MeshSize MeshSizeFromBoundary NewModel OptimizeMesh Order PartitionMesh Periodic Power
    Progression Progression_HWall QuadTriAddVerts QuadTriNoNewVerts RecombLaterals Recombine RecombineMesh RefineMesh
    RelocateMesh
    RenumberMeshElements RenumberMeshNodes ReorientMesh Reverse ReverseMesh Right Scale ScaleLastLayer
    SetOrder Show Size Smoother SyncModel TransfQuadTri TextAttributes TransformMesh Transfinite Using View T2 T3 TIME
    INTERPOLATION_SCHEME
"""
LANGUAGE = """
    Abort Append Call DefineConstant DefineNumber DefineString Else ElseIf EndFor EndIf Exists Exit For Function
    GetForced GetNumber GetValue If In List Macro Return SetFactory SetMaxTag SetNumber SetTag UndefineConstant Unique
"""
FUNCTIONS = """
    Abs Acos ArcCos ArcSin ArcTan ArcTan2 Asin Atan Atan2 BoundingBox Ceil CenterOfMass Closest Coordinates Cos Cosh
    Exp Fabs Find Floor Fmod GMSH_MAJOR_VERSION GMSH_MINOR_VERSION GMSH_PATCH_VERSION Hypot Knots LinSpace Log Log10
    LogSpace LowerCase LowerCaseIn Mass MatrixOfInertia Max Min Modulo N2S NameToString Normal Parent Pi Rand Round Sin
    Sinh Sprintf Sqrt Step Str StrCat StrChoice StrCmp StrFind StrLen StrPrefix StrRelative StrReplace StrSub Tan Tanh
    Today UpperCase newc newcl newf newl newll newp newreg news newsl newv
"""
ATTRIBUTES = """
    AutoCheck Choices Closed Enum Graph Help Highlight Kind Label Loop Max Min MultipleSelection Name NeverChanged
    NumberFormat Range ReadOnly ReadOnlyRange ShortHelp Step Units Visible
"""

# They write to the terminal, or with `> NAME` to a file.
MESSAGES = frozenset({"Printf", "Error", "Warning"})

FILE_WORDS = frozenset({"Include", "Merge", "MergeWithBoundingBox", "ShapeFromFile", "ListFromFile"})

# Words with a meaning to Gmsh that neither run programs nor write files.
WORDS = words(f"{SHAPES} {CHANGES} {MESHING} {LANGUAGE} {FUNCTIONS} {ATTRIBUTES}") | MESSAGES | FILE_WORDS

# Elements of a view, such as SP(x, y, z){value}.
CALLS = frozenset(f"{values}{element}{order}" for values in "SVT" for element in "PLTQSHIY" for order in ("", "2"))

# Words after a variable, as in `Transfinite Curve {1} = n Using Bump 0.2`.
CONNECTORS = words(
    """
    Affine Alternate AlternateLeft AlternateRight In Knots Left Order Plane Right Rotate Translate Using
    """
)

# Types of fields without ExternalProcess, which runs a program, and Structured and AutomaticMeshSizeField, which open
# files.
FIELDS = words(
    """
    Attractor AttractorAnisoCurve Ball BoundaryLayer Box Constant Curvature Cylinder Distance Extend Frustum
    Gradient IntersectAniso Laplacian LonLat MathEval MathEvalAniso Max MaxEigenHessian Mean Min MinAniso
    Octree Param PostView Restrict Sphere Threshold
    """
)

# Words with another meaning to Gmsh, which are no names of variables either.
REFUSED = words(
    """
    AbsolutePath Alias AliasWithOptions Betti Catenary CodeName Combine CopyOptions Cpu CreateDir CreateOverlaps
    CurrentDir CurrentDirectory CurrentFileName DimNameSpace DirName Draw FileExists FixRelativePath GetEnv GetForcedStr
    GetString GetStringValue GmshExecutableName Levelset MPI_Rank MPI_Size Memory NameStruct
    NonBlockingSystemCall OnelabAction OnelabRun Open Parse ParseString ParsedString Plugin Print Remesh S2N Save
    SendToServer SetChanged SetCurrentWindow SetName SetPartition SetString Sleep Slide SplitCurrentWindowHorizontal
    SplitCurrentWindowVertical StringToName Struct System SystemCall TestLevel TotalMemory UnsplitWindow
    """
)

OPTIONS = ("Geometry", "Mesh", "View", "PostProcessing", "Print")
GENERAL = """
    Antialiasing Axes BackgroundGradient Camera Clip Color ExpertMode GraphicsHeight GraphicsWidth Light NumThreads
    Orthographic Rotation Scale SmallAxes Terminal Trackball Translation Verbosity
"""
SOLVER = ("AutoCheck", "AutoMesh", "AutoShowLastStep", "AutoShowViews")


def may_set_option(category: str, option: str) -> bool:
    # Other options of General and Solver name programs to run, files to write or folders.
    if category == "General":
        return option.startswith(tuple(GENERAL.split()))
    return category in OPTIONS or (category == "Solver" and option in SOLVER)

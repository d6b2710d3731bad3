"""Drawings as programs: what they may do without being trusted, and that nothing else happens."""

import re

import pytest
from helpers.cases import run_command
from helpers.examples import examples
from helpers.hostile_files import spoilt
from helpers.mesh_files import drawn_by_gmsh, needs_gmsh
from helpers.places import EXAMPLES
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from kohonen_adapt.cases import case_of, fitting_mesh
from kohonen_adapt.cases.drawing_script import Script

SQUARE = """SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 1, 1};
Physical Surface("air") = {1};
Physical Curve("outer") = {1:4};
"""
CASE = {"materials": {"air": {}}, "potential": {"outer": 0.0}}
TEXT = 'mesh = {drawing = "plate.geo"}\n[materials.air]\n[potential]\nouter = 0.0\n'
TOUCH = 'SystemCall "touch sign";\n'

COMMANDS = [
    TOUCH,
    "SystemCall\t'touch sign' ;",
    'NonBlockingSystemCall "touch sign";',
    'System "touch sign";',
    'System/* */Call = 1; System /* */ "touch sign";',
    's = "touch sign"; SystemCall s;',
    'SystemCall = 1; SystemCall "touch sign";',
    'SystemCall Sprintf("touch %s", "sign");',
    'SystemCall StrCat("touch ",\n"sign");',
    'S2N["SystemCall"] "touch sign";',
    'StringToName[Str("System")] "touch sign";',
    'If (0)\nOnelabRun = 1;\nEndIf\nOnelabRun("x", "touch sign");',
    'OnelabRun "touch sign";',
    'Printf("x") > "sign";',
    'Printf("%g", (1)) >> "sign";',
    'Save "sign";',
    'Print "sign";',
    'Save View[0] "sign";',
    'CreateDir "sign";',
    "Plugin(MathEval).Run;",
    'Field[1] = ExternalProcess; Field[1].CommandLine = "touch sign"; Background Field = 1;',
    "Field [ 1 ]\n=\nExternalProcess;",
    "Field[1] =",
    'General.OptionsFileName = "sign"; General.SaveOptions = 1;',
    'Solver.Executable0 = "touch"; Solver.AutoLoadDatabase = 1;',
    'General . TextEditor = "touch sign";',
    'DefineConstant[ a = {1, GmshOption "General.TextEditor"} ];',
    "Sleep 1e9;",
    'unheard_of "touch sign";',
    'unheard_of("touch sign");',
    'unheard_of {"touch sign"};',
]
TRICKS = {
    "loop after a comment": f"For k In {{0:1}} /* a\n{TOUCH}*/\nx = 1;\nEndFor\n",
    "macro after a comment": f"Macro M /* a\n{TOUCH}*/ x = 1;\nReturn\nCall M;\n",
    "loop in a long line": "For k In {0:1} x = 1; //" + " " * 8168 + TOUCH + "EndFor\n",
    "string in a skipped test": 'If (0)\nIf("x\n");\ns = " EndIf EndIf SystemCall \'touch sign\'; ";\nEndIf\nEndIf\n',
    "quotation mark in a skipped branch": 'If (0)\nE" ";\ns = " EndIf SystemCall \'touch sign\'; ";\nEndIf\n',
    "end of a branch in a name": f"If (0)\nEndIf5{TOUCH}EndIf\n",
    "string that is too long": f"s = \"{'a' * 1023}; SystemCall 'touch sign'; \";\n",
    "end of a file in a skipped branch": "If (0)\n\"SystemCall 'touch sign'; \";",
    "open comment": f"/* a\n{TOUCH}",
    "byte zero": f"// a\0{TOUCH}",
}


def drawn(folder, text, **keys):
    (folder / "plate.geo").write_text(SQUARE + text, encoding="latin-1")
    return fitting_mesh(case_of({"mesh": {"drawing": "plate.geo"}, **CASE, **keys}, folder))


def refusal(folder, text):
    with pytest.raises(ValueError) as refused:
        drawn(folder, text)
    assert "\n" not in str(refused.value) and not list(folder.rglob("sign"))
    return str(refused.value)


@needs_gmsh
@pytest.mark.parametrize("command", COMMANDS)
def test_what_may_run_programs_or_write_files_is_refused_with_its_line(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    said = refusal(tmp_path, command)
    assert said.endswith("write trusted = true in the case.")
    assert any(f"'plate.geo', line {line}: " in said for line in range(5, 9))


@needs_gmsh
@pytest.mark.parametrize("trick", TRICKS)
def test_text_that_gmsh_takes_for_commands_does_nothing(tmp_path, monkeypatch, trick):
    """Refused, or drawn without the comments, lines and quotation marks that made it a command."""
    monkeypatch.chdir(tmp_path)
    try:
        drawn(tmp_path, TRICKS[trick])
    except ValueError as error:
        assert "mesh.drawing" in str(error)
    assert not list(tmp_path.rglob("sign"))


@needs_gmsh
@pytest.mark.parametrize("command", ["check", "run", pytest.param("sweep", marks=pytest.mark.slow)])
def test_commands_of_the_shell_run_only_in_a_trusted_drawing(tmp_path, capsys, command):
    sign, case = tmp_path / "sign", tmp_path / "case.toml"
    (tmp_path / "plate.geo").write_text(f"{SQUARE}SystemCall \"touch '{sign.as_posix()}'\";\n")
    options = {
        "check": [],
        "run": ["--dry-run"],
        "sweep": ["--over", "depth=1:2:2", "--jobs", "1", "--out", str(tmp_path / "out")],
    }[command]
    outputs = '[outputs.energy]\nquantity = "energy"\n[adapt]\npasses = 0\n'
    case.write_text(TEXT + outputs)
    assert run_command(command, case, *options) != 0
    said = "".join(capsys.readouterr())
    assert "'plate.geo', line 5: SystemCall is not among the words" in said and not sign.exists()
    case.write_text(f"trusted = true\n{TEXT}{outputs}")
    run_command(command, case, *options)
    assert sign.exists()


@needs_gmsh
def test_included_files_are_drawn_in_place(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "sizes.pro").write_text('width = 3; // of "all"\nInclude "more.pro";\n')
    (tmp_path / "parts" / "more.pro").write_text("Macro Half\n  half = width / 2;\nReturn\n")
    text = 'Include "parts/sizes.pro"; Call Half;\nDilate {{0, 0, 0}, {half, 1, 1}} { Surface{1}; }\n'
    assert drawn(tmp_path, text).p[0].max() == pytest.approx(1.5)


@needs_gmsh
@pytest.mark.parametrize("statement", ['Merge "part.brep";', 'v() = ShapeFromFile("part.brep");'])
def test_geometry_is_merged_from_below_the_folder(tmp_path, statement):
    drawn_by_gmsh(tmp_path / "part.brep", 'SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 2, 2};')
    (tmp_path / "plate.geo").write_text(
        f'SetFactory("OpenCASCADE");\n{statement}\nPhysical Surface("air") = Surface{{:}};\n'
        'Physical Curve("outer") = Curve{:};\n'
    )
    mesh = fitting_mesh(case_of({"mesh": {"drawing": "plate.geo"}, **CASE}, tmp_path))
    assert mesh.p.max() == pytest.approx(2.0)


@needs_gmsh
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('Include "{outside}/x.geo";', "is not the relative path of a file below the folder of the drawing."),
        ('Merge "../outside/x.geo";', "is not the relative path of a file below"),
        ('Include "parts/../../outside/x.geo";', "is not the relative path of a file below"),
        ('Include "..\\outside\\x.geo";', "is not the relative path of a file below"),
        ('Merge "link/x.geo";', "is a link to a file outside of the folder of the drawing."),
        ('Include StrCat("x", ".geo");', "Include needs the name of a file in quotes, and nothing else."),
        ('a = "x.geo"; Merge a;', "Merge needs the name of a file in quotes, and nothing else."),
        ('Merge Str("x.geo");', "Merge needs the name of a file in quotes, and nothing else."),
        ('Merge "x.py";', "Merge reads .step, "),
        ('Merge "x.msh";', "'x.msh' is none of them."),  # a script by its first line
        ('Include "touch.geo";', "'touch.geo', line 2: SystemCall is not among the words"),
        ('Include "self.geo";', "'self.geo', line 1: \"self.geo\" includes itself."),
        ('Include "none.geo";', "'plate.geo', line 5: \"none.geo\" is not there."),
        ('Merge "with_options.step";', "'with_options.step.opt': Gmsh would run it after 'with_options.step'"),
    ],
)
def test_files_that_are_not_below_the_folder_or_not_harmless_are_refused(tmp_path, text, said):
    outside, folder = tmp_path / "outside", tmp_path / "inside"
    outside.mkdir()
    folder.mkdir()
    (folder / "parts").mkdir()
    (folder / "link").symlink_to(outside, target_is_directory=True)
    for file in (outside / "x.geo", folder / "x.py", folder / "with_options.step", folder / "with_options.step.opt"):
        file.write_text("x = 1;\n")
    (folder / "x.msh").write_text(TOUCH)
    (folder / "touch.geo").write_text(f"// a\n{TOUCH}")
    (folder / "self.geo").write_text('Include "self.geo";')
    assert said in refusal(folder, text.replace("{outside}", outside.as_posix()))


@needs_gmsh
def test_an_error_in_an_included_file_is_told_with_its_line(tmp_path):
    (tmp_path / "more.geo").write_text("x = 1;\n\nPoint(9) = {0,;\n")
    with pytest.raises(ValueError, match=r"more\.geo', line 3: syntax error \(;\)"):
        drawn(tmp_path, '/* two\nlines */ Include "more.geo";\n')


@needs_gmsh
@pytest.mark.parametrize(
    "text",
    [
        'DefineConstant[ n = {2, Min 1, Max 9, Step 1, Name "Sizes/n", Units "mm", ReadOnly 0, Choices{1="a"}} ];',
        's = Sprintf("%g", 2); t = StrCat(s, UpperCase("a")); Printf("%g > 1", 2);',
        "Macro Cut\n  n += 1; p~{n} = n;\nReturn\nn = 0;\nFor k In {0:2}\n  Call Cut;\nEndFor\n",
        "If (Exists(n) || StrCmp(\"a\", 'b') > 0)\n x = 1;\nElseIf (1 > 2)\n x = 2;\nElse\n x = 3;\nEndIf\n",
        "Transfinite Curve {1:4} = 5 Using Progression 1.1; Transfinite Surface {1} Right;",
        "Field[1] = Box; Field[1].VIn = .1; Field[1].VOut = 1e-1; Background Field = 1;",
        "Periodic Curve {2} = {4} Translate {1, 0, 0};",
        "Color Red { Surface{1}; } Mesh.Color.Points = {255, 0, 0}; General.Terminal = 0; Mesh.Algorithm = 6;",
        "a() = Translate {2, 0, 0} { Duplicata { Surface{1}; } }; BooleanUnion{ Surface{1}; Delete; }{ Surface{a()}; }",
        'View "size" { SP(0, 0, 0){1}; ST(0, 0, 0, 1, 0, 0, 0, 1, 0){1, 2, 3}; };',
        "// SystemCall \"x\"\n/* Save */ note = \"SystemCall 'x'\"; two = 'lines\nof text';",
    ],
)
def test_what_draws_needs_no_trust(tmp_path, text):
    assert drawn(tmp_path, text).nelements > 0


@needs_gmsh
@pytest.mark.parametrize("name", ["actuator", "c_core", "getdp", "motor"])
def test_a_drawing_that_is_not_trusted_gives_the_mesh_of_a_trusted_one(tmp_path, name):
    (tmp_path / f"{name}.geo").write_bytes((EXAMPLES / f"{name}.geo").read_bytes())
    cases = [
        case_of({"mesh": {"drawing": f"{name}.geo"}, "trusted": trusted, **CASE}, tmp_path) for trusted in (False, True)
    ]
    assert cases[0].mesh_file.read_bytes() == cases[1].mesh_file.read_bytes()


@examples(200, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_the_text_that_gmsh_gets_is_its_own_normal_form(tmp_path_factory, data):
    """Of spoilt drawings, too: what is read has the words that were checked, without comments, in short lines."""
    folder = tmp_path_factory.mktemp("spoilt")
    seeds = [text.encode("latin-1") for text in (*COMMANDS, *TRICKS.values())]
    seeds += [(EXAMPLES / f"{name}.geo").read_bytes() for name in ("actuator", "team20")]
    (folder / "plate.geo").write_bytes(data.draw(spoilt(data.draw(st.sampled_from(seeds)))))
    try:
        script = Script.read(folder / "plate.geo")
    except ValueError as error:
        assert "'plate.geo'" in str(error) and "\n" not in str(error)
        return
    script.write(folder / "copy.geo")
    again = Script.read(folder / "copy.geo")
    plain = [re.sub("[\r\n]", " ", token.text) for token in script.tokens]
    assert [token.text for token in again.tokens] == plain
    lines = (folder / "copy.geo").read_bytes().split(b"\n")
    assert max(map(len, lines)) < 4096 and lines[-1] == b""


def test_only_a_drawing_is_trusted(tmp_path):
    with pytest.raises(ValueError, match="trusted is for a drawing"):
        case_of({"mesh": "plate.msh", "trusted": True, **CASE}, tmp_path)

"""Make a case of a model that FEMM has analysed: materials, currents and conditions, on the mesh of its .ans file."""

import argparse
import json
import re
from itertools import pairwise
from math import cos, pi, radians, sin
from pathlib import Path

UNITS = {"inches": 0.0254, "millimeters": 1e-3, "centimeters": 1e-2, "meters": 1.0, "mils": 2.54e-5}
UNITS |= dict.fromkeys(("micrometers", "microns"), 1e-6)

PAIRS = {"4": "periodic", "5": "antiperiodic"}  # types of boundaries


def properties(head, kind):
    """What stands between <BeginKIND> and <EndKIND>, each as a dictionary, the rows of a curve under "BH"."""
    found = re.findall(rf"<Begin{kind}>(.*?)<End{kind}>", head, re.DOTALL)
    rows = re.compile(r"^\s*([-+.\deE]+)\s+([-+.\deE]+)\s*$", re.MULTILINE)
    return [
        {**dict(re.findall(r'<(\w+)>\s*=\s*"?([^"\n]*?)"?\s*\n', text)), "BH": rows.findall(text)} for text in found
    ]


def labels(head):
    """The block labels: x, y, block, size, circuit, direction, group, turns, and more."""
    count, rest = re.search(r"\[NumBlockLabels\]\s*=\s*(\d+)\s*\n(.*)", head, re.DOTALL).groups()
    return [line.split() for line in rest.split("\n")[: int(count)]]


def known(condition, what):
    if not condition:
        raise SystemExit(f"{what} is nothing that this recipe knows: write that part of the case by hand")


def coercivity(strength, row):
    """The key of a magnet in A/m, which points as its label says: in one direction, or by a multiple of theta."""
    formula = "".join(row[9:]).strip('"')
    turning = re.fullmatch(r"(?:(\d+)\*)?theta(\+180)?", formula)
    known(turning or not formula, f"the direction of magnetisation {formula!r}")
    if turning:
        size, pairs = -strength if turning[2] else strength, int(turning[1] or 1) - 1
        return f'coercivity = {{pattern = "halbach", magnitude = {size!r}, pole_pairs = {pairs}}}  # along {formula}'
    angle = radians(float(row[5]))
    return f"coercivity = [{strength * cos(angle)!r}, {strength * sin(angle)!r}]  # A/m, at {row[5]} degrees"


def material(block, row):
    """Keys of a material of the case: H in A/m, J in A/m^2 (FEMM has MA/m^2)."""
    known(block["Mu_x"] == block["Mu_y"], f"{block['BlockName']}: different permeabilities in x and y")
    fill = float(block["LamFill"]) if int(block["LamType"]) <= 2 else 1.0
    known(fill == 1.0 or int(block["LamType"]) == 0, f"{block['BlockName']}: laminated across the plane, so it")
    known(fill == 1.0 or not float(block["H_c"]), f"{block['BlockName']}: a laminated magnet, which")
    vacuum = (1.0 - fill) * 4e-7 * pi  # sheets in the plane carry the flux side by side with the air between them
    points = [[fill * float(b) + vacuum * float(h), float(h)] for b, h in block["BH"] if float(b) > 0.0]
    noisy = any(one[0] >= two[0] or one[1] >= two[1] for one, two in pairwise(points))
    curve = f"{{points = {points}, smooth = true}}" if noisy else f"{points}"
    yield f"bh = {curve}" if points else f"permeability = {fill * float(block['Mu_x']) + 1.0 - fill!r}"
    if float(block["H_c"]):
        yield coercivity(float(block["H_c"]), row)
    if float(block["J_re"]):
        yield f"current_density = {1e6 * float(block['J_re'])!r}"


def case(path):
    """Lines of a case for the solution file of FEMM, which holds the model, too."""
    head = path.read_text(errors="replace").partition("[Solution]")[0]
    setting = {key.lower(): value for key, value in re.findall(r'\[(\w+)\]\s*=\s*"?([^"\n]*?)"?\s*\n', head)}
    known(float(setting["frequency"]) == 0.0, "a frequency")
    known(setting.get("pointprops", "0") == "0", "a point property")
    yield f"mesh = {json.dumps(path.name)}"
    yield "order = 1  # as FEMM has it; leave this out for better elements"
    axisymmetric = setting["problemtype"] == "axisymmetric"
    unit = UNITS[setting["lengthunits"].lower()]
    yield "axisymmetric = true" if axisymmetric else f"depth = {unit * float(setting['depth'])!r}  # m"
    for kind, key in PAIRS.items():
        names = [each["BdryName"] for each in properties(head, "Bdry") if each["BdryType"] == kind]
        if names:  # read_mesh calls the two sides of a pair NAME 1 and NAME 2
            yield f"{key} = {json.dumps([[f'{name} 1', f'{name} 2'] for name in names])}"
    blocks, circuits = properties(head, "Block"), properties(head, "Circuit")
    rows = labels(head)
    of_block = [row[2] for row in rows]
    coils = []
    for k, row in enumerate(rows):
        known(int(row[2]) > 0, "a label without a material")
        block = blocks[int(row[2]) - 1]
        name = block["BlockName"] + (f" {1 + of_block[:k].count(row[2])}" if of_block.count(row[2]) > 1 else "")
        yield from ("", f"[materials.{json.dumps(name)}]", *material(block, row))
        if int(row[4]) > 0:
            circuit = circuits[int(row[4]) - 1]
            known(circuit["CircuitType"] == "1", f"{circuit['CircuitName']}: a circuit in parallel")
            coils.append(f"{json.dumps(name)} = {float(circuit['TotalAmps_re']) * int(row[7])!r}")
    yield from ("", "[ampere_turns]", *coils) if coils else ()
    yield from ("", "[potential]")
    for boundary in properties(head, "Bdry"):
        if boundary["BdryType"] in PAIRS:
            continue
        known(boundary["BdryType"] == "0", f"the boundary {boundary['BdryName']}, on which A is not given,")
        known(not float(boundary.get("phi", 0)), f"the boundary {boundary['BdryName']}, whose A has a phase,")
        value, *slopes = (float(boundary[key]) for key in ("A_0", "A_1", "A_2"))
        known(
            not (any(slopes) and axisymmetric), f"the boundary {boundary['BdryName']}, whose A varies around an axis,"
        )
        x, y = (slope / unit for slope in slopes)  # FEMM counts x and y in the unit of the drawing
        yield f"{json.dumps(boundary['BdryName'])} = " + (
            f'"{value!r} + {x!r}*x + {y!r}*y"' if any(slopes) else repr(value)
        )


def main(path, out):
    Path(out).write_text("\n".join([*case(Path(path)), "", "[adapt]", "passes = 4", ""]))
    print(f"wrote {out}; go on with: kohonen-adapt run {out} --out out")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("solution", help="the .ans file, beside which the case is to be")
    parser.add_argument("--out", required=True, help="the case to write, in the same folder")
    arguments = parser.parse_args()
    main(arguments.solution, arguments.out)

"""Count docstrings, comments and names that are not plain English.

A count marks a place to look at. First paragraphs of docstrings follow the rules of `faults`; later paragraphs and
comments contain no verbs that make code a person; identifiers of the old vocabulary are `NAMES`.
"""

import ast
import io
import re
import tokenize


def words(text):
    return set(text.split())


VERBS = words(
    """
    Accept Accumulate Add Adjust Aggregate Align Allow Animate Annotate Append Apply Approximate Ask Assemble
    Assert Attach Average Balance Begin Bend Bind Bisect Blend Bound Bracket Broadcast Build Cache Calculate Call
    Capture Carry Cast Change Check Choose Classify Clean Clear Clip Close Coarsen Collapse Collect Color Colour
    Combine Compare Compile Compose Compute Concatenate Condense Configure Confirm Connect Construct Control
    Convert Copy Count Create Crop Curve Cut Decode Define Demonstrate Dequeue Descend Describe Destroy Detach
    Detect Determine Differentiate Diffuse Disable Disconnect Display Distribute Divide Do Double Draw Drop Edit
    Eliminate Embed Emit Enable Encode End Ensure Enumerate Estimate Evaluate Exchange Execute Expand Explain
    Export Extend Extract Factorise Factorize Fill Film Filter Finalize Find Finish Fit Flatten Flip Flush Fold
    Follow Force Format Freeze Gather Generate Get Grade Group Grow Guard Halve Handle Hang Hash Hold Identify
    Ignore Illustrate Implement Import Index Initialize Insert Integrate Interpolate Interrupt Invert Invoke
    Iterate Join Keep Label Learn Lift Limit Linearise Linearize Link List Load Locate Lock Log Look Loop Lower
    Make Map Mark Match Measure Mend Merge Mesh Minimize Mirror Modify Move Name Normalize Number Open Order
    Orient Output Override Pack Pad Pair Parse Partition Pass Perform Permute Pick Pin Place Plot Polish Pop
    Precompile Precondition Predict Prefer Prepare Present Print Probe Produce Project Propagate Provide Prune
    Push Put Queue Raise Rank Read Recognise Record Recycle Redo Reduce Refine Reflect Refuse Register Reject
    Release Relocate Remove Rename Render Renumber Reorder Reorient Repair Repeat Replace Report Represent Rescale
    Reserve Reset Reshape Resolve Restore Restrict Resume Retrieve Retry Return Reverse Rotate Round Run Sample
    Save Scale Scatter Search Select Serialise Serialize Set Share Shift Show Shrink Sign Skip Slice Slide Smooth
    Solve Sort Split Spread Stack Start State Stop Store Straighten Strip Subtract Sum Support Swap Sweep Switch
    Take Test Time Toggle Trace Track Train Transfer Transform Translate Transpose Traverse Trigger Try Turn Undo
    Unfold Ungroup Unlock Unpack Unpin Update Use Validate Verify Visit Wait Walk Warn Weigh Wrap Write Yield Zoom
    """
)
NOUNS = {"The", "A", "An", "All", "Every", "Each", "No", "Both", "Any", "Some", "Whether"}
STARTS = words("What Where Whether How Of By Beside Beyond On Which Who Those These They It Its")
FIRST = STARTS | {"For", "In", "As", "To", "If", "When", "With", "From", "At", "That", "Let", "Say", "Tell"}
PRONOUNS = re.compile(
    r"\b(it|its own|those|such(?! as)|likewise|what|who|that of|anybody|there are|there is"
    r"|(?:the|that|this|a|another|every) ones?|ones(?= (?:that|which|of|with))|one another|the others?(?! [a-z]))\b",
    re.I,
)
HUMAN = re.compile(
    r"\b(tells?|told|knows?|knew|hears?|heard|asks?|asked|wants?|agree|says?|said|comes?|came|goes|went|becomes?|became"
    r"|has a say|gives? back|given back|taken apart|takes? apart)\b",
    re.I,
)
NAMES = words(
    """
    ROOMS become bend bent beyond bulge came_from deep eager lowered middles nearly pinched room rooms said sound
    spoke stated still taken_apart told twins worth young
    """
)
FREE_OF_NEURONS = ("som", "docs")


def plain(text):
    """Return a paragraph without markup, code, quotations and brackets."""
    text = re.sub(r":[\w:]+:(?=`)", "", text)
    return re.sub(r"``[^`]*``|`[^`]*`|\([^)]*\)|\"[^\"]*\"", "x", text)


def faults(text, kind):
    """Return the rules that the first paragraph of a docstring breaks."""
    paragraph = " ".join(text.strip().split("\n\n")[0].split())
    first, found, bare = text.strip().splitlines()[0], set(), plain(paragraph)
    if len(first) > 79 or paragraph != " ".join(first.split()):
        found.add("1 summary is longer than a line of 79")
    if re.search(r"[:;]", bare):
        found.add("1 colon or semicolon in the summary")
    word = paragraph.split(" ")[0].strip("`*,.:")
    if kind == "function" and (word in NOUNS | FIRST or (len(bare.split()) > 4 and word not in VERBS)):
        found.add("2 a function's summary is not an imperative")
    sentences = [s.split(" ")[0].strip(",") for s in re.split(r"(?<=[.!?]) ", bare) if s]
    if any(s in STARTS for s in sentences) or (kind != "function" and word in FIRST):
        found.add("3 a sentence starts with What, Where, Whether, How, Of, By, ...")
    if PRONOUNS.search(bare):
        found.add("5 a pronoun or empty word stands for a noun")
    if HUMAN.search(bare):
        found.add("7 code tells, knows, asks, wants, comes, becomes")
    return found


def docstrings(path):
    """Yield (line, name, kind, text) of every docstring of a file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            continue
        text = ast.get_docstring(node)
        if text:
            kind = {ast.Module: "module", ast.ClassDef: "class"}.get(type(node), "function")
            marks = {getattr(d, "id", getattr(d, "attr", "")) for d in getattr(node, "decorator_list", [])}
            kind = "property" if marks & {"property", "cached_property", "setter"} else kind
            yield getattr(node, "lineno", 1), getattr(node, "name", "(module)"), kind, text


def comments(path):
    """Yield (line, text) of every comment of a file."""
    for token in tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline):
        if token.type == tokenize.COMMENT and len(token.string.split()) > 2 and "fmt:" not in token.string:
            yield token.start[0], token.string.lstrip("# ")


def house_names(path):
    """Yield (line, name) where an identifier of the old vocabulary is used."""
    neurons = set() if any(part in FREE_OF_NEURONS for part in path.parts) else {"neurons"}
    for token in tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline):
        if token.type == tokenize.NAME and token.string in NAMES | neurons:
            yield token.start[0], token.string


def imports_of(source):
    """Yield (module, name) of every import in a program, in functions too; of a whole module the name is None."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, None) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (("." * node.level + (node.module or ""), alias.name) for alias in node.names)

"""Folders of MATLAB models for tests."""

from pathlib import Path

from dap3d_matlab.language.interpreter import follow
from dap3d_matlab.language.parse import Grammar, SourceFile, syntax_mistakes

#: The models of the manual as its MATLAB program has them, in our own words.
MODELS = Path(__file__).parents[1] / "matlab"

#: A small model: one body on a ball joint, and one free body.
SMALL = {
    "inBodies.m": "B1 = Body_struct; B1.mass = 2; B1.Jp = diag([1 2 2.5]); B1.r = [0; 1; 0];\n"
    "B2 = Body_struct; B2.mass = 3; B2.Jp = eye(3); B2.r = [5; 0; 0];\nBodies = [B1; B2];\n",
    "inPoints.m": "P1 = Point_struct; P1.Bindex = 1; P1.sPp = [0; -1; 0];\n"
    "P2 = Point_struct; P2.Bindex = 0;  P2.sPp = [0; 0; 0];\n"
    "P3 = Point_struct; P3.Bindex = 2; P3.sPp = [1; 0; 0];\nPoints = [P1; P2; P3];\n",
    "inVectors1.m": "V1 = Vector1_struct; V1.Bindex = 1; V1.sp = [0; 1; 0];\n"
    "V2 = Vector1_struct; V2.Bindex = 0; V2.sp = [0; 1; 0];\n"
    "V3 = Vector1_struct; V3.Bindex = 2; V3.sp = [0; 1; 0];\nVectors1 = [V1; V2; V3];\n",
    "inVectors2.m": "V1 = Vector2_struct; V1.iPindex = 3; V1.jPindex = 1;\nVectors2 = [V1];\n",
    "inJoints.m": "J1 = Joint_struct; J1.type = 'sph'; J1.iPindex = 1; J1.jPindex = 2;\n"
    "Joints = [J1];\n",
    "inForces.m": "S1 = Force_struct; S1.type = 'weight';\nForces = [S1];\n",
    "inFuncts.m": "C1 = Funct_struct; C1.type = 'a'; C1.coeff = [0 1 0];\nFuncts = [C1];\n",
    "inAnimate.m": "Points_anim = [];\n",
}


def write(folder, **files):
    """Write the small model; files by name without ``.m`` replace its own, None leaves one out."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in SMALL.items():
        text = files.pop(name.removesuffix(".m"), text)
        if text is not None:
            (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    for name, text in files.items():
        (folder / f"{name}.m").write_text(text)
    return folder


def variables_of(text):
    """Variables after the statements of a text, and what is wrong in it, as messages."""
    source = SourceFile(Path("file.m"), text)
    root = Grammar().tree(source)
    faults = syntax_mistakes(source, root)
    if faults:
        return {}, [str(m) for m in faults]
    workspace = follow(source, root)
    return workspace.variables, [str(m) for m in workspace.mistakes]

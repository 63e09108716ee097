"""The recipes of docs/howto/extend.md, followed in a copy of the package."""

import ast
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import launch

PROGRAM = """
import numpy as np
import jampetsc
from jampetsc.io.packing_file import write_packing
from jampetsc.packing.contacts import net_forces

# a triangular lattice, which is at rest under any potential and moves affinely
a, rows = 0.9, np.arange(6)
x, y = (one.ravel() for one in np.meshgrid(np.arange(6), rows, indexing="ij"))
places, cell = np.column_stack((a * (x + 0.5 * y), a * 0.75**0.5 * y)), a * np.diag([6, 6 * 0.75**0.5])
write_packing("p.h5", jampetsc.Packing(places, np.full(36, 0.5), cell, "stiffening"))
found = jampetsc.load("p.h5")
contacts, potential = found.contacts(), found.potential
assert str(potential) == "stiffening" and potential.record["stiffness"] == "constant"
u = contacts.overlap
assert np.allclose(contacts.force, u + u**3, rtol=1e-13) and np.allclose(contacts.stiffness, 1 + 3 * u * u, rtol=1e-13)
assert np.isclose(found.record["energy"], np.sum(u**2 / 2 + u**4 / 4), rtol=1e-13) and len(u) == 108
assert np.abs(net_forces(36, contacts)).max() < 1e-9 and np.isclose(found.pressure, (0.1 + 0.1**3) * 3**0.5 / a)

from jampetsc.packing.kernel import bond_forces
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.strain import UNSTRAINED

forces = np.empty((36, 2))
sums = bond_forces(
    NeighbourList.build(found, 0.3), np.zeros((36, 2)), UNSTRAINED, potential.constants, forces, None, None
)
assert np.isclose(sums.energy / potential.exponent, found.record["energy"], rtol=1e-12)
sweep = jampetsc.sweep(found, omega=[1e-8, 1.0])
h = 1e-4
shears = [np.array([[1, 0], [gamma, 1]]) for gamma in (-h, 0, h)]
energies = [
    jampetsc.Packing(places @ F, found.radii, cell @ F, "stiffening").record["energy"] for F in shears
]
assert np.isclose(sweep.G.real[0], (energies[0] - 2 * energies[1] + energies[2]) / h**2 / found.volume, rtol=1e-4)
assert str(type(potential)(exponent=2.0)) == "harmonic"
scale = np.array([0.8, 1.3])
for name in ("energy", "force"):
    of = type(potential)("stiffening", "inverse-square-diameter", 2.0)
    low, high = (getattr(of, name)(0.1 * scale + h, scale) for h in (-1e-6, 1e-6))
    slope = (of.force if name == "energy" else of.contact_stiffness)(0.1 * scale, scale)
    assert np.allclose((high - low) / 2e-6, slope, rtol=1e-8)
"""


ROWS = """
import sys
import numpy as np
import jampetsc
from jampetsc import main
from jampetsc.laws.damping import damping_law
from jampetsc.laws.loads import LoadChoice

assert jampetsc.__file__.startswith(sys.argv[1])
packing = jampetsc.load(sys.argv[2])
brush = damping_law("brush", ratio=0.3)
assert (brush.normal, brush.transverse, str(brush)) == (1.0, 0.3, "brush damping, ratio = 0.3")
model = jampetsc.models.CDd()
assert (model.law.drag, model.law.transverse, model.mass) == (0.1, 1.0, 0.0)
(load,) = LoadChoice("biaxial").of(3)
assert np.array_equal(load.gradient, np.diag([0.5, 0.5, 0.0]))
options = "--law brush --ratio 0.3 --load biaxial --omega 0.1,1 --out s.h5".split()
assert main.main(["sweep", sys.argv[2], *options]) == 0
sweep, direct = jampetsc.load("s.h5"), jampetsc.sweep(packing, brush, load=np.eye(2) / 2, omega=[0.1, 1.0])
assert np.allclose(sweep.G, direct.G, rtol=1e-6) and sweep.load == "biaxial"
assert (sweep.law["law"], sweep.law["ratio"]) == ("brush", 0.3)
slow = jampetsc.quasistatic(packing)
assert slow.attributes["contact_count"] == len(slow["contacts/pairs"])
assert main.main(["plot", "s.h5", "--kind", "loss-tangent", "--out", "loss.png"]) == 0
distances = packing.contacts().distance
assert float(jampetsc.spacing(packing, quantile=0.25)) == float(f"{np.quantile(distances, 0.25):.6g}")
assert [main.main(["spacing", sys.argv[2], "--laps", laps]) for laps in ("2", "0")] == [0, 2]
"""


def section(title):
    """The text of a section of the page."""
    text = (launch.ROOT / "docs" / "howto" / "extend.md").read_text() + "## "
    return re.search(rf"^## {title}\n(.*?)(?=^## )", text, re.MULTILINE | re.DOTALL)[1]


def blocks(title):
    """The indented pieces of code in a section."""
    return [
        textwrap.dedent(text)
        for text in re.findall(r"(?:^(?: {4}.*)?\n)+", section(title), re.MULTILINE)
        if text.strip()
    ]


def with_insertion(source, name, lines):
    """A module with lines at the beginning of a function, behind its docstring, or of a dictionary."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef) and node.name == name:
            place, indent = node.body[0].end_lineno, " " * node.body[0].col_offset
        elif isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name:
            place, indent = node.lineno, " " * 4
    rows = source.splitlines()
    return "\n".join(
        [*rows[:place], *textwrap.indent(textwrap.dedent(lines), indent).splitlines(), *rows[place:], ""]
    )


def test_a_potential(tmp_path):
    """As the page says, in one module: contacts, a file, the compiled loop and a sweep."""
    module = copy_of_package(tmp_path) / "packing" / "potentials.py"
    source = module.read_text()
    steps = re.findall(
        r"(?:In|a row of) `(\w+)`[^\n]*(?:\n[^\n]+)*?:\n\n((?: {8}[^\n]*\n)+)", section("A potential")
    )
    assert [name for name, _ in steps] == [
        "EXPONENTS", "constants", "secant_stiffness", "tangent_ratio", "energy_term", "largest_stiffness",
    ]  # fmt: skip
    for name, lines in steps:
        source = with_insertion(source, name, lines)
    module.write_text(source)
    (tmp_path / "program.py").write_text(PROGRAM)
    # compiling takes most of the time, less of it without optimisation
    environment = launch.environment() | {"PYTHONPATH": str(tmp_path), "NUMBA_OPT": "0"}
    done = subprocess.run(
        [sys.executable, "program.py"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr


def copy_of_package(folder):
    """The package, copied into a folder."""
    ignored = shutil.ignore_patterns("__pycache__")
    return Path(shutil.copytree(launch.ROOT / "jampetsc", folder / "jampetsc", ignore=ignored))


def insert(path, before, lines):
    """Lines in front of the one line of a module that begins with `before`, indented as it is."""
    rows = path.read_text().splitlines()
    (place,) = (number for number, row in enumerate(rows) if row.strip().startswith(before))
    indent = " " * (len(rows[place]) - len(rows[place].lstrip()))
    path.write_text("\n".join([*rows[:place], textwrap.indent(lines.rstrip(), indent), *rows[place:], ""]))


def test_rows_and_commands(tmp_path):
    """A law, a load, a model, an option, a number in a file, a picture and a command."""
    package = copy_of_package(tmp_path)
    (law,), (load,), (model,), (option,) = map(
        blocks, ("A damping law", "A load", "A model of flow", "An option")
    )
    number, row = blocks("A number in a file")
    command, entry = blocks("A command")
    (picture,) = re.findall(r"```python\n(.*?)```", section("A picture"), re.DOTALL)
    imports, function = (
        "from jampetsc.plots.picture import picture\n",
        picture.partition("\n\n\n")[2].partition("\n\n\naxes")[0],
    )
    insert(package / "laws" / "damping.py", '"stokes": Family(', law)
    insert(package / "laws" / "loads.py", "return {load.name: load", load)
    insert(package / "laws" / "flow_models.py", '"RD": (Law', model)
    insert(package / "commands" / "quasistatic.py", "writer.attributes(eta_inf", number)
    insert(package / "io" / "response_formats.py", "G0, G_affine, bulk_modulus |", row)
    (package / "plots" / "loss_plots.py").write_text(imports + "\n\n" + function + "\n")
    draw = package / "plots" / "draw.py"
    draw.write_text(draw.read_text().replace('"moduli_plots",', '"moduli_plots", "loss_plots",', 1))
    (package / "commands" / "spacing.py").write_text(command)
    insert(package / "commands" / "spacing.py", "quantile: float", option)
    insert(package / "commands" / "__init__.py", '"info": ', entry)
    (tmp_path / "program.py").write_text(ROWS)
    environment = launch.environment() | {"PYTHONPATH": str(tmp_path)}
    words = [
        sys.executable,
        "program.py",
        str(tmp_path),
        str(launch.ROOT / "tests/data/isostatic-N24-p1e-7.h5"),
    ]
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr

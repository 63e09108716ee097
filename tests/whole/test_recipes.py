"""The recipes of docs/howto/extend.md, followed in a copy of the package."""

import ast
import re
import shutil
import subprocess
import sys
import textwrap

import launch

PROGRAM = """
import numpy as np
import jampetsc
from jampetsc.packing.contacts import net_forces

jampetsc.pack(n=24, pressure=0.05, seed=1, potential="stiffening", stabilise="shear", out="p.h5")
found = jampetsc.load("p.h5")
contacts, potential = found.contacts(), found.potential
assert str(potential) == "stiffening" and potential.record["stiffness"] == "constant"
u = contacts.overlap
assert np.allclose(contacts.force, u + u**3, rtol=1e-13) and np.allclose(contacts.stiffness, 1 + 3 * u * u, rtol=1e-13)
assert np.isclose(found.record["energy"], np.sum(u**2 / 2 + u**4 / 4), rtol=1e-13) and u.max() > 0.05
assert np.abs(net_forces(found.n, contacts)).max() < 1e-9 and np.isclose(found.pressure, 0.05)

from jampetsc.packing.kernel import bond_forces
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.strain import UNSTRAINED

forces = np.empty((24, 2))
sums = bond_forces(
    NeighbourList.build(found, 0.3), np.zeros((24, 2)), UNSTRAINED, potential.constants, forces, None, None
)
assert np.isclose(sums.energy / potential.exponent, found.record["energy"], rtol=1e-12)
sweep = jampetsc.sweep(found, omega=[1e-8, 1.0])
assert np.isclose(sweep.G.real[0], found.record["shear_modulus"], rtol=1e-6)
assert str(type(potential)(exponent=2.0)) == "harmonic"
scale = np.array([0.8, 1.3])
for name in ("energy", "force"):
    of = type(potential)("stiffening", "inverse-square-diameter", 2.0)
    low, high = (getattr(of, name)(0.1 * scale + h, scale) for h in (-1e-6, 1e-6))
    slope = (of.force if name == "energy" else of.contact_stiffness)(0.1 * scale, scale)
    assert np.allclose((high - low) / 2e-6, slope, rtol=1e-8)
"""


def section(title):
    """The text of a section of the page."""
    text = (launch.ROOT / "docs" / "howto" / "extend.md").read_text()
    return re.search(rf"^## {title}\n(.*?)(?=^## )", text, re.MULTILINE | re.DOTALL)[1]


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
    """As the page says, in one module: a packing, its file, the compiled loop and a sweep."""
    shutil.copytree(
        launch.ROOT / "jampetsc", tmp_path / "jampetsc", ignore=shutil.ignore_patterns("__pycache__")
    )
    module = tmp_path / "jampetsc" / "packing" / "potentials.py"
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

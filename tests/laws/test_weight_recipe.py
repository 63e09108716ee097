"""The recipe for a weight in docs/howto/extend.md, followed in a copy of the package."""

import re
import shutil
import subprocess
import sys

import launch
import pytest

PROGRAM = """
import sys
import numpy as np
import jampetsc
from jampetsc.commands.sweep import Sweep
from jampetsc.errors import InputError
from jampetsc.laws.flow_models import Model
from jampetsc.options.parameters import build_job

assert jampetsc.__file__.startswith(sys.argv[1])
network = jampetsc.Network(
    [[0.1, 0.2], [1.0, 0.1], [0.5, 0.9]],
    [[0, 1], [1, 2], [2, 0], [0, 1], [1, 2], [2, 0]],
    [[2.1, 0.0], [0.3, 1.9]],
    stiffness=[1.0, 2.0, 0.7, 1.3, 0.4, 0.9],
    images=[[0, 0], [0, 0], [0, 0], [-1, 0], [0, -1], [1, 1]],
    radii=[0.5, 0.4, 0.7],
    k=2.5,
)
law = jampetsc.Law("rims that roll", normal=1.0, rolling=0.3, tau1=0.4)
matrices = jampetsc.assemble(network, law, load="xy").to_scipy()
n, unit = 3, 2.5 * 0.4
K, B = np.zeros((2, 3 * n + 1, 3 * n + 1))
bonds = network.linear_bonds
for c in range(len(bonds)):
    i, j, r = bonds.i[c], bonds.j[c], bonds.r[c]
    normal = r / np.hypot(*r)
    stretch, roll = np.zeros((2, 3 * n + 1))
    stretch[[3 * j, 3 * j + 1, 3 * i, 3 * i + 1, -1]] = *normal, *-normal, normal[0] * r[1]
    roll[3 * i + 2], roll[3 * j + 2] = network.radii[i], -network.radii[j]
    K += bonds.stiffness[c] * np.outer(stretch, stretch)
    B += unit * (np.outer(stretch, stretch) + 0.3 * np.outer(roll, roll))
order = np.array([3 * disk + part for disk, part in matrices.dofs])
for name, exact, column in (("K", K, "k_gamma"), ("B", B, "b_gamma")):
    found = getattr(matrices, name).toarray()
    np.testing.assert_allclose(found, exact[np.ix_(order, order)], atol=1e-14)
    np.testing.assert_allclose(getattr(matrices, column), exact[order, -1], atol=1e-14)
# no rim rolls on another where all turn by the same rho theta: one spin is pinned with the translations
moves = np.zeros(3 * n)
moves[2::3] = 1.0 / network.radii
assert np.abs(B[:-1, :-1] @ moves).max() < 1e-14 and len(matrices.pins) == 3
omega = np.array([1e-3, 1.0, 1e2])
sweep = jampetsc.sweep(network, law, omega=omega)
free = np.setdiff1d(np.arange(3 * n), order[matrices.pins])
for w, G, bound in zip(omega, sweep.G, sweep["error_bound"], strict=True):
    Z = K + 1j * w * B
    c = Z[free, -1]
    exact = (Z[-1, -1] - c @ np.linalg.solve(Z[np.ix_(free, free)], c)) / network.volume
    assert abs(G - exact) <= bound + 1e-13 * abs(exact)
assert sweep.attributes["rolling"] == 0.3
assert build_job(Sweep, {"packing": "p.h5", "law": "custom", "rolling": 0.5}).law.rolling == 0.5
try:
    Model(law, mass=1.0)
except InputError as error:
    assert str(error).startswith("rolling 0.3: not supported by flow"), error
else:
    raise AssertionError("flow took it")
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of the package with the row of the recipe."""
    text = (
        (launch.ROOT / "docs/howto/extend.md")
        .read_text()
        .partition("\n## A weight\n")[2]
        .partition("\n## ")[0]
    )
    row = re.search(r"^ {8}LinearForm\(\n.*?^ {8}\),\n", text, re.DOTALL | re.MULTILINE)[0]
    root = tmp_path_factory.mktemp("copy")
    shutil.copytree(launch.ROOT / "jampetsc", root / "jampetsc", ignore=shutil.ignore_patterns("__pycache__"))
    table = root / "jampetsc/laws/forms.py"
    written = table.read_text()
    assert written.count("FORMS = (\n") == 1
    head, _, rest = written.partition('    LinearForm("drag"')
    table.write_text(f'{head}{re.sub("^    ", "", row, flags=re.MULTILINE)}    LinearForm("drag"{rest}')
    return root


def run(copy, *words):
    done = subprocess.run(
        [sys.executable, *words], cwd=copy, env=launch.environment() | {"PYTHONPATH": str(copy)}, text=True,
        capture_output=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_matrices_bounds_and_options_follow_from_the_row(copy):
    run(copy, "-c", PROGRAM, str(copy))


def test_help_follows_from_the_row(copy):
    text = run(copy, "-m", "jampetsc", "sweep", "--help")
    assert re.search(r"--rolling ROLLING\s+weight of the rolling of rims on each other", text)

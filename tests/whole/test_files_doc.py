"""The formats as they are declared against docs/reference/files.md and real files: all is in some file, and no more."""

import re
from fnmatch import fnmatchcase
from pathlib import Path

import launch
import numpy as np
import pytest
from samples import JAMBASHBULK, isostatic

import jampetsc
from jampetsc.commands import JOBS, job_class
from jampetsc.io.formats import FORMATS
from jampetsc.io.hdf5 import open_file
from jampetsc.io.packing_file import write_packing
from jampetsc.io.provenance import PROVENANCE
from jampetsc.packing.packing import Packing
from jampetsc.packing.spring_network import Network

KINDS = {Packing: "jampetsc-packing", Network: "jampetsc-network"}
RARE = {  # of runs that are not made here
    # weights of a law that only python has; the exponent of a power, for which loops would be compiled again
    "": ("transverse", "sliding", "drag", "exponent", "requested_exponent"),
    "jampetsc-packing": ("source", "source_sha256", "requested_phi", "walls"),
    "jampetsc-sweep": ("failed_omega", "probe/forces"),
    "jampetsc-quasistatic": ("probe/forces",),
    "jampetsc-flow": (
        "quality",
        "snapshots/psi6_local",
        "snapshots/psi6_global",
    ),  # the latter of files in papers/kept
    "jampetsc-scaling": ("dimension", "notes"),
    "jampetsc-collapse": "dimension rate model mass protocol znu znu_error nu_error phi_J_error omega_error".split(),
}
RUNS = """\
pack --n 16 --pressure 1e-2 --stabilise shear --out made.h5
import JAMBASHBULK --out imported.h5
pack --dimension 3 --n 16 --pressure 1e-2 --out spheres.h5
quasistatic spheres.h5 --out slow-spheres.h5
import plain.xyr --out plain.h5
import nodes.txt --bonds bonds.txt --out net.h5
import flat.npz --bonds flat.npz --out flat.h5
springs --lattice triangular --size 4 --keep 0.9 --out lattice.h5
springs made.h5 --keep 0.9 --out cut.h5
sweep lattice.h5 --law stokes --omega 1 --out springs.h5
sweep made.h5 --out sweep.h5 --fields 1e-3,1
sweep p.h5 --out alpha.h5 --alpha 0.5 --stress 1e-6 --omega 1e-3,1
sweep p.h5 --out spins.h5 --law custom --sliding 1 --spin-drag 1 --tangential-stiffness 1 --omega 1
sweep p.h5 --out stokes.h5 --law stokes --method direct --omega 1e-3
sweep p.h5 --out wave.h5 --load wave:1,0:transverse --omega 1
sweep p.h5 --out inertia.h5 --mass 1 --omega 1e-2,1
sweep p.h5 --out points.h5 --load points:2 --omega 1
quasistatic p.h5 --out slow.h5 --betas 1,2
modes p.h5 --out modes.h5 --count 3
modes p.h5 --out states.h5 --states 0.1:1:3 --mass-by volume
spectrum sweep.h5 --out spectrum.h5
sweep p.h5 --omega 1e-2,1 --load tensor --out constants.h5
quasistatic p.h5 --load tensor --out slow-constants.h5
quasistatic p.h5 --load wave:1,0:transverse --out slow-wave.h5
quasistatic p.h5 --load points:2 --out slow-points.h5
quasistatic p.h5 --load wave:1,0:transverse+wave:0,1:transverse --out slow-waves.h5
sweep p.h5 --load wave:1,0:transverse+wave:0,1:transverse --omega 1 --out waves.h5
modes p.h5 --count 10 --load tensor --out shares.h5
correlate sweep.h5 --out correlation.h5
oscillate p.h5 --out oscillate.h5 --omega 1e-3 --stress 1e-9 --steps 16
oscillate made.h5 --out moving.h5 --contacts moving --omega 1e-2 --strain 1e-6 --steps 16 --cycles 3
relax made.h5 --out relax.h5 --strain 1e-6,1e-3 --times 0.1,1 --accuracy 1e-2
flow made.h5 --law contact --mass 1 --rate 1e-2 --strain 0.5 --discard 0.1 --snapshots 2 --out flow.h5
correlate flow.h5 --out velocities.h5
merge flow.h5 --out merged.h5
export flow.h5 --out frames.xyz
import frames.xyz --out frames.h5
shear made.h5 --events --d2min --step 1e-2 --strain 0.08 --out events.h5
pack --n 16 --pressure 1e-4 --seed 1 --out weak.h5
shear weak.h5 --events --step 1e-2 --strain 0.01 --out apart.h5
shear --dimension 3 --n 16 --phi 0.7 --step 1e-2 --strain 0.05 --out shear.h5
flow --dimension 3 --n 16 --phi 0.7 --model RD0 --rate 1e-2 --strain 0.1 --discard 0.02 --out flow3.h5
jam --dimension 3 --n 16 --phi 0.7 --seeds 1:1 --protocol shear --strain 0.1 --discard 0.05 --step 0.01 --out jam.h5
jam --n 16 --phi 0.9 --seeds 1:1 --protocol compress --separated --cooling-rate 1 --sweeps 1 --out cooled.h5
jam --n 24 --phi 0.9,0.92,0.94 --seeds 1:3 --out jam24.h5
jam --n 32 --phi 0.9,0.92,0.94 --seeds 1:3 --out jam32.h5
jam --n 16 --phi 0.9,0.92,0.94 --seeds 3:5 --out jam16.h5
collapse jam16.h5 jam24.h5 jam32.h5 --finite-size --observable pressure --fit phi_J=0.84,y,nu=1,omega=1 --corrections \
--degree 1 --out collapse.h5
flow --n 16 --phi 0.9 --seed 1 --walls --model RD0 --rate 1e-2 --strain 0.5 --discard 0.1 --out flow0.h5
flow --n 16 --phi 0.9 --seed 1 --model RD0 --rate 1e-2 --strain 0.5 --discard 0.1 --series 5e-3 --out rate1.h5
flow --n 16 --phi 0.9 --seed 1 --model RD0 --rate 3e-2 --strain 0.5 --discard 0.1 --out rate2.h5
flow --n 16 --phi 0.9 --seed 1 --model RD0 --rate 9e-2 --strain 0.5 --discard 0.1 --out rate3.h5
scaling rate1.h5 rate2.h5 rate3.h5 --form bingham --out scaling.h5"""


def test_the_page_has_every_format():
    text = (launch.ROOT / "docs" / "reference" / "files.md").read_text()
    assert set(re.findall(r"(?m)^## .*`(jampetsc-.*)`", text)) == FORMATS.keys()


def names_of(loaded, path):
    """(datasets, attributes) of what `load` gives for a file, a packing's attributes as the file has them."""
    if isinstance(loaded, Packing | Network):
        with open_file(path) as h5:
            return set(h5), set(h5.attrs)
    return set(loaded), set(loaded.attributes)


def fitting(name, names):
    """Whether one of the names is this one, or fits this pattern."""
    return any(fnmatchcase(one, name) for one in names)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_files_hold_what_their_formats_say(session, shared_path, monkeypatch, capsys):
    """Types and shapes are checked when they are loaded."""
    monkeypatch.chdir(shared_path)
    write_packing("p.h5", isostatic())
    Path("plain.xyr").write_text("box 2\n0 0 0.55\n1 0 0.55\n0 1 0.55\n1 1 0.55\n")
    Path("nodes.txt").write_text("box 3\n0 0\n1 0\n")
    np.savez("flat.npz", positions=np.array([[0, 0, 1], [1, 0, 1]]), box=[3.0, 3.0], bonds=[[0, 1]])
    Path("bonds.txt").write_text("0 1\n")
    lines = RUNS.replace("\\\n", "").splitlines()
    for line in lines:
        launch.here(line.replace("JAMBASHBULK", str(JAMBASHBULK)))
    writing = {name for name in JOBS if job_class(name).FORMAT.startswith("jampetsc-")}
    assert writing <= {line.split()[0] for line in lines}
    wrong, seen = [], {name: (set(), set()) for name in FORMATS}
    for path in sorted(shared_path.glob("*.h5")):
        loaded = jampetsc.load(path)
        kind = KINDS.get(type(loaded)) or loaded.format
        declared, common = FORMATS[kind], FORMATS[kind].common
        tables = (declared.datasets, declared.attributes), ("dataset", "attribute")
        for names, table, what, found in zip(names_of(loaded, path), *tables, seen[kind], strict=True):
            row = declared.attribute if what == "attribute" else table.row
            wrong += [f"{path.name}: {what} {name} is not declared" for name in names if row(name) is None]
            needed = [*table.rows.values(), *(common.rows.values() if common and what == "attribute" else ())]
            wrong += [
                f"{path.name}: {what} {one.name} is missing"
                for one in needed
                if not one.optional and not fitting(one.name, names)
            ]
            found |= names
    everything = set().union(*(attributes for _, attributes in seen.values()))
    wrong += [
        f"attribute {name} of every result" for name in PROVENANCE.rows if not fitting(name, everything)
    ]
    for kind, found in seen.items():
        for table, names in zip((FORMATS[kind].datasets, FORMATS[kind].attributes), found, strict=True):
            rare = (*RARE.get(kind, ()), *RARE[""])
            wrong += [
                f"{n} of {kind}, in no file" for n in table.rows if n not in rare and not fitting(n, names)
            ]
    wrong = [one for one in wrong if one.split()[1] not in RARE[""]]
    assert not wrong, "\n".join(wrong)

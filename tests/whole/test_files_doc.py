"""docs/files.md against real files: every dataset and attribute is in it, and what is in it is in some file."""

import re
from fnmatch import fnmatch

import h5py
import launch
import pytest
from samples import JAMBASHBULK, isostatic

from jampetsc.io.packing_file import write_packing
from jampetsc.io.parts import GROUP

DOC = launch.ROOT / "docs" / "files.md"
RARE = {  # of runs that are not made here
    "": ("transverse", "sliding", "drag"),  # weights of a law that only python has
    "jampetsc-packing": ("source", "source_sha256", "requested_phi"),
    "jampetsc-sweep": ("failed_omega",),
    "jampetsc-flow": ("quality",),
    "jampetsc-collapse": "rate model mass protocol znu znu_error nu_error phi_J_error omega_error".split(),
}
RUNS = """\
pack --n 16 --pressure 1e-2 --stabilise shear --out made.h5
import JAMBASHBULK --out imported.h5
sweep made.h5 --out sweep.h5 --fields 1e-3,1
sweep p.h5 --out alpha.h5 --alpha 0.5 --stress 1e-6 --omega 1e-3,1
sweep p.h5 --out stokes.h5 --law stokes --method direct --omega 1e-3
quasistatic p.h5 --out slow.h5 --betas 1,2
modes p.h5 --out modes.h5 --count 3
spectrum sweep.h5 --out spectrum.h5
correlate sweep.h5 --out correlation.h5
oscillate p.h5 --out oscillate.h5 --omega 1e-3 --stress 1e-9 --steps 16
oscillate p.h5 --out moving.h5 --contacts moving --omega 1e-2 --strain 1e-9 --steps 16
oscillate p.h5 --out sticking.h5 --alpha 0.2 --omega 1e-22 --strain 1e-4 --steps 16
flow made.h5 --law contact --mass 1 --rate 1e-2 --strain 0.5 --discard 0.1 --snapshots 2 --out flow.h5
correlate flow.h5 --out velocities.h5
shear --n 16 --phi 0.9 --step 1e-2 --strain 0.05 --out shear.h5
jam --n 16 --phi 0.9 --seeds 1:1 --protocol shear --strain 0.1 --discard 0.05 --step 0.01 --out jam.h5
jam --n 16 --phi 0.9 --seeds 1:1 --protocol compress --separated --cooling-rate 1 --sweeps 1 --out cooled.h5
jam --n 24 --phi 0.9,0.92,0.94 --seeds 1:3 --out jam24.h5
jam --n 32 --phi 0.9,0.92,0.94 --seeds 1:3 --out jam32.h5
jam --n 16 --phi 0.9,0.92,0.94 --seeds 3:5 --out jam16.h5
collapse jam16.h5 jam24.h5 jam32.h5 --finite-size --observable pressure --fit phi_J=0.84,y,nu=1,omega=1 --corrections \
--degree 1 --out collapse.h5
flow --n 16 --phi 0.9 --seed 1 --walls --model RD0 --rate 1e-2 --strain 0.5 --discard 0.1 --out flow0.h5"""


def documented():
    """{format: (datasets, attributes)} of DOC, names as patterns; "" for what every result has."""
    found, names = {}, []
    for line in DOC.read_text().splitlines():
        if line.startswith("## "):
            kind, names = (re.search(r"jampetsc-[\w-]+", line) or [""])[0], []
            if kind or line == "## Every result":  # not the folder of a study, which is no file of ours
                found[kind] = ([], [])
        elif line.startswith(("| dataset", "| attribute")):
            names = found[kind][line.startswith("| attribute")]
        elif line.startswith("| `"):
            names += re.findall(r"`([^`]+)`", line.split("|")[1])
    return found


def held(path):
    """(format, datasets, attributes) of a file."""
    datasets = []
    with h5py.File(path) as h5:
        h5.visititems(lambda name, item: datasets.append(name) if isinstance(item, h5py.Dataset) else None)
        return h5.attrs["format"], [n for n in datasets if not n.startswith(GROUP)], list(h5.attrs)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_files_hold_what_the_documentation_says(session, shared_path, monkeypatch, capsys):
    monkeypatch.chdir(shared_path)
    write_packing("p.h5", isostatic())
    for line in RUNS.replace("\\\n", "").splitlines():
        launch.here(line.replace("JAMBASHBULK", str(JAMBASHBULK)))
    doc = documented()
    missing, seen = [], {}
    for path in sorted(shared_path.glob("*.h5")):
        kind, *names = held(path)
        for part in (0, 1):
            known = doc[kind][part] + (doc[""][part] if kind != "jampetsc-packing" or part else [])
            if kind == "jampetsc-quasistatic":
                known += ["no_prestress/*", "no_prestress_*", "beta_scan/no_prestress_eta0"]
            missing += [f"{path.name}: {n}" for n in names[part] if not any(fnmatch(n, k) for k in known)]
            seen.setdefault((kind, part), set()).update(names[part])
    assert not missing, "not in docs/files.md: " + "; ".join(sorted(set(missing)))
    everything = set().union(*(names for (_, part), names in seen.items() if part))
    usual = [name for name in doc[""][1] if name not in RARE[""]]
    gone = [f"{name} of every result" for name in usual if not any(fnmatch(n, name) for n in everything)]
    for (kind, part), names in seen.items():
        patterns = [name for name in doc[kind][part] if name not in RARE.get(kind, ())]
        gone += [f"{name} of {kind}" for name in patterns if not any(fnmatch(n, name) for n in names)]
    assert not gone, "in docs/files.md, but in no file: " + "; ".join(gone)
    assert {kind for kind, _ in seen} == set(doc) - {""}

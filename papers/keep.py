"""Keeps what a figure's study found, without its packings and states: papers/kept/NAME.tar.xz, a few hundred kB.

    .venv/bin/python -m papers.keep figures/bt-fig3-paper [figures/bt-fig5-paper …]

The archive holds the folder of the study with its table and its results, these without what `run/figure NAME --kept`
and -m papers.reproduction do not need: packings, displacements, states to go on from. Of snapshots what a figure
shows of them is kept, by default their six-fold order. Numbers are kept to single precision, the series of steady flows
as means over a hundredth of the run. Every result still names the commit and the command line that made it.
"""

import io
import re
import sys
import tarfile
import tempfile
from collections import defaultdict
from pathlib import Path

import h5py
import numpy as np

from jampetsc.io.disk_motion import STORED_ORDER, six_fold_order
from jampetsc.io.hdf5 import OutputFile, attributes, open_file, set_attributes, store
from jampetsc.io.provenance import recorded_dimension
from jampetsc.io.reader import load
from papers.tables import layers, lifetimes

KEPT = Path(__file__).resolve().parent / "kept"
LEFT_OUT = re.compile(
    r"(no_prestress/)?(state|snapshots/(positions|velocities|cell|images|spins)|fields/|modes$|contacts(/|$)|nonaffine|"
    r"rotation|particles|radii|reduced_tensor)"
)
MOST = 100_000  # numbers of a dataset
ROWS = defaultdict(lambda: 100, {"overdamped-limit": 20})  # of the series of a flow, by figure
EXACT = ("omega", "phi")  # what results are compared or chosen by
TEXTS = ("table.csv", "study.toml", "asked.toml", "forces.csv")
ORDER = STORED_ORDER, six_fold_order
OF_SNAPSHOTS = {  # figure: names of what is kept of the snapshots of a flow, and the function that gives it
    "contact-lifetimes": (lifetimes.STORED, lifetimes.contact_survival),
    "lees-edwards": (layers.STORED, layers.profiles),
}


def slim(source: Path, target: Path, figure="") -> None:
    """A result of a figure at `source` without what takes room, in a file of its own at `target`."""
    with open_file(source) as h5, OutputFile(target) as kept:
        facts = attributes(h5)
        facts["argv"] = re.sub(r"(?<!\S)/\S*/", "", str(facts["argv"]))  # no path of the machine
        set_attributes(kept, facts)
        rows = len(h5["strain"]) if facts["format"] == "jampetsc-flow" else 0
        most = (4 if "velocity_profile" in h5 else 1) * ROWS[figure]  # of walls the start is wanted

        def copy(name, item):
            if isinstance(item, h5py.Dataset) and not LEFT_OUT.match(name) and item.size <= MOST:
                values = item[()]
                if rows > most and values.shape[:1] == (rows,):
                    values = np.array([part.mean(0) for part in np.array_split(values, most)])
                store(kept, name, values if name in EXACT else single(values))

        h5.visititems(copy)
        # six-fold order is of disks in a plane
        if "snapshots/positions" in h5 and (figure in OF_SNAPSHOTS or recorded_dimension(facts) == 2):
            names, of = OF_SNAPSHOTS.get(figure, ORDER)
            for name, values in zip(names, of(load(source)), strict=True):
                store(kept, name, single(values))


def single(values):
    """Floating-point numbers in single precision, others as they are."""
    return values.astype({"f": np.float32, "c": np.complex64}.get(values.dtype.kind, values.dtype))


def keep(folder: Path, to: Path = KEPT) -> Path:
    """Write the archive of a figure's folder; its path."""
    name, _, scale = folder.name.rpartition("-")
    target = to / f"{name}.tar.xz"
    to.mkdir(parents=True, exist_ok=True)
    with tarfile.open(target, "w:xz", preset=9) as archive, tempfile.TemporaryDirectory() as scratch:
        # quick or paper: run/figure NAME draws it as a study of these sizes
        add(archive, "scale", scale.encode())
        for path in sorted(folder.rglob("*")):
            if path.name in TEXTS:
                add(archive, path.relative_to(folder), path.read_bytes())
            elif path.suffix == ".h5" and not path.name.startswith("pack-"):
                small = Path(scratch) / "small.h5"
                slim(path, small, name)
                add(archive, path.relative_to(folder), small.read_bytes())
    return target


def add(archive, name, content) -> None:
    """A file of the archive that carries no trace of the machine."""
    entry = tarfile.TarInfo(str(name))
    entry.size = len(content)
    archive.addfile(entry, io.BytesIO(content))


def main():
    for name in sys.argv[1:]:
        target = keep(Path(name).resolve())
        print(f"{target}: {target.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()

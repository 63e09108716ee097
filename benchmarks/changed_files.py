"""Files of every format, changed in shapes, types, values and attributes, given to the commands that read them.

    python benchmarks/changed_files.py FOLDER [--count 500] [--seed 1] [--only flow]

FOLDER has one file of each format, such as `tests/whole/test_files_doc.py` makes; without --count every change is
tried. A command must draw, write or end with one line of error. What ends in a traceback is listed by its last place,
with an example; what ends the process is found by the last line of FOLDER/changed/log-PROCESS.
"""

import argparse
import collections
import contextlib
import faulthandler
import io
import os
import random
import shutil
import traceback
import warnings
from pathlib import Path

import h5py
import numpy as np

from jampetsc import main as cli
from jampetsc.errors import JampetscError
from jampetsc.io.declaration import contents
from jampetsc.io.reader import load
from jampetsc.studies.study_table import numbers_of

COMMANDS = {  # format -> commands that read its files; packings lie beside them
    "packing": [
        "plot x.h5 --out o.svg", "export x.h5 --out o.vtp", "sweep x.h5 --omega 1 --out o.h5",
        "quasistatic x.h5 --out o.h5", "modes x.h5 --count 3 --out o.h5", "pack --from x.h5 --pressure 1e-2 --out o.h5",
        "flow x.h5 --model RD0 --rate 1e-2 --strain 0.01 --out o.h5", "shear x.h5 --step 1e-3 --strain 2e-3 --out o.h5",
    ],
    "sweep": [
        "plot x.h5 --out o.svg", "plot x.h5 --kind collapse --out o.svg", "plot x.h5 --kind exponents --out o.svg",
        "plot x.h5 --kind fields --out o.svg", "spectrum x.h5 --out o.h5", "correlate x.h5 --out o.h5",
        "export x.h5 --field 1e-3 --out o.xyz",
    ],
    "quasistatic": [f"plot x.h5 --kind {kind} --out o.svg" for kind in
                    ("response", "medians", "viscosities", "finite-size", "exponents")] + ["export x.h5 --out o.xyz"],
    "modes": ["plot x.h5 --out o.svg", "plot x.h5 --kind mode --mode 1,2 --out o.svg",
              "export x.h5 --mode 2 --out o.xyz"],
    "spectrum": ["plot x.h5 --out o.svg"],
    "correlation": ["plot x.h5 --out o.svg", "plot x.h5 --kind length --out o.svg"],
    "oscillate": ["plot x.h5 --out o.svg"],
    "flow": [f"plot x.h5 --kind {kind} --out o.svg" for kind in
             ("flow", "phi", "regimes", "velocities", "snapshot", "order", "profile", "lanes", "start-up")]
            + ["correlate x.h5 --out o.h5", "export x.h5 --out o.xyz", "flow x.h5 --strain 0.02"],
    "shear": [f"plot x.h5 --kind {kind} --out o.svg" for kind in ("strain", "minimum", "fraction", "pressures")],
    "jam": [f"plot x.h5 --kind {kind} --out o.svg" for kind in ("fraction", "pressures", "phi_J")]
           + ["collapse x.h5 jam24.h5 jam32.h5 --finite-size --observable pressure --fit phi_J=0.84,y,nu=1,omega=1 "
              "--degree 1 --out o.h5"],
    "velocity-correlation": ["plot x.h5 --out o.svg"],
    "collapse": ["plot x.h5 --kind scaling --out o.svg", "plot x.h5 --kind branches --out o.svg"],
    "scaling": ["plot x.h5 --out o.svg"],
}  # fmt: skip
COMMON = ["info x.h5", "merge x.h5 --out o.h5", "row x.h5"]  # row: of the table of a study
ONLY_SHOWN = tuple(
    "_version date argv git_commit wall_seconds petsc_options scalar_type ranks run_id".split()
)


def data_changes(array):
    """{name: what is written instead, None: nothing}."""
    array = np.asarray(array)
    flat = np.atleast_1d(array)
    found = {
        "missing": None, "number": np.float64(0.5), "empty": flat[:0], "shorter": flat[:-1], "first": flat[:1],
        "longer": np.concatenate([flat, flat[:1]]), "deeper": array[..., None], "transposed": array.T,
        "text": "nonsense", "texts": np.full(array.shape, b"x"), "complex": array * (1 + 1j), "bool": array != 0,
        "compound": np.zeros(array.shape, [("a", float)]), "long": array.real.astype(np.longdouble),
        "half": array.real.astype(np.float16), "small": np.clip(np.nan_to_num(array.real), -100, 100).astype(np.int8),
        "big-endian": array.astype(array.dtype.newbyteorder(">")), "reversed": flat[::-1], "zero": np.zeros_like(array),
        "negative": -np.abs(array) if array.dtype.kind != "b" else array, "same": np.full_like(array, flat.flat[0])
        if array.size else array,
    }  # fmt: skip
    if array.dtype.kind in "fc":
        for name, value in (("nan", np.nan), ("inf", np.inf), ("huge", 1e300), ("tiny", 1e-300)):
            found[name] = np.full_like(array, value)
            if array.size:
                found[f"one {name}"] = np.where(np.arange(array.size).reshape(array.shape) == 0, value, array)
    if array.dtype.kind == "i":
        found |= {"huge": np.full_like(array, 2**62), "unsigned": np.full(array.shape, 2**64 - 1, np.uint64)}
    return found


ATTRIBUTES = {
    "missing": None, "text": "nonsense", "no text": "", "zero": 0, "negative": -1.5, "nan": np.nan, "inf": np.inf,
    "huge": 1e300, "large": 2**63 - 1, "true": True, "complex": 1 + 1j, "list": [1.0, 2.0], "nothing": h5py.Empty("f"),
    "bytes": np.bytes_(b"\xff\xfe"), "compound": np.zeros((), [("a", float)]), "long": np.longdouble(1.5),
    "escape": "a\x1b[31m\nb", "texts": ["a", "b"], "json": "{}", "number": 0.5,
}  # fmt: skip


def changes(path):
    """Every change of a file: (what, function of the open h5py.File)."""

    def put(name, value):
        def change(h5):
            del h5[name]
            if value is not None:
                h5[name] = value

        return change

    def group(name):
        return lambda h5: (h5.__delitem__(name), h5.create_group(name))

    def claim(name, shape, dtype):
        def change(h5):
            del h5[name]
            h5.create_dataset(name, shape, dtype, chunks=True)

        return change

    def tag(name, value):
        def change(h5):
            del h5.attrs[name]
            if value is not None:
                h5.attrs[name] = value

        return change

    with h5py.File(path) as h5:
        items = contents(h5, path).items()
        data = {name: item[()] for name, item in items if isinstance(item, h5py.Dataset)}
        attrs = list(h5.attrs)
    for name, array in data.items():
        for what, value in data_changes(array).items():
            yield f"{name}: {what}", put(name, value)
        yield f"{name}: group", group(name)
        yield f"{name}: 1e9", claim(name, (10**9, *np.shape(array)[1:]), np.asarray(array).dtype)
    for name in attrs:
        for what, value in ATTRIBUTES.items():
            yield f"@{name}: {what}", tag(name, value)


def attempt(words):
    """The traceback of a command, None where it ends as it should."""
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            cli.dispatch(words) if words[0] != "row" else numbers_of(words[1])
    except JampetscError as error:
        return f"several lines: {error}" if "\n" in str(error) else None
    except BaseException:
        return traceback.format_exc()
    return None


def is_refused(path):
    """Whether nothing can load a file."""
    try:
        load(path)
    except JampetscError:
        return True
    except Exception:  # which the commands report
        return False
    return False


def main():
    """Try the changes and print what went wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="files whose names begin so")
    options = parser.parse_args()
    faulthandler.enable()
    warnings.simplefilter("ignore")
    work = options.folder / "changed" / str(os.getpid())
    work.mkdir(parents=True)
    sources = [path for path in sorted(options.folder.glob("*.h5")) if path.name.startswith(options.only)]
    for source in options.folder.glob("*.h5"):
        shutil.copy(source, work)
    os.chdir(work)
    tried = [(source.name, *one) for source in sources for one in changes(source)]
    if options.count:
        tried = random.Random(options.seed).sample(tried, min(options.count, len(tried)))
    failures, runs = collections.defaultdict(list), 0
    with open(options.folder / "changed" / f"log-{os.getpid()}", "w", buffering=1) as log:
        for name, what, change in tried:
            shutil.copy(name, "x.h5")
            with h5py.File("x.h5", "r+") as h5:
                kind = h5.attrs["format"].removeprefix("jampetsc-")
                try:
                    change(h5)
                except (TypeError, ValueError, OSError):  # which HDF5 itself refuses
                    continue
            shutil.copy("x.h5", "y.h5")
            shown = what.startswith("@") and what.partition(":")[0].endswith(ONLY_SHOWN)
            for line in COMMON if shown or is_refused("x.h5") else [*COMMON, *COMMANDS[kind]]:
                if not Path("x.h5").exists() or line.startswith("flow x.h5 --strain"):
                    shutil.copy("y.h5", "x.h5")
                Path("o.h5").unlink(missing_ok=True)
                print(name, what, line, file=log)
                runs += 1
                if trace := attempt(line.split()):
                    last = trace.strip().splitlines()
                    place = next((one.strip() for one in reversed(last) if "/jampetsc/" in one), last[-1])
                    failures[place.split(", in ")[0]].append((f"{name} {what} | {line}", last[-1], trace))
    count = sum(map(len, failures.values()))
    print(f"{len(tried)} changes, {runs} commands, {count} tracebacks at {len(failures)} places")
    for place, cases in sorted(failures.items(), key=lambda item: -len(item[1])):
        print(f"{len(cases):5d} {place}\n        {cases[0][0]}\n        {cases[0][1][:200]}")
        for case in cases[1:3]:
            print(f"        also {case[0]}")


if __name__ == "__main__":
    main()

"""The examples of every --help run as they are written, at small sizes."""

import re

import launch
import numpy as np
import pytest
from samples import stored
from test_collapse import PHIS, RATES, write_flow
from written_commands import small, small_study

from jampetsc import main as cli
from jampetsc.commands import JOBS, job_class
from jampetsc.studies.study_table import table_text

FIRST = "pack springs sweep modes quasistatic flow shear jam study".split()  # make what the others read
LONG = ("trade", "--corrections")  # have tests of their own
MORE = """\
pack --n 16 --pressure 1e-2 --stabilise shear --out p.h5
pack --n 16 --pressure 1e-2 --stabilise shear --seed 2 --out p2.h5
export p.h5 --out p.dump
sweep p.h5 --out s1e-2.h5
sweep p1e-3.h5 --out s1e-3.h5
sweep p1e-4.h5 --out s1e-4.h5
sweep p.h5 --law stokes --fields 1e-3 --out stokes-1.h5
sweep p2.h5 --law stokes --fields 1e-3 --out stokes-2.h5
quasistatic p1e-3.h5 --out q-p1e-3.h5
quasistatic p1e-4.h5 --out q-p1e-4.h5
flow p.h5 --model RD0 --rate 1e-2 --strain 0.05 --out rd0-1e-2.h5
flow p.h5 --model RD0 --rate 2e-2 --strain 0.05 --out rd0-2e-2.h5
springs --lattice square --size 4 --out plain.h5
export plain.h5 --out gel.data"""


def matched(words, folder):
    """A command line at a size for tests, its patterns as a shell in the folder replaces them."""
    found = [
        sorted(path.name for path in folder.glob(word)) if "*" in word else [word] for word in small(words)
    ]
    return [name for some in found for name in some]


@pytest.mark.parametrize("command", ["", *JOBS])
def test_every_help_has_an_example(command):
    parser, parsers = cli.command_parser([command] if command else ["--help"])
    text = (parsers.choices[command] if command else parser).format_help()
    lines = launch.command_lines(text[text.index("\nexamples:\n") :])
    assert not command or command in [words[0] for words in lines]
    for words in lines:
        if set(words) & set(LONG):
            cli.command_parser(words)[0].parse_args(words)


def write_scaled(folder):
    """Flows and samples whose collapse is known, which a fit to so small ones would not tell."""
    (folder / "flows").mkdir()
    rows = []
    for name, phi, rate in ((f"{phi}-{rate:.3g}.h5", phi, rate) for phi in PHIS[1:6] for rate in RATES[:5]):
        write_flow(folder / "flows" / name, phi, rate)
        rows.append({"command": "flow", "state": "done", "file": name, "seconds": 0.1, "model": "RD0"})
    (folder / "flows" / "table.csv").write_text(table_text(rows))
    for number, rate in enumerate(RATES):
        write_flow(folder / f"r-{number}.h5", 0.86, rate, n=16)
    rng = np.random.default_rng(1)
    for n in (64, 128, 256):
        phi = np.repeat(np.linspace(0.83, 0.85, 9), 200)
        jammed = rng.random(phi.size) < 1 / (1 + np.exp(-30 * (phi - 0.841) * n**0.5))
        columns = {"phi": phi, "jammed": 1.0 * jammed, "pressure": 1e-3 * jammed, "seed": np.arange(phi.size)}
        facts = {"protocol": "random", "sizes": "bidisperse", "potential": "harmonic", "k": 1.0}
        facts |= {"stiffness": "constant", "units": "smallest diameter"}
        stored(folder / f"jam-{n}.h5", "jam", columns, particle_count=n, **facts)


@pytest.mark.allowed_seconds(900)
def test_the_examples_run(tmp_path):
    """Twelve seconds of a processor, for sixty commands and a dozen pictures."""
    folder, lines = tmp_path, {command: launch.command_lines(job_class(command).EPILOG) for command in JOBS}
    order = [words for command in FIRST for words in lines.pop(command)]
    order += [words for some in lines.values() for words in some if not set(words) & set(LONG)]
    study = re.search(r"(?:^  [\[a-z].*\n)+", job_class("study").EPILOG, re.MULTILINE)[0]
    (folder / "STUDY.toml").write_text(small_study(study))
    write_scaled(folder)
    packs = [matched(words, folder) for words in order if words[0] == "pack"]
    launch.run_lines(folder, packs + [line.split() for line in MORE.splitlines()])
    text = (folder / "p.dump").read_text()
    (folder / "dump.lammpstrj").write_text(2 * text)
    (folder / "types.lammpstrj").write_text(text)
    (folder / "sizes.lammpstrj").write_text(text.replace(" radius ", " Dn "))
    rows = text.partition("ITEM: ATOMS")[2].splitlines()[1:]
    np.savetxt(folder / "table.txt", np.loadtxt(rows, usecols=(0, 2, 3, 5)))
    np.savetxt(folder / "disks.txt", np.loadtxt(rows, usecols=(2, 3, 5)))
    (folder / "nodes.txt").write_text("0 0\n1 0\n1 1\n")
    (folder / "bonds.txt").write_text("0 1 1.0\n1 2 2.0\n")
    rest = [matched(words, folder) for words in order if words[0] != "pack"]
    pictures = [words for words in rest if words[0] == "plot"]
    assert len(pictures) > 10
    launch.run_lines(folder, [words for words in rest if words not in pictures] + pictures)
    for words in packs + rest:
        if "--out" in words and "{" not in words[words.index("--out") + 1]:
            assert (folder / words[words.index("--out") + 1]).exists(), words

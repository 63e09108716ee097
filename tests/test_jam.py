"""`jampetsc jam`: samples that are what `pack` would make, the same on any number of ranks and after a kill."""

import launch
import numpy as np
import pytest

import jampetsc
from jampetsc import cli
from jampetsc.commands import jam
from jampetsc.errors import InputError
from jampetsc.flow import record
from jampetsc.flow.slowly import ENERGY_CUT

WORDS = "jam --n 32 --phi 0.82,0.86 --seeds 3:8 --out"


def run(out, *more):
    """A command within a process that has PETSc already."""
    words = [*WORDS.split(), str(out), *map(str, more)]
    args = cli.command_parser(words)[0].parse_args(words)
    assert args.run(args, []) == 0
    return jampetsc.load(out)


@pytest.mark.scalar("real")
def test_the_file(session, shared_path, capsys):
    result = run(shared_path / "jam.h5")
    assert np.array_equal(result["phi"], np.repeat([0.82, 0.86], 6))
    assert np.array_equal(result["seed"], np.tile(np.arange(3, 9), 2))
    jammed, energy, pressure = (result[name] for name in ("jammed", "energy", "pressure"))
    assert np.array_equal(jammed == 1, energy > ENERGY_CUT)
    dense = result["phi"] > 0.85
    assert jammed[dense].mean() > 0.5 > jammed[~dense].mean()
    assert (pressure[jammed == 1] > 0).all()
    # harmonic: U = Σ f δ/2, so that a pressure goes with its energy; and Z is isostatic or more
    assert (result["coordination"][dense & (jammed == 1)] > 3.2).all()
    if session.rank == 0:
        text = capsys.readouterr().out
        assert f"phi = 0.86: jammed {jammed[dense].mean():.3f}" in text


@pytest.mark.scalar("real")
def test_a_killed_run_goes_on(session, tmp_path, monkeypatch):
    if session.size > 1:
        pytest.skip("looks at one process")
    whole = run(tmp_path / "whole.h5")
    monkeypatch.setattr(jam, "ROUND", 5)
    save = record.write_checkpoint

    def save_and_stop(*what):
        save(*what)
        raise KeyboardInterrupt

    monkeypatch.setattr(record, "write_checkpoint", save_and_stop)
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "out.h5")
    monkeypatch.setattr(record, "write_checkpoint", save)
    parts = run(tmp_path / "out.h5")
    assert np.array_equal(whole["energy"], parts["energy"])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.h5", "whole.h5"]


def test_ranks_share_the_samples(tmp_path):
    results = []
    for ranks in (0, 2):
        out = tmp_path / f"{ranks}.h5"
        done = launch.run(ranks, "../jampetsc/__main__.py", *WORDS.split(), out)
        assert done.returncode == 0, done.stderr
        results.append(jampetsc.load(out))
    assert np.array_equal(results[0]["seed"], results[1]["seed"])
    assert np.allclose(results[0]["energy"], results[1]["energy"], rtol=1e-6, atol=1e-20)


@pytest.mark.scalar("real")
def test_bad_words(session, shared_path):
    for more, message in [
        (("--phi", "1.2"), "must lie in"),
        (("--phi", "a:b"), "write A:B:M"),
        (("--phi", "0.8:0.9:0"), "write A:B:M"),
        (("--seeds", "5:1"), "FIRST:LAST"),
        (("--seeds", "5"), "FIRST:LAST"),
        (("--seeds", "0:10000000"), "at most"),
        (("--n", "2"), "must lie in"),
        (("--tolerance", "1"), "must lie in"),
    ]:
        with pytest.raises(InputError, match=message):
            run(shared_path / "out.h5", *more)
    assert not list(shared_path.iterdir())

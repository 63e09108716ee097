"""`jampetsc shear`: minima along a quasistatic path, what the file holds, and going on after a kill."""

import numpy as np
import pytest

import jampetsc
from jampetsc import cli
from jampetsc.contacts.state import measure
from jampetsc.errors import InputError
from jampetsc.flow import slowjob
from jampetsc.flow.slowly import ENERGY_CUT

WORDS = "shear --n 64 --phi {phi} --seed 2 --step {step} --strain {strain}"


def shear(out, *more, phi=0.86, step=1e-3, strain=0.06):
    """A command within a process that has PETSc already."""
    words = [*WORDS.format(phi=phi, step=step, strain=strain).split(), "--out", str(out), *map(str, more)]
    args = cli.command_parser(words)[0].parse_args(words)
    assert args.run(args, []) == 0
    return jampetsc.load(out)


@pytest.fixture
def alone(session):
    if session.size > 1:
        pytest.skip("one run is one process")


@pytest.mark.scalar("real")
def test_energy_grows_by_the_work_of_the_stress(alone, session, tmp_path):
    """dU/dγ = V σ along minima, but where disks rearrange; and every state is a minimum."""
    last = tmp_path / "last.h5"
    result = shear(tmp_path / "qs.h5", "--last", last)
    strain, energy, stress = (result[name] for name in ("strain", "energy", "shear_stress"))
    assert np.allclose(strain, 1e-3 * np.arange(1, 61))
    disks = jampetsc.load(last)
    work = disks.area * 0.5 * (stress[1:] + stress[:-1]) * 1e-3
    off = np.abs(np.diff(energy) - work) / np.abs(np.diff(energy)).max()
    assert np.median(off) < 1e-3
    state = measure(disks)
    assert state.max_force < 1e-6 * state.pressure * 1.3
    assert state.energy == pytest.approx(energy[-1], rel=1e-9)
    assert state.pressure == pytest.approx(result["pressure"][-1], rel=1e-9)
    assert disks.cell[1, 0] / disks.cell[1, 1] == pytest.approx(0.06)
    assert result["jammed"].all() and (result["nonaffine"] > 0).all()
    facts = result.attributes
    kept = strain > 0.03 * (1 + 1e-12)
    assert facts["pressure_mean"] == pytest.approx(result["pressure"][kept].mean())
    assert facts["energy_cut"] == ENERGY_CUT and facts["discard"] == 0.03


@pytest.mark.scalar("real")
def test_disks_below_jamming_have_no_energy(alone, session, tmp_path):
    result = shear(tmp_path / "qs.h5", phi=0.80, step=1e-2, strain=0.2)
    loose = result["jammed"] == 0
    assert loose.any() and (result["energy"][loose] <= 64 * ENERGY_CUT).all()
    assert result.attributes["jammed_mean"] < 1


@pytest.mark.scalar("real")
def test_a_killed_run_goes_on_to_the_last_bit(alone, session, tmp_path, monkeypatch):
    whole = shear(tmp_path / "whole.h5", strain=0.02)
    monkeypatch.setattr(slowjob, "INTERVAL", -1.0)
    save, saved = slowjob.write_checkpoint, []

    def save_and_stop(*what):
        save(*what)
        saved.append(what)
        if len(saved) == 7:
            raise KeyboardInterrupt

    monkeypatch.setattr(slowjob, "write_checkpoint", save_and_stop)
    with pytest.raises(KeyboardInterrupt):
        shear(tmp_path / "out.h5", strain=0.02)
    assert not (tmp_path / "out.h5").exists()
    parts = shear(tmp_path / "out.h5", strain=0.02)
    assert len(saved) == 20 and not (tmp_path / "out.h5.resume").exists()
    for name in ("energy", "shear_stress", "nonaffine"):
        assert np.array_equal(whole[name], parts[name])


@pytest.mark.scalar("real")
def test_bad_words(alone, session, tmp_path):
    for given, more, message in [
        ({"step": 0}, (), "must lie in"),
        ({"step": 0.2}, (), "must lie in"),
        ({"strain": 1e-4}, (), "must lie in"),
        ({"phi": 1.2}, (), "must lie in"),
        ({}, ("--discard", 0.06), "must lie in"),
        ({}, ("--tolerance", 1), "must lie in"),
    ]:
        with pytest.raises(InputError, match=message):
            shear(tmp_path / "out.h5", *more, **given)
    assert not list(tmp_path.iterdir())

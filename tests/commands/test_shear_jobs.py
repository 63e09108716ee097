"""Flow, shear and jam as jobs: what they are made of, and the runs they ask for."""

import inspect

import numpy as np
import pytest
from samples import published
from sheared import crowd

import jampetsc
from jampetsc.commands import jam
from jampetsc.commands.flow import Flow
from jampetsc.commands.jam import Jam
from jampetsc.commands.shear import Shear
from jampetsc.errors import InputError
from jampetsc.io.packing_file import read_identified, write_packing
from jampetsc.laws import flow_models as models
from jampetsc.laws.damping import ContactDamping, Law
from jampetsc.minimisation.minimise import settle
from jampetsc.minimisation.protocols import random_start
from jampetsc.minimisation.sizes import radii_of
from jampetsc.options import starts
from jampetsc.options.parameters import build_job
from jampetsc.packing.packing import MINIMISED_PHIS, PARTICLES

NAN, INF, LAST = float("nan"), float("inf"), 2**63 - 1
FLOW = {"n": 16, "phi": 0.8, "model": "RD0", "rate": 1e-2, "strain": 0.5}
SHEAR = {"n": 16, "phi": 0.8, "step": 0.01, "strain": 1.0}
JAM = {"n": 16, "phi": 0.84, "seeds": "1:2"}
QS = JAM | {"protocol": "shear"}
COOL = JAM | {"protocol": "compress"}


def test_a_seventh_model_is_one_row(monkeypatch):
    """Model and message follow from the table."""
    monkeypatch.setitem(models.MODELS, "RDt", (Law("drag and sliding", drag=1.0, transverse=1.0), True))
    model = models.model_of("RDt", mass=2.0, tau1=3.0)
    assert (model.name, model.mass, model.law.transverse, model.law.tau1) == ("RDt", 2.0, 1.0, 3.0)
    with pytest.raises(InputError, match=r"RDt: no mass\. Give a positive mass or quality"):
        models.model_of("RDt")


def test_functions_of_models_have_the_options_of_their_model():
    functions = {name: getattr(jampetsc.models, name) for name in models.MODELS}
    signatures = {name: set(inspect.signature(model).parameters) for name, model in functions.items()}
    massive, background_drag = {"mass", "quality"}, {"background_drag"}
    assert signatures == {
        "RD0": {"tau1"}, "CD0": {"tau1"} | background_drag, "RD": {"tau1"} | massive,
        **{name: {"tau1"} | massive | background_drag for name in ("CD", "CDn", "CDt")},
    }  # fmt: skip
    with pytest.raises(TypeError):
        jampetsc.models.RD0(mass=1.0)
    with pytest.raises(InputError, match="CDn: no mass"):
        jampetsc.models.CDn()


def test_a_model_may_be_given_in_several_ways():
    """By name, by options, as an object or as a law: the same job, which its settings make again."""
    own = {"n": 16, "phi": 0.7, "rate": 1e-2, "strain": 0.5}
    law = {"law": "contact", "rotations": False, "beta": 0.5, "tau1": 2.0, "background_drag": 0.125}
    damping = models.Model(ContactDamping(0.5, rotations=False, tau1=2.0), background_drag=0.125)
    for options, model in (
        ({"model": "CD", "quality": 0.1}, jampetsc.models.CD(quality=0.1)),
        ({"model": "CD0"}, "CD0"),
        (law, damping),
        ({"law": "stokes", "rotations": True}, jampetsc.StokesDrag()),
    ):
        one, other = build_job(Flow, own | options), Flow(**own, model=model)
        assert one.settings() == other.settings() and one.model == other.model
        assert build_job(Flow, one.settings()).model == one.model
        assert ("--no-rotations" in one.line()) == (model is damping)


def test_a_run_has_the_parameters_of_its_job():
    plain = {"n": 16, "phi": 0.8, "rate": 1e-2, "strain": 0.5}
    damping = models.Model(ContactDamping(tau1=2.0), mass=3.0, background_drag=0.125)
    chosen = {"tolerance": 1e-6, "step": 0.02, "snapshots": 3, "discard": 0.125}
    flow, other = (jampetsc.flow(**plain, model=damping, **more) for more in ({}, chosen))
    for result, facts in ((flow, {"discard": 0.25, "tolerance": 1e-4}), (other, chosen)):
        facts = facts | {"rate": 1e-2, "mass": 3.0, "background_drag": 0.125, "tau1": 2.0}
        facts.pop("snapshots", None)
        assert {name: result.attributes[name] for name in facts} == facts
        assert result["strain"][-1] == pytest.approx(0.5, rel=0.05)
    assert "snapshots/strain" not in flow and len(other["snapshots/strain"]) == 3
    assert other["snapshots/strain"][0] > 0.125


@pytest.mark.parametrize("seed", [None, 0, 3])
def test_a_random_start_is_that_of_its_seed(seed):
    disks, origin = Flow(**FLOW, seed=seed).disks()
    assert origin == {"seed": 1 if seed is None else seed, "sizes": "bidisperse", "units": starts.UNITS}
    radii = radii_of("bidisperse", 16)
    again = random_start(radii * (0.5 / radii.min()), 0.8, origin["seed"], disks.potential)
    assert settle(again, starts.RELAXED_START_FORCE).fingerprint == disks.fingerprint
    assert disks.radii.min() == 0.5 and disks.potential.kind == "harmonic" and disks.phi == pytest.approx(0.8)
    other, _ = Shear(**SHEAR, seed=2, potential="hertzian").disks()
    assert other.potential.kind == "hertzian" and not np.allclose(other.positions, disks.positions)


def test_radii_of_ones_own_keep_their_unit():
    job = Shear(phi=0.8, radii=np.linspace(1.0, 2.0, 20), step=0.01, strain=0.1)
    disks, origin = job.disks()
    assert np.allclose(np.sort(disks.radii), np.linspace(1.0, 2.0, 20))
    assert origin["units"] == starts.OWN_UNITS


def test_the_origin_of_disks_between_walls_has_the_number_of_wall_disks():
    disks, origin = Flow(**FLOW | {"n": 32, "phi": 0.5, "walls": True}).disks()
    assert 0 < origin["walls"] < disks.n and disks.n >= 32


def test_the_origin_of_a_packing_has_its_checksum(tmp_path):
    write_packing(tmp_path / "p.h5", published())
    disks, origin = Flow(tmp_path / "p.h5", "RD0", rate=1e-2, strain=0.02).disks()
    _, (name, digest) = read_identified(tmp_path / "p.h5")
    assert origin == {"packing": name, "packing_sha256": digest, "units": "those of the packing"}
    assert disks.fingerprint == published().fingerprint


def test_a_result_in_memory_leaves_no_files(tmp_path, monkeypatch):
    """A flow in memory is continued like its file, to the last bit, and its last state is a packing."""
    monkeypatch.chdir(tmp_path)
    job = {"model": jampetsc.models.CDn(mass=1.0), "rate": 1e-2, "discard": 0.1}
    one = jampetsc.flow(n=16, phi=0.86, strain=0.3, snapshots=2, **job)
    farther = jampetsc.flow(one, strain=0.3)
    assert not list(tmp_path.iterdir())
    assert len(farther["snapshots/strain"]) == 4 and len(one["snapshots/strain"]) == 2
    one.save(tmp_path / "one.h5")
    from_file = jampetsc.flow(one, strain=0.3)
    assert [path.name for path in tmp_path.iterdir()] == ["one.h5"]
    for name in ("strain", "shear_stress", "energy"):
        assert np.array_equal(farther[name], from_file[name])
    assert farther.last.fingerprint == from_file.last.fingerprint
    for other in (farther, jampetsc.load("one.h5")):
        with pytest.raises(InputError, match=r"which is continued\. Leave it out"):
            jampetsc.flow(other, "RD0", strain=0.1, rate=0.1)
    with pytest.raises(InputError, match=r"one\.h5: a jampetsc-flow file"):
        jampetsc.shear("one.h5", step=0.1, strain=0.1)


def test_the_last_state_of_a_result_is_where_the_disks_are_at_the_end(tmp_path):
    job = {"n": 16, "phi": 0.86, "model": jampetsc.models.RD0(), "rate": 1e-2, "strain": 0.1}
    flow = jampetsc.flow(**job, last=tmp_path / "last.h5")
    assert flow["state/list_age"] > 0  # steps after the last list of neighbours
    assert flow.last.fingerprint == jampetsc.load(tmp_path / "last.h5").fingerprint


def test_samples_have_the_parameters_of_their_job():
    asked = Jam(n=16, phi="0.8:0.84:3", seeds="4:5")
    assert asked.phi == pytest.approx([0.8, 0.82, 0.84]) and list(asked.seeds) == [4, 5]
    assert asked.made_protocol.name == "random" and asked.made_protocol.rows == 1 and asked.count == 6
    one = {"n": 16, "phi": [0.85, 0.8, 0.8], "seeds": "0:0"}
    asked = Jam(**one, protocol="shear", step=0.01, strain=2, every=0.25)
    assert asked.phi.tolist() == [0.8, 0.85] and asked.count == 8
    protocol = asked.made_protocol
    assert (protocol.step, protocol.strain, protocol.discard, protocol.every) == (0.01, 2.0, 1.0, 0.25)
    protocol = Jam(**one, protocol="compress", temperature=1e-2, sweeps=0).made_protocol
    assert (protocol.temperature, protocol.cooling_rate, protocol.sweeps) == (1e-2, 1e-2, 0)
    Jam(**one, protocol="shear", step=0.1, every=0.3 - 0.2)  # a step but for rounding
    job = Jam(n=16, phi="0.8:0.84:3", seeds="4:5")
    assert job.settings()["phi"] == "0.8:0.84:3"
    assert build_job(Jam, job.settings()).settings() == job.settings()


def test_the_limit_of_samples_counts_all_rows_of_a_seed(monkeypatch):
    monkeypatch.setattr(jam, "MAX_SAMPLES", 6)
    Jam(n=16, phi=[0.8, 0.9], seeds="1:3")
    Jam(n=16, phi=0.8, seeds="1:2", protocol="shear", strain=1.06)
    for given in ({"seeds": "1:7"}, {"phi": "0.8:0.9:4"}, {"protocol": "shear"}):
        with pytest.raises(InputError, match=r"samples \(at most 6 in one result\)"):
            Jam(**JAM | given)


@pytest.mark.parametrize(
    "more",
    [
        {"n": 17}, {"phi": 0.85}, {"seeds": "1:3"}, {"sizes": "monodisperse"}, {"potential": "hertzian"},
        {"tolerance": 1e-7}, QS, COOL, QS | {"step": 0.002}, QS | {"strain": 3}, QS | {"discard": 0.5},
        QS | {"every": 0.03}, COOL | {"temperature": 0.01}, COOL | {"cooling_rate": 0.1}, COOL | {"sweeps": 7},
        {"separated": True},
    ],
)  # fmt: skip
def test_a_checkpoint_of_samples_serves_only_the_same_job(more):
    plain = {name: value for name, value in (JAM | more).items() if name in ("protocol", *JAM)} | JAM
    settings = [Jam(**given).settings() for given in (JAM | more, plain)]
    assert settings[0] != settings[1] or more.keys() <= plain.keys()
    assert Jam(**JAM | more).settings() != Jam(**JAM).settings()
    assert Jam(**JAM, sizes="bidisperse", tolerance=1e-6).settings() == Jam(**JAM).settings()


def test_a_message_names_a_refused_start_without_its_arrays():
    with pytest.raises(InputError, match="<16 disks>: a packing, not a flow"):
        jampetsc.flow(crowd(16), strain=1.0)


def test_summaries_say_what_random_particles_are():
    """Their sizes, stiffness and units, which are not those of `pack`; nothing of a packing that is given."""
    disks, origin = Flow(**FLOW, sizes="lognormal:0.2").disks()
    (line,) = starts.random_particles_lines(origin)
    assert "lognormal:0.2" in line and starts.UNITS in line and disks.potential.stiffness in line
    assert origin["sizes"] == "lognormal:0.2" and disks.radii.min() == 0.5
    assert starts.random_particles_lines({"packing": "p.h5", "units": "those of the packing"}) == []


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_minimum_out_of_range_says_what_to_do(dimension):
    """In the words of a function that keeps the packing fraction, for this dimension."""
    low, high = MINIMISED_PHIS[dimension]
    corners = np.indices((3,) * dimension).reshape(dimension, -1).T
    for factor in (0.6, 1.5):
        disks = jampetsc.Packing(corners, np.full(3**dimension, 0.5 * factor), 3.0)
        words = rf"^phi = .*: minimise keeps it, and it must lie in \[{low:g}, {high:g}\] for {PARTICLES[dimension]}\. "
        with pytest.raises(
            InputError, match=words + r"To change it call jampetsc\.pack\(from_=packing, phi=…\)\.$"
        ):
            jampetsc.minimise(disks)

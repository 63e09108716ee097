"""The identity of a job: what belongs to it and what does not, however the job is asked for."""

import json
import os
from dataclasses import replace

import h5py
import launch
import numpy as np
import pytest
from samples import published

import jampetsc
from jampetsc import ContactDamping, Law, StokesDrag, models
from jampetsc.commands import JOBS, job_class
from jampetsc.commands.collapse import Collapse
from jampetsc.commands.correlate import Correlate
from jampetsc.commands.flow import Flow
from jampetsc.commands.jam import Jam
from jampetsc.commands.modes import Modes
from jampetsc.commands.oscillate import Oscillate
from jampetsc.commands.pack import Pack
from jampetsc.commands.quasistatic import Quasistatic
from jampetsc.commands.relax import Relax
from jampetsc.commands.shear import Shear
from jampetsc.commands.springs import Springs
from jampetsc.commands.sweep import Sweep
from jampetsc.errors import InputError
from jampetsc.io import request
from jampetsc.io.outlet import Outlet
from jampetsc.io.packing_file import write_packing
from jampetsc.io.request import Request
from jampetsc.options.parameters import parameters
from jampetsc.studies.plan import plan
from jampetsc.studies.study_table import table_text
from jampetsc.version import FORMAT_VERSION


def digest(asked):
    """The digest of a job, or of the one that a command line asks for."""
    return Request(launch.asked(asked.split())[0] if isinstance(asked, str) else asked).digest


SAME = [  # each: ways to ask for one job, on a command line or in python
    ["sweep p.h5 --out s.h5", "sweep p.h5 --out other.h5", "sweep p.h5 --out s.h5 --quiet", Sweep("p.h5"),
     "sweep p.h5 --out s.h5 --overwrite", "sweep p.h5 --out s.h5 --parallel matrix",  # as the number of ranks
     "sweep p.h5 --out s.h5 --law contact --beta 1 --normal 1.0 --tau1 1 --load xy --method rational --accuracy 1e-6",
     Sweep("p.h5", ContactDamping(beta=1)), Sweep("p.h5", "contact", omega=np.geomspace(1e-10, 1e4, 141))],
    ["sweep p.h5 --out s.h5 --beta 1e-2 --omega 1e-2,1", "sweep p.h5 --out s.h5 --omega 1.0,0.01,1 --beta 0.01",
     Sweep("p.h5", ContactDamping(beta=np.float64(0.01)), omega=[1, 1e-2])],
    ["sweep p.h5 --out s.h5 --law stokes --eta-f 2", Sweep("p.h5", StokesDrag(2)), Sweep("p.h5", StokesDrag(2.0))],
    ["sweep p.h5 --out s.h5 --law custom --normal 2 --drag 1", Sweep("p.h5", Law("mine", normal=2, drag=1.0))],
    ["sweep p.h5 --out s.h5 --no-prestress", Sweep("p.h5", prestress=False)],
    ["sweep p.h5 --out s.h5 --load 1,0,0,0", "sweep p.h5 --out s.h5 --load 1e0,0.0,0,0",
     Sweep("p.h5", load=[[1, 0], [0, 0]])],
    ["pack --n 16 --pressure 1e-2 --out p.h5", "pack --n 1.6e1 --pressure 0.01 --out q.h5 --threads 3",
     "pack --n 16 --pressure 1e-2 --seed 1 --dimension 2 --potential harmonic --stiffness constant --sizes bidisperse "
     "--stabilise volume --tolerance 1e-10 --out p.h5", Pack(n=16, pressure=1e-2),
     Pack(n=16.0, pressure="0.01", seed=1)],
    ["flow --n 16 --phi 0.8 --model RD0 --rate 1e-2 --strain 1 --out f.h5", "flow --n 16 --phi 0.80 --model RD0 --rate "
     "0.01 --strain 1.0 --out f.h5 --threads 2 --last l.h5 --seed 1 --potential harmonic --discard 0.5 "
     "--dimension 2 --tolerance 1e-4 --tau1 1 --sizes bidisperse",
     "flow --n 16 --phi 0.8 --model RD0 --rate 1e-2 --strain 1 --snapshots 0 --out f.h5",
     Flow(n=16, phi=0.8, model=models.RD0(), rate=0.01, strain=1)],
    ["flow p.h5 --model CDn --mass 1 --rate 1e-2 --strain 4 --discard 1 --out f.h5",
     Flow("p.h5", models.CDn(mass=1), rate=0.01, strain=4.0)],
    ["flow f.h5 --strain 20", "flow f.h5 --strain 2e1 --threads 2 --last l.h5", Flow("f.h5", strain=20)],
    ["shear p.h5 --step 1e-3 --strain 2 --out s.h5", "shear p.h5 --step 0.001 --strain 2 --discard 1 --tolerance 1e-6 "
     "--threads 1 --last l.h5 --out s.h5", Shear("p.h5", step=1e-3, strain=2)],
    ["jam --n 16 --phi 0.5:1:3 --seeds 1:3 --protocol shear --out j.h5", "jam --n 16 --phi 1,0.75,0.5 --seeds 1,2,3 "
     "--protocol shear --step 1e-3 --strain 2 --discard 1 --every 0.02 --dimension 2 --out j.h5",
     Jam(n=16, phi=[0.5, 0.75, 1.0], seeds=range(1, 4), protocol="shear")],
    *([f"{job} {words}" for words in both] for both in (
        ("--potential harmonic", "--potential power --exponent 2"),
        ("--potential hertzian", "--potential power --exponent 2.5")) for job in (
        "pack --n 16 --phi 0.9 --out p.h5", "jam --n 16 --phi 0.9 --seeds 1 --out j.h5",
        "shear --n 16 --phi 0.9 --step 1e-3 --strain 1 --out s.h5")),
    ["jam --n 16 --phi 0.8 --seeds 1:1 --protocol compress --out j.h5", "jam --n 16 --phi 0.8 --seeds 1 --protocol "
     "compress --temperature 1e-3 --cooling-rate 1e-2 --sweeps 200 --out j.h5"],
    ["oscillate p.h5 --omega 1 --strain 1e-6 --contacts moving --out o.h5", "oscillate p.h5 --omega 1 --strain 1e-6 "
     "--contacts moving --cycles auto --alpha 1 --steps 64 --out o.h5",
     Oscillate("p.h5", omega=1, strain=[1e-6], contacts="moving")],
    ["relax p.h5 --strain 1e-3,1e-2 --out r.h5", "relax p.h5 --strain 1e-3:1e-2:2 --accuracy 1e-3 --load xy --out r.h5",
     Relax("p.h5", strain=[1e-2, 1e-3])],
    ["modes p.h5 --out m.h5", "modes p.h5 --count 50 --out m.h5", Modes("p.h5", count=50)],
    ["quasistatic p.h5 --betas 0.1,1 --out q.h5", Quasistatic("p.h5", betas=[1, 0.1])],
    ["springs --lattice triangular --out n.h5", "springs --lattice triangular --size 32 --keep 1 --seed 1 --out n.h5",
     Springs(lattice="triangular")],
    ["correlate s.h5 --out c.h5", "correlate s.h5 --phase stress --out c.h5", Correlate(["s.h5"])],
]  # fmt: skip
DIFFERENT = [  # each: jobs of which no two have the same result
    [f"sweep p.h5 --out s.h5 {words}" for words in (
        "", "--omega 1", "--omega 1,2", "--beta 0.5", "--tau1 2", "--normal 2", "--no-rotations", "--law stokes",
        "--law custom --normal 1 --sliding 1", "--no-prestress", "--accuracy 1e-5", "--method direct", "--load yx",
        "--load tensor", "--fields 1", "--fields 1,2", "--alpha 0.5 --stress 1e-5", "--alpha 0.6 --stress 1e-5",
        "--alpha 0.5 --stress 2e-5")],
    [f"oscillate p.h5 --out o.h5 --omega 1 {words}" for words in (
        "--strain 1e-5", "--strain 1e-4", "--stress 1e-5", "--strain 1e-5 --omega 2", "--strain 1e-5 --steps 16",
        "--strain 1e-5 --alpha 0.5", "--strain 1e-5 --beta 0.5", "--strain 1e-5 --no-prestress",
        "--strain 1e-5 --load xx", *(f"--strain 1e-5 --contacts moving {cycles}" for cycles in (
            "", "--cycles 3", "--cycles 4")))],
    [f"relax p.h5 --out r.h5 {words}" for words in (
        "--strain 1e-3", "--strain 1e-2", "--strain 1e-3 --times 1,2", "--strain 1e-3 --accuracy 1e-2",
        "--strain 1e-3 --law stokes", "--strain 1e-3 --tau1 2", "--strain 1e-3 --load xx")],
    [f"pack --out p.h5 {words}" for words in (
        "--n 16 --phi 0.9", "--n 17 --phi 0.9", "--n 16 --phi 0.91", "--n 16 --pressure 0.9",
        "--n 16 --phi 0.9 --seed 2",
        "--n 16 --phi 0.9 --dimension 3", "--n 16 --phi 0.9 --potential hertzian",
        "--n 16 --phi 0.9 --potential power --exponent 3", "--n 16 --phi 0.9 --potential power --exponent 4",
        "--n 16 --phi 0.9 --stiffness inverse-square-diameter", "--n 16 --phi 0.9 --sizes monodisperse",
        "--n 16 --phi 0.9 --stabilise shear", "--n 16 --phi 0.9 --tolerance 1e-9", "--from p0.h5 --phi 0.9",
        "--radii r.txt --phi 0.9")],
    ["flow --n 16 --phi 0.8 --model RD0 --rate 1e-2 --strain 4 --out f.h5 " + words for words in (
        "", "--n 17", "--phi 0.81", "--model CD0", "--rate 2e-2", "--strain 5", "--discard 2", "--snapshots 3",
        "--snapshots 3 --snapshot-spacing log", "--snapshot-every 1", "--series 1e-3", "--step 0.01",
        "--tolerance 1e-6", "--walls", "--seed 2", "--potential hertzian", "--sizes monodisperse", "--dimension 3",
        "--tau1 2")]
    + ["flow f.h5 --strain 4", "flow f.h5 --strain 5"],  # what a flow has had is in its file
    ["shear p.h5 --step 1e-3 --strain 4 --out s.h5 " + words for words in (
        "", "--step 2e-3", "--strain 5", "--discard 2", "--tolerance 1e-7")],
    ["jam --n 16 --phi 0.8 --seeds 1:3 --out j.h5 " + words for words in (
        "", "--n 17", "--phi 0.81", "--seeds 1:2", "--protocol shear", "--protocol shear --strain 3", "--separated",
        "--protocol compress", "--protocol compress --sweeps 100", "--tolerance 1e-7", "--dimension 3")],
    ["scaling f.h5 --out s.h5 " + words for words in (
        "", "--form bingham", "--form power-law", "--by phi", "--by phi,n", "--cut 0.1", "--cut 0.2")],
    ["modes p.h5 --out m.h5 " + words for words in (
        "", "--count 3", "--below 0.1", "--all", "--no-eigenvectors", "--no-prestress", "--load xx")],
]  # fmt: skip


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The working directory, with a file of radii and a packing."""
    monkeypatch.chdir(tmp_path)
    np.savetxt("r.txt", np.linspace(0.5, 0.7, 16))
    write_packing("p.h5", published())
    return tmp_path


@pytest.mark.parametrize("ways", SAME, ids=lambda ways: str(ways[0]))
def test_one_job_has_one_digest_however_it_is_asked_for(here, ways):
    """Written otherwise, defaults spelled out, in python; whatever it prints, writes besides, and works on."""
    settings = [
        Request(launch.asked(way.split())[0] if isinstance(way, str) else way).settings for way in ways
    ]
    assert all(other == settings[0] for other in settings), settings


@pytest.mark.parametrize("asked", DIFFERENT, ids=lambda asked: asked[0])
def test_jobs_with_other_results_have_other_digests(here, asked):
    assert len(set(map(digest, asked))) == len(asked)


def test_every_parameter_belongs_to_the_identity_but_for_these():
    """A new one does until it is declared otherwise."""
    apart = {
        (name, parameter)
        for name in JOBS
        for parameter, declared in parameters(job_class(name)).items()
        if not declared.in_identity
    }
    assert apart == {
        *(("pack", "threads"), ("sweep", "parallel")),
        *((name, parameter) for name in ("flow", "shear") for parameter in ("threads", "last")),
    }


def test_a_job_is_of_the_content_of_its_files(here):
    """Not of their names: another content under the same name is another job, the same under another name is not."""
    job = Sweep("p.h5")
    first = digest(job)
    os.rename("p.h5", "q.h5")
    assert digest(Sweep("q.h5")) == first != digest(job)  # one that is missing
    write_packing("p.h5", published("hertzian"))
    assert digest(job) != first
    write_packing("p.h5", published())
    assert digest(job) == first
    lines = "pack --radii r.txt --phi 0.9 --out a.h5"
    before = digest(lines)
    np.savetxt("r.txt", np.linspace(0.5, 0.8, 16))
    assert digest(lines) != before
    assert digest(Correlate(["p.h5", "q.h5"])) == digest(Correlate(["q.h5", "p.h5"]))
    assert digest(Correlate(["p.h5"])) != digest(Correlate(["p.h5", "q.h5"]))


def test_a_job_on_a_study_is_of_the_files_of_its_rows(here):
    """Of those that it takes: another row or another content of one of them is another job."""

    def of(rows, where="phi=0.84"):
        table = [
            {"command": "flow", "state": "done", "file": f"{n}.h5", "phi": phi} for n, phi in enumerate(rows)
        ]
        (here / "study" / "table.csv").write_text(table_text(table))
        return digest(Collapse(["study"], observable="pressure", fit="phi_J,y,znu", where=where))

    (here / "study").mkdir()
    for number in range(3):
        (here / "study" / f"{number}.h5").write_text(str(number))
    first = of([0.84, 0.84])
    assert of([0.84, 0.84, 0.85]) == first != of([0.84, 0.84, 0.84])
    (here / "study" / "1.h5").write_text("another flow")
    assert of([0.84, 0.84]) != first


def test_a_packing_in_memory_is_known_by_its_arrays():
    disks = published()
    moved = disks.replace(radii=np.nextafter(disks.radii, 1.0))
    assert digest(Sweep(disks)) == digest(Sweep(published())) != digest(Sweep(moved))
    assert digest(Sweep(disks)) != digest(Sweep(published("hertzian")))


def test_another_version_of_the_format_is_another_job(here, monkeypatch):
    """An earlier result is refused with the reason, not taken for finished."""
    first = Request(Sweep("p.h5"))
    text = first.text
    monkeypatch.setattr(request, "FORMAT_VERSION", "9.0")
    later = Request(Sweep("p.h5"))
    assert later.digest != first.digest
    assert later.differences(text) == f"format_version = {FORMAT_VERSION}, not 9.0"


def test_a_default_that_changes_is_another_job(here, monkeypatch):
    """Files have every default in words, so that a result of the old one does not count as that of the new one."""
    text = Request(Modes("p.h5")).text
    monkeypatch.setattr("jampetsc.commands.modes.COUNT", 20)
    assert Request(Modes("p.h5")).differences(text) == "count = 50, not 20"
    assert Request(Modes("p.h5", count=50)).differences(text) == ""


@pytest.mark.parametrize(
    ("table", "job"),
    [
        ({"sweep": {"beta": "1e-2", "omega": "1e-2,1", "accuracy": 1e-6}},
         lambda place: Sweep(place, ContactDamping(0.01), omega=[0.01, 1])),
        ({"modes": {"count": 50.0, "no-prestress": True}}, lambda place: Modes(place, prestress=False)),
        ({"flow": {"model": "RD0", "rate": "0.01", "strain": 2, "discard": 1}},
         lambda place: Flow(place, "RD0", rate=1e-2, strain=2)),
    ],
)  # fmt: skip
def test_a_study_asks_for_the_same_job(here, table, job):
    """Of a packing that is read and one that is made; the digest of a task stands for the file that it will have."""
    packing, task = plan("s.toml", {"pack": {"n": 16, "pressure": 1e-2, "seeds": "3:3"}} | table)
    assert packing.digest == digest("pack --n 16 --pressure 0.01 --seed 3 --out p.h5")
    of_file = task.settings.digest([request.identity_of("p.h5")])
    assert of_file == digest(job("p.h5")) == digest(task.settings.job_of(["p.h5"])) != task.digest
    assert task.name.endswith(task.digest[:8]) and packing.name.endswith(packing.digest[:8])


def test_a_digest_does_not_change_from_run_to_run():
    """It is in names of files of studies."""
    assert request.digest_of({"n": "16", "command": "pack"})[:8] == "f3bf0125"


def test_an_input_that_is_replaced_while_it_is_read_has_no_checkpoint(here):
    """Its steps would be of the packing that was read, under the digest of the one before it."""
    to = Outlet("s.h5", "s.h5", Request(Sweep("p.h5")))
    assert not to.check("jampetsc-sweep", ["p.h5"])
    to.checkpoint().save(0, {})
    write_packing("p.h5", published("hertzian"))
    with pytest.raises(
        InputError, match=r"^p\.h5: changed while it was read\. Run the same command again\.$"
    ):
        to.checkpoint()
    assert not Outlet("s.h5", "s.h5", Request(Sweep("p.h5"))).checkpoint().done
    write_packing("p.h5", published())
    assert Outlet("s.h5", "s.h5", Request(Sweep("p.h5"))).checkpoint().done.keys() == {0}


def test_a_file_says_what_differs(here):
    job = Modes("p.h5", count=3)
    recorded = json.dumps(Request(job).settings | {"count": "4"})
    assert Request(job).differences(Request(job).text) == ""
    assert Request(job).differences(recorded) == "count = 4, not 3"
    assert (
        Request(replace(job, prestress=False)).differences(Request(job).text) == "prestress = true, not false"
    )
    for text in ("no json", "[1, 2]", None):
        assert Request(job).differences(text) == "settings that are not readable"


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_a_result_is_known_by_its_file_or_by_its_run(session, here):
    """A correlation of a sweep in its file is that of the object that python has of it, and not that of another run."""
    sweep = jampetsc.sweep("p.h5", omega=[1.0], fields=[1.0], out="s.h5")
    assert digest(Correlate([sweep])) == digest("correlate s.h5 --out c.h5")
    first, second = (jampetsc.sweep("p.h5", omega=[1.0], fields=[1.0]) for _ in range(2))
    assert digest(Correlate([first])) == digest(Correlate([first])) != digest(Correlate([second]))
    with h5py.File("s.h5") as file:
        assert json.loads(file.attrs["request"]) == Request(Sweep("p.h5", omega=[1.0], fields=[1.0])).settings

"""Jobs: one dataclass gives function, command, request and documentation, and the answer is the same in memory."""

import dataclasses
import inspect
import os
import shlex
import signal
import subprocess
import sys
from functools import partial

import launch
import numpy as np
import pytest
from samples import SAMPLES, physics, polydisperse, published, put

import jampetsc
from jampetsc import ContactDamping, StokesDrag
from jampetsc import main as cli
from jampetsc.commands import JOBS, job_class
from jampetsc.commands.correlate import Correlate
from jampetsc.commands.modes import Modes
from jampetsc.commands.oscillate import Oscillate
from jampetsc.commands.pack import Pack
from jampetsc.commands.quasistatic import Quasistatic
from jampetsc.commands.spectrum import Spectrum
from jampetsc.commands.sweep import Sweep
from jampetsc.errors import InputError, python_value
from jampetsc.io.checkpoint import Checkpoint
from jampetsc.io.reader import collected
from jampetsc.io.result_file import ResultWriter
from jampetsc.laws.damping import Law
from jampetsc.options.parameters import build_job, fields, format_value, parameters
from jampetsc.options.values import PACKING, PACKING_OR_RESULT, RESULT, load_source
from jampetsc.response import rational
from jampetsc.studies.trade_job import Trade

FUNCTIONS = ("sweep", "quasistatic", "modes", "oscillate", "spectrum", "correlate")
THIRD = 1 / 3
ASKED = [
    Sweep("p.h5"),
    Sweep("p.h5", "stokes", omega=[0.3, 0.1, 0.1], fields=0.1, method="direct", accuracy=1e-9),
    Sweep("p.h5", ContactDamping(THIRD, rotations=False, tau1=2.0), prestress=False, parallel="matrix"),
    Sweep("p.h5", StokesDrag(0.0), omega="1e-3:1e2:51", fields="lin:1:2:5"),
    Sweep("p.h5", alpha=0.5, stress=1e-5),
    Quasistatic("p.h5", ContactDamping(0.1, normal=0.0), betas=np.geomspace(1e-3, 1, 4)),
    Modes("p.h5"),
    Modes("p.h5", count=3, prestress=False),
    Modes("p.h5", below=THIRD),
    Modes("p.h5", all=True),
    Oscillate("p.h5", omega=[0.1, THIRD], stress="1e-6,1e-5"),
    Oscillate("p.h5", ContactDamping(beta=0.5), alpha=0.5, omega=1e-30, strain=1e-6, steps=128),
    Oscillate("p.h5", omega=0.1, strain=1e-6, contacts="moving", cycles=7),
    Oscillate("p.h5", omega=0.1, strain=1e-6, contacts="moving", cycles="auto"),
    Spectrum(["s.h5"], window=THIRD),
    Spectrum(["s.h5", "t.h5"]),
    Correlate(["s.h5", "t.h5"], lane=[1, THIRD], phase="strain", omega=[1.0, 0.1], packing=None),
    Correlate(["f.h5"], lane=2.0, bin=THIRD),
    Trade("p.h5", ContactDamping(0.5), prestress=False, ranks=2, ensemble=True, omega="1,2"),
    Trade("p.h5", choices="method", options_files=["jampetsc:mumps", "jampetsc:iterative"]),
]


def parsed(job):
    """The job that its own command line asks for."""
    return launch.asked(job.line("o.h5")[1:])[0]


@pytest.mark.parametrize("job", ASKED, ids=str)
def test_the_words_of_a_job_ask_for_it(job):
    again = parsed(job)
    assert type(again) is type(job) and again.sources == job.sources
    assert again.settings() == job.settings() and again.words() == job.words()


def test_what_is_written_otherwise_and_means_the_same():
    job = ASKED[0]
    assert (
        job.settings()["omega"] == "1e-10:10000.0:141" and "beta" not in job.settings()
    )  # as a grid, without defaults
    assert (
        Sweep("p.h5", "stokes").law == StokesDrag() and Sweep("p.h5", "stokes").settings()["law"] == "stokes"
    )
    assert Oscillate("p.h5", omega=0.1, strain=1e-6, alpha=0.5).physics.law.exponent == 0.5
    assert Correlate(["s.h5"], lane="1,0.5").lane == (1.0, 0.5)  # in their order
    # an option at its default is as if it were not given, also one of another law
    assert build_job(Sweep, {"packing": "p.h5", "law": "stokes", "rotations": True}).law == StokesDrag()


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_says_what_it_takes(name):
    function, job = getattr(jampetsc, name), job_class(name)
    signature = inspect.signature(function)
    known = parameters(job)
    names = {field.name for field in dataclasses.fields(job)}
    assert names | {"out", "checkpoint"} <= set(signature.parameters)
    for parameter in signature.parameters.values():
        assert f"\n{parameter.name} : " in function.__doc__
        if parameter.name in known and getattr(fields(job)[parameter.name], "place", "") == "option":
            assert parameter.kind == parameter.KEYWORD_ONLY and parameter.annotation != parameter.empty
            assert known[parameter.name].help in function.__doc__
    assert function.__name__ == name and function.__doc__.startswith(inspect.cleandoc(job.__doc__)[:30])
    with pytest.raises(TypeError, match="typo"):
        function("p.h5", typo=1, **{"omega": 1.0} if name == "oscillate" else {})


def test_a_keyword_that_a_function_does_not_have_is_answered_with_what_to_write():
    for function, given, remedy in (
        (
            jampetsc.sweep,
            {"beta": 0.1},
            r"sweep\(\) has no keyword beta\. Give law=jampetsc\.ContactDamping\(beta=0\.1\)",
        ),
        (jampetsc.modes, {"cuont": 3}, r"no keyword cuont; did you mean count\?"),
        (
            jampetsc.quasistatic,
            {"eta_f": 2.0, "tau1": 0.5},
            r"Give law=jampetsc\.StokesDrag\(eta_f=2\.0, tau1=0\.5\)\.$",
        ),
        (jampetsc.flow, {"mass": 1.0, "strain": 1.0}, r"Give model=jampetsc\.models\.CDn\(mass=1\.0\)\.$"),
        (
            jampetsc.flow,
            {"normal": 1.0, "strain": 1.0},
            r"Give model=jampetsc\.ContactDamping\(normal=1\.0\)\.$",
        ),
        (
            jampetsc.flow,
            {"law": jampetsc.ContactDamping(), "mass": 2.0, "strain": 1.0},
            r"Give model=jampetsc\.models\.Model\(law, mass=2\.0\)\.$",
        ),
        (jampetsc.flow, {"law": "contact", "strain": 1.0}, r"Give model=law\.$"),
    ):
        with pytest.raises(TypeError, match=remedy):
            function("p.h5", **given)
    for name in ("sweep", "quasistatic", "flow"):
        assert "by the options" not in getattr(jampetsc, name).__doc__
    assert (
        '\nlaw : jampetsc.ContactDamping(…), jampetsc.StokesDrag(…), jampetsc.Law("custom", …) or "contact", "stokes", '
        '"custom", default ContactDamping()\n    damping law\n' in jampetsc.sweep.__doc__
    )


def test_a_list_where_one_value_is_wanted_is_shown_with_what_to_do():
    with pytest.raises(
        InputError, match=r"^pressure \[0\.001, 0\.0001\]: not a single value\. Give a list .*study"
    ):
        Pack(n=16, pressure=[1e-3, 1e-4])


@pytest.mark.parametrize(
    ("given", "number"), [("1e3", 1000), (1e3, 1000), ("1000", 1000), ("64.0", 64), (64, 64)]
)
def test_whole_numbers_in_any_spelling(given, number):
    n = Pack(n=given, phi=0.9).n
    assert n == number and type(n) is int


@pytest.mark.parametrize("given", [True, 16.5])
def test_what_is_no_whole_number(given):
    with pytest.raises(InputError, match="must be a whole number"):
        Pack(n=given, phi=0.9)


def test_a_law_of_ones_own_is_recorded_with_all_its_weights():
    law = jampetsc.Law("mine", normal=1.0, sliding=0.5, drag=0.25, tau1=2.0)
    assert repr(law) == 'Law("mine", normal=1.0, sliding=0.5, drag=0.25, tau1=2.0)'
    words = Sweep("p.h5", law).words()
    assert shlex.join(words).startswith("--law custom --normal 1.0 --sliding 0.5 --drag 0.25 --tau1 2.0")
    again = build_job(Sweep, {"packing": "p.h5"} | Sweep("p.h5", law).settings()).law
    assert again == dataclasses.replace(law, label=again.label, family="custom")
    powers = dataclasses.replace(law, exponent=0.5)  # no option says that
    assert Sweep("p.h5", powers).settings()["law"] == repr(powers)


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int64])
def test_numbers_of_numpy_become_pythons_own(dtype):
    """numpy 2 writes np.float64(2.0) for one of its own: no text for a file, a message or python code."""
    two, law = dtype(2), jampetsc.Law("mine", normal=dtype(1), sliding=dtype(2), tau1=dtype(2))
    made = [law, ContactDamping(beta=two, tau1=two), StokesDrag(eta_f=two)]
    numbers = [value for each in made for value in (*vars(each).values(), *dict(each.options).values())]
    flow = jampetsc.models.CDn(mass=two), jampetsc.models.CD(quality=two)
    numbers += [value for each in flow for value in vars(each).values()]
    assert not any(isinstance(value, np.generic) for value in numbers)
    assert made[1] == ContactDamping(beta=2.0, tau1=2.0)
    assert repr(made[1]) == repr(ContactDamping(beta=two.item(), tau1=two.item()))


def test_numbers_of_numpy_in_messages_are_pythons_own():
    for value in ([np.float64(1.0), -1], (np.float64(1.0), np.int64(-1)), np.float64(-1.0)):
        assert format_value(value) == format_value(python_value(value))
        with pytest.raises(InputError, match=r"-1:? must lie between") as error:
            Sweep("p.h5", ContactDamping(), omega=value)
        assert "np." not in str(error.value)
    assert str(python_value([np.float64(0.5), (np.int32(1), "a")])) == "[0.5, (1, 'a')]"


def test_a_law_of_the_command_line_is_that_of_python():
    law = build_job(
        Sweep, {"packing": "p.h5", "law": "custom", "normal": 1.0, "transverse": 0.3, "drag": 0.1}
    ).law
    assert repr(law) == 'Law("custom", normal=1.0, transverse=0.3, drag=0.1)'
    mine = jampetsc.Law("mine", normal=1.0, transverse=0.3, drag=0.1)
    weights = ("on_contacts", "drag", "eta_f", "tau1", "exponent", "couples_rotations")
    assert [getattr(law, name) for name in weights] == [getattr(mine, name) for name in weights]
    assert law.parameters == {
        "law": "custom", "tau1": 1.0, "normal": 1.0, "transverse": 0.3, "sliding": 0.0, "drag": 0.1,
        "spin_drag": 0.0, "eta_f": 0.0,
    }  # fmt: skip


@pytest.mark.parametrize("name", JOBS)
def test_every_parameter_has_help_and_a_default_that_it_takes(name):
    for parameter in parameters(job_class(name)).values():
        assert parameter.help and "--" not in parameter.help, parameter.name
        if not parameter.required:
            parameter.read(parameter.default)


def test_a_result_in_memory_is_taken_as_it_is_and_one_in_a_file_by_its_name(tmp_path):
    found = collected(ResultWriter(None, "jampetsc-quasistatic"))
    assert RESULT.read(found) is PACKING_OR_RESULT.read(found) is load_source(found) is found
    with pytest.raises(ValueError, match="must be a packing"):
        PACKING.read(found)
    found.save(tmp_path / "a.h5")
    assert RESULT.read(found) == PACKING.read(found) == str(tmp_path / "a.h5")
    assert load_source(RESULT.read(found)).attributes["run_id"] == found.attributes["run_id"]


@pytest.mark.parametrize("number", [10**400, -(10**400), float("inf"), float("nan"), -1.0])
def test_numbers_of_laws_and_models_that_are_refused(number):
    for make, name in (
        *((ContactDamping, name) for name in ("beta", "normal", "tau1")),
        *((StokesDrag, name) for name in ("eta_f", "tau1")),
        *((partial(Law, "own", drag=1.0), name) for name in ("sliding", "tau1")),
        *((jampetsc.models.CD, name) for name in ("mass", "quality")),
        *((jampetsc.models.CD0, name) for name in ("background_drag", "tau1")),
        (partial(Sweep, "p.h5"), "accuracy"),
    ):
        with pytest.raises(InputError, match=f"{name} .*must"):
            make(**{name: number})


def test_what_no_parameter_can_be_is_refused_in_one_line():
    for make, given in (
        (jampetsc.sweep, {"packing": np.zeros((200, 2))}),
        (jampetsc.pack, {"pressure": []}),
        (jampetsc.pack, {"pressure": 1e-2, "radii": 10**400}),
        (jampetsc.flow, {"start": b"none.h5", "model": jampetsc.models.RD0(), "rate": 0.1, "strain": 1.0}),
    ):
        with pytest.raises(InputError) as refused:
            make(**given)
        assert len(str(refused.value)) < 300 and "\n" not in str(refused.value)
    count = build_job(Modes, {"packing": "p.h5", "count": 10**400}).count
    assert count == 10**400  # a packing may have fewer modes


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (
            lambda: jampetsc.flow(model=jampetsc.models.CD0, rate=0.1, strain=1),
            r"must be a Model\. Call it: CD0\(…\)",
        ),
        (
            lambda: jampetsc.study({"pack": {"n": 16, "pressure": 1e-2}}),
            "out: missing. Give the folder of the study",
        ),
        (lambda: jampetsc.plot([]), "results: empty. Give at least one"),
    ],
)
def test_what_a_function_lacks_is_said(call, says):
    with pytest.raises(InputError, match=says):
        call()


def test_files_there_must_be():
    with pytest.raises(InputError, match=r"results: missing\. Give at least one"):
        jampetsc.correlate()
    with pytest.raises(TypeError, match="packing"):
        jampetsc.sweep()


def test_what_the_package_gives_by_name():
    assert {name for name in JOBS if name != "import"} | {"load", "import_packing"} < set(jampetsc.__all__)
    names = set(jampetsc.__all__) - {"models", "loads", "__version__"}
    assert all(callable(getattr(jampetsc, name)) for name in names)
    with pytest.raises(AttributeError, match="has no attribute 'swep'"):
        jampetsc.swep  # noqa: B018
    code = "import jampetsc, sys; assert not {'numpy', 'h5py', 'petsc4py', 'mpi4py'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], env=launch.environment(), check=True)


# Answers


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_a_function_gives_what_its_command_writes(session, shared_path):
    packing, out = put(shared_path / "p.h5", published(), session.comm), shared_path / "command.h5"
    words = ["--beta", "0.1", "--no-prestress", "--omega", "0.01,1.0"]
    assert cli.dispatch(["sweep", str(packing), "--out", str(out), *words]) == 0
    session.comm.Barrier()
    command, disks = jampetsc.load(out), jampetsc.load(packing)
    law = ContactDamping(np.float64(0.1))
    for source in (str(packing), disks, jampetsc.Packing(disks.positions, disks.radii, disks.cell)):
        function = jampetsc.sweep(source, law, prestress=False, omega=np.array([0.01, 1.0]))
        np.testing.assert_allclose(function.G, command.G, rtol=1e-9)
        assert function.law == command.law and function.attributes["ranks"] == session.size
    kept = jampetsc.sweep(packing, law, prestress=False, omega=[0.01, 1.0], out=shared_path / "kept.h5")
    told = kept.attributes["argv"].split()
    assert told[:4] == ["jampetsc", "sweep", str(packing), "--out"]
    again, _ = launch.asked(told[1:])
    assert again.settings() == Sweep(packing, law, prestress=False, omega=[0.01, 1.0]).settings()


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_what_needs_no_petsc_is_done_by_one_rank(session, monkeypatch):
    ranks, work = [], Spectrum.work
    monkeypatch.setattr(Spectrum, "work", lambda *words: ranks.append(session.rank) or work(*words))
    found = jampetsc.spectrum(jampetsc.sweep(published(), omega=[1e-3, 1.0]))
    assert ranks == [0] * (session.rank == 0)
    assert len(set(session.comm.allgather(found.attributes["run_id"]))) == 1


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_flows_and_studies_are_functions_too(session, shared_path):
    flow = jampetsc.flow(n=16, phi=0.9, model="RD0", rate=1e-2, strain=0.2, discard=0.1, snapshots=2)
    farther = jampetsc.flow(flow, strain=0.3, out=shared_path / "farther.h5")
    assert farther["strain"][-1] > flow["strain"][-1]
    assert jampetsc.correlate(flow, bin=0.5)["pairs"].sum() > 0
    assert jampetsc.jam(n=16, phi=0.9, seeds=[1, 4])["seed"].tolist() == [1, 4]
    packs = {"n": 16, "pressure": 1e-2, "seeds": "1:2", "stabilise": "shear"}
    table = jampetsc.study({"pack": packs, "quasistatic": {"beta": 0.1}}, out=shared_path / "study")
    assert set(table["state"]) == {"done"} and table.where(command="quasistatic")["G0"].min() > 0


def arrays_of(result):
    return {name: result.gathered()[name] for name in result}


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_an_answer_in_memory_is_that_of_the_file(session, shared_path, monkeypatch):
    """Also where the packing, or the sweep, has never been in one; and nothing is written."""
    p, q = published(), SAMPLES["polydisperse"]()
    put(shared_path / "p.h5", p, session.comm)
    folder = shared_path / "f"
    if session.rank == 0:
        folder.mkdir()
    session.comm.Barrier()
    monkeypatch.chdir(folder)
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    law = ContactDamping(0.1)
    calls = {
        "sweep": partial(jampetsc.sweep, law=law, omega=[1e-3, 1.0], fields=[1.0]),
        "quasistatic": partial(jampetsc.quasistatic, law=law, betas=[0.5]),
        "modes": partial(jampetsc.modes, count=3),
        "oscillate": partial(jampetsc.oscillate, law=law, strain=1e-6, omega=0.1, steps=16),
    }
    found = {}
    for name, call in calls.items():
        found[name] = call(p)
        assert found[name].packing is p and found[name].file is None
    found["spectrum"] = jampetsc.spectrum(found["sweep"])
    found["correlate"] = jampetsc.correlate(found["sweep"], lane=[1.0, 2.0])
    assert not os.listdir(folder)
    session.comm.Barrier()
    kept = {name: call(shared_path / "p.h5", out=f"{name}.h5") for name, call in calls.items()}
    assert kept["sweep"].path.parent == folder
    assert kept["sweep"].attributes["argv"].startswith("jampetsc sweep")
    kept["spectrum"] = jampetsc.spectrum(kept["sweep"], out="spectrum.h5")
    beside = {"packing": shared_path / "p.h5", "lane": [1, 2]}
    kept["correlate"] = jampetsc.correlate(kept["sweep"], out="c.h5", **beside)
    for name, result in found.items():
        one, two = arrays_of(result), arrays_of(kept[name])
        assert list(one) == list(two) and type(result) is type(kept[name])
        for key in one:
            atol = 1e-13 + 1e-7 * np.nanmax(np.abs(two[key]), initial=0.0)
            np.testing.assert_allclose(one[key], two[key], rtol=1e-6, atol=atol, err_msg=f"{name} {key}")
        ours, theirs = set(result.attributes), set(kept[name].attributes)
        assert theirs - ours <= {"packing"} and ours <= theirs, name
    again = jampetsc.correlate(kept["sweep"], packing=p, lane=[1, 2])  # of a file, its packing in memory
    np.testing.assert_array_equal(again["C"], kept["correlate"]["C"])
    with pytest.raises(InputError, match="packing: not the packing that sweep"):
        jampetsc.correlate(kept["sweep"], packing=q)
    session.comm.Barrier()
    found["spectrum"].save("saved.h5")  # by all ranks together
    session.comm.Barrier()
    assert jampetsc.load("saved.h5").spectrum.G0 == found["spectrum"].spectrum.G0
    found["sweep"].save("s.h5")  # still knows its packing
    session.comm.Barrier()
    again = jampetsc.correlate(found["sweep"], lane=[1, 2])
    np.testing.assert_allclose(again["C"], found["correlate"]["C"], rtol=1e-12)
    with pytest.raises(InputError, match=r"its packing was in memory\. Give it with packing"):
        jampetsc.correlate(jampetsc.load("s.h5"))
    with pytest.raises(InputError, match=r"s\.h5: the input .*, which would be lost\. Choose another out\."):
        jampetsc.correlate(found["sweep"], out="s.h5")
    session.comm.Barrier()


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_an_interrupt_leaves_a_process_that_can_go_on(session, monkeypatch, shared_path):
    p, solve = published(), rational.RationalSweep.add_shifts
    with monkeypatch.context() as patch:
        patch.setattr(rational.RationalSweep, "add_shifts", lambda *words: (solve(*words), _interrupt()))
        with pytest.raises(KeyboardInterrupt, match=r"^interrupted: nothing is kept\.$"):
            jampetsc.sweep(p, omega=[1.0])
    reference = jampetsc.quasistatic(p).attributes["G0"]
    assert jampetsc.sweep(p, omega=[1e-9]).G[0].real == pytest.approx(reference, rel=1e-6)
    save = Checkpoint.save
    how = {"omega": [1e-3, 1.0], "method": "direct", "checkpoint": shared_path / "kept"}
    with monkeypatch.context() as patch:
        patch.setattr(Checkpoint, "save", lambda *words: (save(*words), signal.raise_signal(signal.SIGINT)))
        said = f"^interrupted: finished steps are kept beside {shared_path}/kept. The same command resumes.$"
        with pytest.raises(KeyboardInterrupt, match=said):
            jampetsc.sweep(p, **how)
    assert len(list((shared_path / "kept.resume").glob("*-rank-0000"))) == 1
    assert len(jampetsc.sweep(p, **how).G) == 2 and not list(shared_path.iterdir())


def _interrupt():
    raise KeyboardInterrupt


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_sweeps_leave_no_memory_behind(session):
    """Of 200 it grew by 0.4 MB after the 25th; a factor that stays would be 0.1 MB each."""
    for count in range(20):
        if count == 6:
            before = _resident()
        jampetsc.sweep(published(), physics().law, omega=[1.0])
    assert _resident() - before < 1_000_000


def _resident():
    """Bytes of memory that this process holds."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_a_packing_is_minimised_in_its_cell(session):
    rest = published()
    moved = rest.positions + 1e-3 * np.random.default_rng(1).normal(size=(rest.n, 2))
    start = jampetsc.Packing(moved, rest.radii, rest.cell)
    found = jampetsc.minimise(start, tolerance=1e-8)
    assert np.array_equal(found.cell, start.cell) and found.record["negative_modes"] == 0
    assert found.record["max_force"] < 1e-7 * found.pressure
    assert found.record["energy"] < start.record["energy"]


def test_another_packing_in_memory_is_another_request(tmp_path):
    """A finished result of other inputs is not replaced without a word, wherever these lie."""
    out, how = tmp_path / "f.h5", {"model": jampetsc.models.RD0(), "rate": 1e-1, "strain": 0.02}
    for _ in range(2):
        jampetsc.flow(published(), **how, out=out)
    assert jampetsc.info(out).startswith(f"{out}: flow of ")  # text is given as it is
    with pytest.raises(InputError, match="other inputs"):
        jampetsc.flow(polydisperse(3)[0], **how, out=out)

"""What the words of the command line mean: those that contradict each other, or mean nothing, are refused."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from samples import published

from jampetsc import cli
from jampetsc.commands import flow, jam, oscillate, pack, sweep
from jampetsc.contacts.laws import Physics, damping_law
from jampetsc.contacts.potentials import Potential
from jampetsc.errors import InputError
from jampetsc.flows import job as jobs
from jampetsc.packing.minimise import settle
from jampetsc.packing.protocols import Target, random_start
from jampetsc.packing.sizes import radii_of
from jampetsc.storage.packing_file import packing_identity, read_packing, write_packing
from jampetsc.storage.reader import load
from jampetsc.studies.table import table_text
from jampetsc.words import flowing, packtasks, picture
from jampetsc.words.files import files_named, refuse_one_packing, refuse_repeated
from jampetsc.words.law import physics_from, words_of
from jampetsc.words.packtasks import plan


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "sweep p.h5 --out s.h5 --method direct --parallel shifts",
            "--parallel shifts: belongs to --method rational",
        ),
        (
            "sweep p.h5 --out s.h5 --method direct --parallel auto",
            "--parallel auto: belongs to --method rational",
        ),
        ("sweep p.h5 --out s.h5 --fields=", "--fields : write low:high:count"),
        ("sweep p.h5 --out s.h5 --fields ,", "--fields ,: write low:high:count"),
        ("pack --n 64 --pressure 1e-3 --out k{foo}.h5", r"--out k\{foo\}\.h5: \{foo\} stands for nothing"),
        ("pack --n 64 --pressure 1e-3 --out k{seed.h5", r"\{seed\.h5 stands for nothing: only \{seed\} and"),
        ("pack --n 64 --phi 0.86 --out k{pressure}.h5", r"\{pressure\} has no meaning with --phi"),
        (
            "pack --n 64 --pressure 1e-3 --seed 9223372036854775808 --out k.h5",
            "--seed 9223372036854775808: must lie in",
        ),
        (
            "pack --n 64 --pressure 1e-3 --seeds 1:9999999999 --out {seed}.h5",
            "9999999999 packings: at most 1000000",
        ),
        ("pack --n 64 --pressure -1e-4 --out k.h5", r"--pressure -1e-4: must lie in \[1e-08, 1\]"),
        ("pack --n 64 --pressure 1e-3, --out k.h5", "--pressure 1e-3,: must be a number, or several"),
        ("pack --n 64 --presure 1e-3 --out k.h5", "--presure: no such option; did you mean --pressure"),
        ("sweep p.h5 --ouput s.h5", "--ouput: no such option; did you mean --out"),
        (
            "sweep p.h5 --out s.png",
            r"--out s\.png: would be an HDF5 file by that name: give it the ending \.h5",
        ),
        (
            "modes p.h5 --out m.h5 --below 1e-30",
            "--below 1e-30: must be above 1e-12; softer modes cannot be told",
        ),
        ("correlate f.h5 --out c.h5 --lane 1,0.5,1", "--lane 1,0.5,1: gives a width twice"),
        ("plot c.h5 --log-exponent -1e2 --out c.png", "c.h5: no such file"),
    ],
)
def test_words_that_mean_nothing(line, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        cli.dispatch(line.split())
    assert not list(tmp_path.iterdir())


def test_pressure_is_in_units_of_the_k_of_the_packing():
    line = ["pack", "--from", "soft.h5", "--pressure", "1e-3,1e-2", "--out", "p{pressure}.h5"]
    tasks = plan(cli.command_parser(line)[0].parse_args(line), 1e-6)
    assert [(task.path.name, task.target.pressure) for task in tasks] == [
        ("p1e-3.h5", pytest.approx(1e-9)),
        ("p1e-2.h5", pytest.approx(1e-8)),
    ]


def test_one_file_under_two_names(tmp_path):
    (tmp_path / "a.h5").touch()
    (tmp_path / "b.h5").symlink_to("a.h5")
    refuse_repeated([tmp_path / "a.h5", tmp_path / "c.h5"])
    with pytest.raises(InputError, match=r"b\.h5: is .*a\.h5, which is given already: name each file once"):
        refuse_repeated([str(tmp_path / "a.h5"), str(tmp_path / "b.h5")])
    with pytest.raises(InputError, match=r"a\.h5: this file is given already"):
        refuse_repeated([str(tmp_path / "a.h5")] * 2)


def words(line):
    command, *rest = line.split()
    args = cli.command_parser([command, *rest])[0].parse_args([command, *rest])
    return args


# What is asked for is what the words say


def test_an_oscillation_is_asked_for_as_told():
    plain = "oscillate d/p.h5 --out o.h5 --omega 2,1"
    job = oscillate.check(words(f"{plain} --strain 1e-3,1e-6"))
    assert (str(job.packing), str(job.out), job.contacts, job.cycles) == ("d/p.h5", "o.h5", "fixed", None)
    assert job.omega.tolist() == [1.0, 2.0] and job.amplitude.tolist() == [1e-6, 1e-3]
    assert not job.stress_controlled and job.steps == 64 and job.physics == Physics(damping_law())
    assert job.physics.law.exponent == 1.0
    more = f"{plain} --stress 1e-4 --alpha 0.5 --beta 0.25 --tau1 3 --steps 32"
    job = oscillate.check(words(f"{more} --contacts moving --cycles 7"))
    assert job.stress_controlled and job.amplitude.tolist() == [1e-4] and job.steps == 32
    assert (job.contacts, job.cycles) == ("moving", 7)
    assert (job.physics.law.exponent, job.physics.law.tau1) == (0.5, 3.0)
    assert dict(job.physics.law.options)["beta"] == 0.25 and job.physics.prestress
    assert oscillate.check(words(f"{more} --contacts moving --cycles auto")).cycles is None
    assert not oscillate.check(words(f"{more} --no-prestress")).physics.prestress


@pytest.mark.parametrize(
    ("alpha", "omega", "within"),
    [
        (1.0, "1e-16", True), (1.0, "0.99e-16", False), (1.0, "1e12", True), (1.0, "1.01e12", False),
        (2.0, "0.99e-16", False), (0.5, "1e-32", True), (0.5, "0.99e-32", False), (0.5, "1e24", True),
        (0.5, "1.01e24", False), (0.05, "1e240", True), (0.05, "1.01e240", False),
        (0.01, "1e-300", True), (0.01, "1e300", True),
    ],
)  # fmt: skip
def test_frequencies_of_a_power_law_go_as_far_as_their_power_does(alpha, omega, within):
    line = f"oscillate p.h5 --out o.h5 --strain 1e-3 --alpha {alpha} --omega {omega}"
    if within:
        assert oscillate.check(words(line)).omega == pytest.approx([float(omega)], rel=1e-12)
    else:
        with pytest.raises(InputError, match="frequencies must lie between"):
            oscillate.check(words(line))


@pytest.mark.parametrize(
    ("omega", "tau1", "within"),
    [("1e-299", "0.1", True), ("1e-299", "0.09", False), ("1e299", "10", True), ("1e299", "11", False)],
)
def test_a_frequency_times_its_damping_time_is_a_number(omega, tau1, within):
    line = f"oscillate p.h5 --out o.h5 --strain 1e-3 --alpha 0.01 --omega {omega} --tau1 {tau1}"
    if within:
        oscillate.check(words(line))
    else:
        with pytest.raises(InputError, match=f"--tau1 {float(tau1):g}: their product must lie between"):
            oscillate.check(words(line))


def test_a_sweep_is_asked_for_as_told():
    physics, damping, omega, fields = sweep.check(words("sweep p.h5 --out s.h5"))
    assert physics == Physics(damping_law()) and damping is None and not len(fields)
    assert (len(omega), omega[0], omega[-1]) == (141, pytest.approx(1e-10), pytest.approx(1e4))
    line = "sweep p.h5 --out s.h5 --omega 1,3 --fields 3 --alpha 0.5 --stress 1e-4 --no-rotations --tau1 2"
    physics, damping, omega, fields = sweep.check(words(line))
    assert omega.tolist() == [1.0, 3.0] and fields.tolist() == [3.0]
    assert (damping.alpha, damping.stress) == (0.5, 1e-4) and physics.law.exponent == 0.5
    assert physics.law.tau1 == 2.0 and not dict(physics.law.options)["rotations"]


def test_packings_are_asked_for_as_told():
    line = "pack --n 16 --pressure 1e-2,1e-3 --seeds 0:2 --out s{seed}-p{pressure}.h5"
    line += " --tolerance 1e-8 --stabilise shear"
    radii, tasks = pack.check(words(line))
    assert len(radii) == 16 and [task.path.name for task in tasks[:3]] == [
        "s0-p1e-2.h5", "s0-p1e-3.h5", "s1-p1e-2.h5",
    ]  # fmt: skip
    assert [task.seed for task in tasks] == [0, 0, 1, 1, 2, 2]
    for task, pressure in zip(tasks, (1e-2, 1e-3) * 3, strict=True):
        target = task.target
        assert (target.pressure, target.stabilise, target.tolerance) == (pressure, "shear", 1e-8)
        assert target.phi is None
    _, (task,) = pack.check(words("pack --n 16 --phi 0.9 --out p.h5 --tolerance 1e-9"))
    assert (task.seed, task.target.phi, task.target.tolerance) == (1, 0.9, 1e-9)
    _, (task,) = pack.check(words("pack --n 16 --phi 0.9 --out p.h5 --seed 0"))
    assert task.seed == 0 and packtasks.entries(task, {})["seed"] == 0


def test_a_flow_is_asked_for_as_told(tmp_path):
    line = "flow --n 16 --phi 0.7 --law contact --beta 0.5 --tau1 2 --mass 3 --friction 0.125 --rate 1e-2 --strain 0.5"
    line += f" --out {tmp_path}/f.h5"
    job = flow._fresh(words(line), jobs, [])
    assert (job.rate, job.model.mass, job.model.friction, job.model.law.tau1) == (1e-2, 3.0, 0.125, 2.0)
    assert (job.plan.snapshots, job.plan.discard, job.scheme.tolerance) == (0, 0.25, 1e-4)
    assert job.plan.steps * job.plan.rows * job.scheme.step * 1e-2 == pytest.approx(0.5, rel=0.05)
    words_ = words(f"{line} --tolerance 1e-6 --step 0.01 --snapshots 3 --discard 0.125")
    more = flow._fresh(words_, jobs, [])
    assert (more.scheme.tolerance, more.scheme.step) == (1e-6, 0.01)
    assert (more.plan.snapshots, more.plan.discard) == (3, 0.125)


def test_a_quality_knows_the_stiffness_of_the_packing(tmp_path):
    write_packing(tmp_path / "p.h5", replace(published(), potential=Potential(k=4.0)))
    line = f"flow {tmp_path}/p.h5 --model RD --quality 3 --tau1 0.5 --rate 1e-3 --strain 0.1 --out {tmp_path}/f.h5"
    assert flow._fresh(words(line), jobs, []).model.mass == pytest.approx(9.0 * 4.0 * 0.25)


def test_samples_that_jam_are_asked_for_as_told():
    tasks, protocol = jam.check(words("jam --n 16 --out j.h5 --phi 0.84:0.8:3 --seeds 4:5"))
    assert tasks == [(pytest.approx(phi), seed) for phi in (0.84, 0.82, 0.8) for seed in (4, 5)]
    assert protocol.name == "random" and protocol.rows == 1
    line = "jam --n 16 --out j.h5 --phi 0.85,0.8,0.8 --seeds 0:0 --protocol"
    tasks, protocol = jam.check(words(f"{line} shear --step 0.01 --strain 2 --every 0.25"))
    assert tasks == [(0.8, 0), (0.85, 0)]
    assert (protocol.step, protocol.strain, protocol.discard, protocol.every) == (0.01, 2.0, 1.0, 0.25)
    _, protocol = jam.check(words(f"{line} compress --temperature 1e-2 --sweeps 0"))
    assert (protocol.temperature, protocol.cooling_rate, protocol.sweeps) == (1e-2, 1e-2, 0)
    jam.check(
        words(f"{line} shear --step 0.1 --every {0.3 - 0.2}")
    )  # a step but for rounding, 0.09999999999999998


def test_no_two_results_of_one_packing_but_of_unknown_ones():
    def result(name, sha256):
        return SimpleNamespace(path=Path(name), attributes={"packing_sha256": sha256} if sha256 else {})

    refuse_one_packing([result("a.h5", None), result("b.h5", None), result("c.h5", "1" * 64)])
    with pytest.raises(
        InputError, match=r"c\.h5: comes from the same packing as b\.h5 \(sha256 111111111111…\)"
    ):
        refuse_one_packing([result("a.h5", None), result("b.h5", "1" * 64), result("c.h5", "1" * 64)])


def test_files_of_a_study_are_of_rows_that_are_done(tmp_path):
    rows = [
        {"command": "jam", "state": state, "file": f"{n}.h5", "seconds": 1, "cooling_rate": rate}
        for n, (state, rate) in enumerate((("done", 0.1), ("failed: no", 0.1), ("done", 0.2), ("done", 0.1)))
    ]
    (tmp_path / "table.csv").write_text(table_text(rows))
    asked = []

    def chosen(path, done, here):
        asked.append((path, here))
        return done

    assert files_named([tmp_path], None, chosen) == ([str(tmp_path / f"{n}.h5") for n in (0, 2, 3)], True)
    some = files_named(["other.h5", tmp_path], "cooling-rate=0.1, command = jam", chosen)
    assert some == (["other.h5", str(tmp_path / "0.h5"), str(tmp_path / "3.h5")], True)
    assert asked == [(tmp_path, ""), (tmp_path, " where cooling-rate=0.1, command = jam")]
    assert files_named(["other.h5"], None, chosen) == (["other.h5"], False)


def test_a_file_of_radii_is_read_no_farther_than_it_must(tmp_path, monkeypatch):
    monkeypatch.setattr(packtasks, "MOST", 20)
    for count, said in ((20, None), (21, "21 disks: must lie in"), (40, "21 disks")):
        (tmp_path / "r.txt").write_text("1\n" * count)
        args = SimpleNamespace(radii=str(tmp_path / "r.txt"), n=None, sizes=None)
        if said is None:
            assert len(packtasks.radii_asked(args)) == 20
        else:
            with pytest.raises(InputError, match=said):
                packtasks.radii_asked(args)


def test_radii_are_read_from_a_file_alone(tmp_path):
    args = SimpleNamespace(radii=str(tmp_path), n=None, sizes=None)
    with pytest.raises(InputError) as refused:
        packtasks.radii_asked(args)
    assert str(refused.value).startswith(f"{tmp_path}: ") and "as radii" not in str(refused.value)


def test_a_changed_packing_leaves_its_record_behind():
    old = published().with_record(protocol="old", pressure=1.0)
    args = SimpleNamespace(n=None, phi=None, source="p.h5")
    assert packtasks.starter(args, None, old)(None, Target(1e-3)).record == {}
    wider = packtasks.starter(SimpleNamespace(n=16, phi=0.7, source="p.h5"), None, old)(None, Target(phi=0.7))
    assert wider.phi == pytest.approx(0.7) and wider.record == {}
    touching = published()
    apart = touching.from_positions(touching.positions, 0.5 * touching.radii, touching.cell)
    assert packtasks.starter(SimpleNamespace(n=16, phi=0.9, source="p.h5"), None, apart)


@pytest.mark.parametrize(
    ("value", "within"),
    [(None, True), (0.0, True), (10.0, True), (-0.1, False), (10.1, False), (float("nan"), False)],
)
def test_an_option_of_a_picture_lies_between_its_limits(value, within):
    args = SimpleNamespace(log_exponent=value)
    if within:
        assert picture.within(args, "log_exponent", 0, 10, 3.5) == (3.5 if value is None else value)
    else:
        with pytest.raises(InputError, match=f"--log-exponent {value:g}: must lie between 0 and 10"):
            picture.within(args, "log_exponent", 0, 10, 3.5)


@pytest.mark.parametrize(
    "physics",
    [
        Physics(damping_law()),
        Physics(damping_law("contact", tau1=1 / 3, beta=0.1, rotations=False), False),
        Physics(damping_law("stokes", tau1=2.0)),
    ],
)
def test_words_of_a_law_mean_that_law(physics):
    args = words(" ".join(["sweep", "p.h5", "--out", "s.h5", *words_of(physics)]))
    assert physics_from(args) == physics


@pytest.mark.parametrize("seed", [None, 0, 3])
def test_a_random_start_is_that_of_its_seed(seed):
    line = "flow --n 16 --phi 0.5 --model RD0 --rate 1e-2 --strain 0.02 --out f.h5"
    disks, origin = flowing.start_of(words(line + ("" if seed is None else f" --seed {seed}")))
    assert origin["seed"] == (1 if seed is None else seed)
    radii = radii_of("bidisperse", 16)
    again = settle(
        random_start(radii * (0.5 / radii.min()), 0.5, origin["seed"], disks.potential), flowing.SETTLED
    )
    assert again.fingerprint == disks.fingerprint


def test_disks_between_walls_are_told_with_how_many_make_them_up():
    line = "flow --n 32 --phi 0.5 --model RD0 --rate 1e-2 --strain 0.02 --walls --out f.h5"
    disks, origin = flowing.start_of(words(line))
    assert 0 < origin["walls"] < disks.n and disks.n >= 32
    plain, origin = flowing.start_of(words(line.replace("--walls ", "")))
    assert plain.n == 32 and "walls" not in origin


def test_a_packing_to_start_from_is_told_with_its_checksum(tmp_path):
    write_packing(tmp_path / "p.h5", published())
    line = f"flow {tmp_path}/p.h5 --model RD0 --rate 1e-2 --strain 0.02 --out {tmp_path}/f.h5"
    disks, origin = flowing.start_of(words(line))
    name, digest = packing_identity(tmp_path / "p.h5")
    assert origin == {"packing": name, "packing_sha256": digest, "units": "those of the packing"}
    assert disks.fingerprint == published().fingerprint


@pytest.mark.parametrize(
    "line", ["pack --radii r.h5 --pressure 1e-3 --out r.h5", "pack --radii r.h5 --phi 0.9 --out ./r.h5"]
)
def test_radii_are_not_lost(line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "r.h5").write_text("1\n" * 16)
    with pytest.raises(InputError, match=r"r\.h5: is the input, which would be lost"):
        cli.dispatch(line.split())
    assert (tmp_path / "r.h5").read_text() == "1\n" * 16


def test_a_flow_that_goes_on_elsewhere_leaves_what_it_goes_on_from(tmp_path):
    line = f"flow --n 16 --phi 0.5 --model RD0 --rate 0.1 --strain 0.02 --out {tmp_path}/f.h5"
    assert cli.dispatch(line.split()) == 0
    before = (tmp_path / "f.h5").read_bytes()
    for more, message in (
        (f"--out {tmp_path}/g.h5 --last {tmp_path}/f.h5", "is the input"),
        (f"--out {tmp_path}/g.h5 --last {tmp_path}/g.h5", "another file that this run writes"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=message):
            cli.dispatch(f"flow {tmp_path}/f.h5 --strain 0.02 {more}".split())
    assert (tmp_path / "f.h5").read_bytes() == before and len(list(tmp_path.iterdir())) == 1
    assert cli.dispatch(f"flow {tmp_path}/f.h5 --strain 0.02 --out {tmp_path}/g.h5".split()) == 0
    assert (tmp_path / "f.h5").read_bytes() == before
    assert load(tmp_path / "g.h5")["strain"][-1] == pytest.approx(0.04, rel=0.1)


@pytest.mark.parametrize(
    "more",
    [
        "--rate 0.1",
        "--model RD0",
        "--seed 1",
        "--discard 0.1",
        "--step 0.01",
        "--snapshots 1",
        "--tolerance 1e-5",
        "--mass 1",
        "--law stokes",
        "--n 16",
        "--walls",
    ],
)
def test_a_flow_that_goes_on_has_its_settings(more):
    with pytest.raises(InputError, match=rf"{more.split()[0]}: f\.h5 goes on as it was begun; leave it out"):
        flow._refuse_settled(words(f"flow f.h5 --strain 1 {more}"))
    flow._refuse_settled(words("flow f.h5 --strain 1 --out g.h5 --last p.h5"))


@pytest.mark.parametrize(("seed", "fresh"), [(None, False), (0, True), (5, True)])
def test_a_packing_is_made_from_where_its_task_says(tmp_path, monkeypatch, seed, fresh, capsys):
    asked = []

    def make(start, target, solver, **how):
        asked.append((start, target, solver, how["fresh"], how["team"]))
        return published().with_record(
            pressure=1e-3,
            phi=0.8,
            coordination=4.0,
            rattlers=0,
            max_force=1e-12,
            tolerance=1e-6,
            evaluations=3,
        )

    monkeypatch.setattr("jampetsc.packing.protocols.make_packing", make)
    task = packtasks.Task(tmp_path / "p.h5", seed, Target(1e-3, tolerance=1e-6))
    start = lambda seed, target: ("start", seed, target)  # noqa: E731
    assert pack._make([task], start, {"stabilise": "volume"}, "solver", "team", SimpleNamespace(rank=0)) == []
    assert asked == [(("start", seed, task.target), task.target, "solver", fresh, "team")]
    record = read_packing(tmp_path / "p.h5").record
    assert record["requested_pressure"] == 1e-3 and record["stabilise"] == "volume"
    assert record.get("seed") == seed and capsys.readouterr().out.startswith(
        f"{tmp_path}/p.h5: N = 16, p = 0.001"
    )

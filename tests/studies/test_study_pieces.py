"""The pieces of a study, each by itself: tasks, durations, numbers, lock, journal, table."""

import dataclasses
import errno
import fcntl
import functools
import os
import re
import socket
import time

import numpy as np
import pytest
from samples import published, stored

import jampetsc
from jampetsc import main as cli
from jampetsc.analysis.jammed_samples import independent_share
from jampetsc.analysis.statistics import half_width
from jampetsc.errors import InputError
from jampetsc.io.atomic import locked
from jampetsc.io.packing_file import write_packing
from jampetsc.io.request import Request
from jampetsc.io.result_file import ResultWriter
from jampetsc.io.results import count_notes
from jampetsc.studies import journal, study_job, study_run
from jampetsc.studies.journal import Claims, Lock, keep_record, records_of
from jampetsc.studies.plan import plan, read
from jampetsc.studies.study_table import numbers_of, rows_of, table_text
from jampetsc.studies.task_runner import TaskRunner, row_of


@functools.cache
def tasks(text):
    return plan("s.toml", text.encode())


PACK = '[pack]\nn = 16\npressure = 1e-2\nseeds = "1:2"\n'


MEAN = '[sweep]\nomega = "1"\nfields = "1"\n[correlate]\n'


def of(found, command):
    return [task for task in found if task.command == command]


# What STUDY.toml asks for


def test_what_is_asked_for_twice_is_done_once():
    found = tasks(PACK + "[[modes]]\ncount = 3\n[[modes]]\ncount = [3, 4]\n")
    assert len(of(found, "modes")) == 4 and len({task.name for task in found}) == len(found) == 6


def test_what_reads_it_reads_it_once():
    pack = PACK.replace("[pack]", "[[pack]]")
    sweeps = '[[sweep]]\nomega = "1"\nfields = "1"\n' * 2
    found = tasks(pack * 2 + sweeps + "[correlate]\n[spectrum]\n")
    assert [task.command for task in found] == ["pack"] * 2 + ["sweep"] * 2 + ["spectrum"] * 2 + ["correlate"]
    (mean,) = of(found, "correlate")
    assert [one.columns["seed"] for one in mean.inputs] == [1, 2]


def test_only_what_suits_is_read():
    text = PACK + '[sweep]\nmethod = ["rational", "direct"]\nomega = "1"\n[spectrum]\n'
    found = of(tasks(text), "spectrum")
    assert [task.inputs[0].columns["method"] for task in found] == ["rational"] * 2


def test_a_table_may_choose_what_it_begins_with():
    text = PACK.replace("1e-2", '[1e-2, 1e-3, "1e-4"]') + '[[sweep]]\nfields = "1"\nomega = "1"\n'
    more = "[[sweep]]\nbeta = [0, 2]\nwhere = {pressure = [1e-4, 1e-3], seed = 2}\n"
    found = of(tasks(text + more), "sweep")
    chosen = [(t.columns["pressure"], t.columns["seed"]) for t in found if "beta" in t.columns]
    assert len(found) == 6 + 4 and chosen == [(1e-3, 2), (1e-4, 2)] * 2
    (mean,) = of(tasks(text + "[correlate]\nwhere = {pressure = 1e-3}\n"), "correlate")
    assert mean.columns["pressure"] == 1e-3 and len(mean.inputs) == 2


def test_a_flow_begins_with_disks_of_its_own_or_with_packings():
    words = 'model = "RD0"\nrate = 1e-2\nstrain = 0.1\n'
    (alone,) = tasks(f"[flow]\nn = 16\nphi = 0.8\n{words}")
    assert (alone.inputs, alone.level) == ((), 0)
    found = of(tasks(f"{PACK}[flow]\n{words}"), "flow")
    assert [(len(task.inputs), task.level) for task in found] == [(1, 1)] * 2


def test_a_correlation_takes_all_seeds_of_one_kind_and_keeps_its_name():
    text = PACK.replace("1e-2", "[1e-2, 1e-3]") + MEAN.replace(
        "[correlate]", "beta = [1.0, 0.1]\n[correlate]"
    )
    found = of(tasks(text), "correlate")
    assert [len(task.inputs) for task in found] == [2] * 4
    for task in found:
        assert {one.columns["beta"] for one in task.inputs} == {task.columns["beta"]}
        assert {one.columns["pressure"] for one in task.inputs} == {task.columns["pressure"]}
        assert "seed" not in task.columns and task.level == 2
    more = of(tasks(text.replace("1:2", "2:4")), "correlate")
    assert [task.name for task in more] == [task.name for task in found]
    assert [len(task.inputs) for task in more] == [3] * 4
    one = of(tasks(text.replace('seeds = "1:2"', "seed = 7")), "correlate")
    assert [task.name for task in one] == [task.name for task in found] and "seed" not in one[0].columns


LADDER = PACK.replace("1e-2", "[1e-2, 1e-3, 1e-4]") + "ladder = true\n"


def test_a_packing_of_a_ladder_reads_the_one_at_the_pressure_before_it():
    found = tasks(LADDER)
    rungs = {(one.columns["seed"], one.columns["pressure"]): one for one in found}
    assert len(rungs) == len({one.name for one in found}) == 6
    alone = {one.name for one in tasks(LADDER.replace("true", "false"))}
    assert alone == {one.name for one in tasks(PACK.replace("1e-2", "[1e-2, 1e-3, 1e-4]"))}
    for seed in (1, 2):
        first, second, third = (rungs[seed, pressure] for pressure in (1e-2, 1e-3, 1e-4))
        assert (first.inputs, second.inputs, third.inputs) == ((), (first,), (second,))
        assert first.name in alone and not {second.name, third.name} & alone
        assert "ladder" not in first.columns and second.columns["ladder"] is third.columns["ladder"] is True
        assert third.name.startswith(f"pack-n16-p0.0001-s{seed}-") and third.level == 2
    assert rungs[2, 1e-4].words == [
        *("jampetsc", "pack", "--out", rungs[2, 1e-4].file, "--pressure", "0.0001"),
        *("--from", rungs[2, 1e-3].file),
    ]


def test_a_ladder_is_another_one_from_where_its_pressures_differ():
    names = [one.name for one in tasks(LADDER)]
    lower = [one.name for one in tasks(LADDER.replace("1e-4", "1e-4, 1e-5"))]
    assert set(names) < set(lower) and len(lower) == 8
    between = [one.name for one in tasks(LADDER.replace("1e-4", "3e-4, 1e-4"))]
    assert set(between) & set(names) == set(names[:4]) and len(between) == 8
    upward = [one.name for one in tasks(LADDER.replace("1e-2, 1e-3, 1e-4", "1e-4, 1e-3, 1e-2"))]
    assert not set(upward) & set(names)


def test_a_study_may_have_both_ladders_and_independent_packings():
    found = tasks(
        LADDER.replace("true", "[false, true]") + "[modes]\nwhere = {ladder = true}\n[quasistatic]\n"
    )
    assert [len(of(found, name)) for name in ("pack", "modes", "quasistatic")] == [10, 4, 10]
    for task in of(found, "modes"):
        assert task.columns["ladder"] is True and task.columns["pressure"] < 1e-2
    seeds = of(tasks(LADDER + MEAN), "correlate")
    assert [(len(task.inputs), task.level) for task in seeds] == [(2, 2), (2, 3), (2, 4)]


def test_columns_of_a_mean_are_those_of_all_that_it_is_of():
    """One packing says in so many words what the other has by default."""
    pack = PACK.replace("[pack]", "[[pack]]")
    packs = pack.replace('seeds = "1:2"', 'seed = 1\nstabilise = "volume"') + pack.replace("1:2", "2:2")
    (mean,) = of(tasks(packs + MEAN), "correlate")
    assert ["stabilise" in one.columns for one in mean.inputs] == [True, False]
    assert mean.columns["n"] == 16 and not {"stabilise", "seed"} & mean.columns.keys()


def test_what_a_task_is_asked_for_itself_tells_its_columns():
    text = PACK.replace('seeds = "1:2"', "seed = 4\ntolerance = 1e-9")
    (made,) = of(tasks(text + "[flow]\nmodel = 'RD0'\nrate = 1e-2\nstrain = 0.1\ntolerance = 1e-3\n"), "flow")
    assert made.columns["tolerance"] == 1e-3 and made.columns["seed"] == 4 and made.columns["n"] == 16


def test_a_task_keeps_its_name_whatever_else_is_asked_for():
    text = '[pack]\nn = 16\npressure = 0.01\nseed = [1, 2]\n[sweep]\nlaw = "contact"\n'
    names = [task.name for task in tasks(text)]
    other = text.replace("0.01", '["1e-2", 1e-3]').replace("seed = [1, 2]", 'seeds = "1:9"')
    more = [task.name for task in tasks(other + "beta = [1.0, 2.0]\n[modes]\n")]
    assert len(more) == len(set(more)) == 18 + 36 + 18 and set(names[:2]) <= set(more)
    assert tasks(text)[2].words == ["jampetsc", "sweep", f"{names[0]}.h5", "--out", f"{names[2]}.h5"]


def test_a_value_and_its_text_are_the_same_task_and_a_default_is_no_other():
    plain = [task.name for task in tasks(PACK + "[sweep]\n")]
    same = PACK.replace("1e-2", '"0.01"') + '[sweep]\nbeta = "1e0"\nno-prestress = false\naccuracy = 1e-6\n'
    assert [task.name for task in tasks(same)][:2] == plain[:2]
    assert [task.name for task in tasks(PACK + "[sweep]\naccuracy = 1e-6\nno_prestress = false\n")] == plain
    assert [task.name for task in tasks(PACK + "[sweep]\naccuracy = 1e-7\n")][2:] != plain[2:]


REFUSED = [  # STUDY.toml, how the message goes on behind its name
    ("[pack", "not TOML ("),
    ("a = " + 5000 * "[" + 5000 * "]", "brackets nested too deeply"),
    ("", "no table. Add [pack] and"),
    ("[swep]", "swep: no table of a study has this name; did you mean sweep?"),
    ("[xyz]", "xyz: no table of a study has this name; there are pack, "),
    ("pack = 3", "pack = 3: not a table. Write [pack]"),
    ("pack = []", "pack = []: not a table. Write [pack]"),
    ("[pack]\nm = 3", "[pack]: m: no such option"),
    ("[pack]\nsead = 3", "[pack]: sead: no such option; did you mean seed?"),
    *((f'[flow]\n{key} = "x"', f"[flow]: {key}: set by the study. Leave it out")
      for key in ("out", "packing", "last")),
    *((f"[flow]\n{key} = 1", f"[flow]: {key}: no such option") for key in ("hel", "ouut", "packin", "lastt")),
    ("[modes]\nseeds = 3", "[modes]: seeds: no such option"),
    ("[pack]\nwhere = {n = 16}", "[pack]: where: no such option"),
    ("[pack]\nn = []", "[pack]: n = []: empty. Give at least one value"),
    ("[pack]\nn = true", "[pack]: n = true: must be a number, a string or a list of them"),
    ("[pack]\nn = [16, [17]]", "[pack]: n = [17]: must be a number"),
    ("[pack]\nn = 16.5\npressure = 1", "[pack]: n 16.5: must be a whole number"),
    ("[pack]\nn = 16", "[pack]: pressure, phi: missing. Give one of them"),
    ('[pack]\nn = 16\npressure = ["1e-4", "1e-2,1e-3"]',
     "[pack]: pressure 1e-2,1e-3: not a single value. Give a list of them in the table [pack]"),
    ('[pack]\nn = 16\npressure = 1e-2\nseed = "1:3"', "[pack]: seed 1:3: not a single value. Give a list"),
    (f"[pack]\nn = 16\nphi = 1{400 * '0'}", "[pack]: phi inf: must lie in"),
    (f"[pack]\nn = 1{5000 * '0'}", "not TOML ("),
    ("[pack]\nn = 16\npressure = 7.0", "[pack]: pressure 7: must lie in"),
    ('[pack]\nn = 16\npressure = 1e-2\nseeds = "2:1"', "[pack]: seeds 2:1: must have a last seed"),
    ("[pack]\nn = 16\nphi = [0.9, 0.88]\nladder = true", "[pack]: ladder: a ladder without pressures"),
    *((f"[pack]\nn = 16\npressure = 1e-2\nladder = {value}", f"[pack]: ladder = {value}: must be true, false or a list")
      for value in ("1", "[]", "[0, 1]")),
    (PACK + "[modes]\nladder = true", "[modes]: ladder: no such option"),
    ('[pack]\nn = [16, 32]\nphi = [0.9, 0.95]\nseeds = "1:1000000"', "[pack]: too many tasks, 4000000 (at"),
    (PACK.replace("1:2", "1:300") + f"[sweep]\nbeta = {[0.1] * 333}",
     "[sweep]: too many tasks, 99900 with the 300 before them (at most 100000)"),
    ("[modes]", "[modes]: needs packings. Add a table [pack]"),
    ('[flow]\nmodel = "RD0"', "[flow]: needs packings. Add a table [pack] or n"),
    (PACK + '[sweep]\nmethod = "direct"\n[spectrum]',
     "[spectrum]: needs sweeps of strains with method rational. Add a table [sweep]"),
    (PACK + "[modes]\nwhere = {pressure = 0.1}", "[modes]: where: no task with pressure = 0.1"),
    (PACK + "[[modes]]\n[[modes]]\ncount = 0", "[modes] number 2: count 0: must be at least 1"),
    (PACK + "[modes]\nwhere = 3", "[modes]: where = 3: not a table. Write e.g. where = {pressure = 1e-4}"),
    ("[sweep]\nno-prestress = 1", "[sweep]: no-prestress = 1: a switch must be true or false"),
    (PACK + '[sweep]\nlaw = "stoke"', "[sweep]: law stoke: not supported. Choose one of contact, stokes"),
    (PACK + "[sweep]\nbeta = [1.0, -1.0]", "[sweep]: beta -1: must lie"),
    (PACK + '[sweep]\nlaw = "stokes"\nbeta = 1', "[sweep]: beta: an option of law contact"),
    (PACK + "[sweep]\nlaw = 'stokes'\neta-f = -1", "[sweep]: eta-f -1: must lie"),
    ("[sweep]\neta-f = 1\neta_f = 2", "[sweep]: eta-f: given twice"),
    (PACK + "[correlate]", "[correlate]: needs sweeps with fields"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), REFUSED, ids=lambda text: text[-30:])
def test_what_cannot_be_run_is_refused_with_file_table_and_key(text, message):
    with pytest.raises(InputError) as refused:
        tasks(text)
    said = str(refused.value)
    assert said.startswith(f"s.toml: {message}")
    assert not any(f"did you mean {own}?" in said for own in ("help", "out", "packing", "last"))


@pytest.mark.parametrize(
    ("seeds", "expected"), [("3", [3]), ("[5, 1]", [5, 1]), ('"2:4"', [2, 3, 4]), ('["7", 8]', [7, 8])]
)
def test_seeds_may_be_told_in_any_way(seeds, expected):
    assert [task.columns["seed"] for task in tasks(PACK.replace('"1:2"', seeds))] == expected


@pytest.mark.parametrize(
    ("given", "label"),
    [
        ("n = 1024\npressure = 1e-3\nseed = 1", "n1024-p0.001-s1"),
        ("n = 16\nphi = 0.843217", "n16-phi0.843217"),
        ('n = "16"\npressure = "1.25e-7"\nseed = 30', "n16-p1.25e-07-s30"),
    ],
)
def test_the_name_of_a_file_tells_what_it_is_about(given, label):
    (task,) = tasks(f"[pack]\n{given}\n")
    assert task.name.startswith(f"pack-{label}-") and len(task.name.rpartition("-")[2]) == 8
    assert task.file == f"{task.name}.h5"
    assert task.words[:4] == ["jampetsc", "pack", "--out", task.file]


def test_reading_a_study_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match=r"s\.toml: not readable \(No such file or directory\)"):
        read(tmp_path / "s.toml")
    (tmp_path / "s.toml").write_bytes(b"[pack]\n\xff")
    assert read(tmp_path / "s.toml") == b"[pack]\n\xff"
    with pytest.raises(InputError, match=r"s\.toml: not TOML \("):
        plan("s.toml", b"[pack]\n\xff")


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ('"1e-3"', ["--below", "0.001"]),
        ("0.30000000000000004", ["--below", "0.30000000000000004"]),
        ("0.5\nno-prestress = true", ["--below", "0.5", "--no-prestress"]),
        ("0.5\nno-prestress = false", ["--below", "0.5"]),
        ("0.5\nno-eigenvectors = true", ["--below", "0.5", "--no-eigenvectors"]),
    ],
)
def test_words_of_a_value(value, words):
    task = of(tasks(f"{PACK}[modes]\nbelow = {value}\n"), "modes")[0]
    assert task.words[5:] == words and task.settings.options["below"] == float(words[1])


# How long tasks take


def record(command, seconds, state="done"):
    return {"state": state, "seconds": seconds, "row": {"command": command}}


def test_the_time_left_follows_from_tasks_that_are_done():
    found = tasks(PACK + '[sweep]\n[modes]\n[flow]\nmodel = "RD0"\nrate = 1e-2\nstrain = 0.1\n')
    sweeps, modes, flows = (of(found, command) for command in ("sweep", "modes", "flow"))
    done = [record("sweep", 2.0), record("sweep", 4.0), record("modes", 9.0), record("flow", 100.0, "failed")]
    durations = study_run.TaskDurations(done)
    assert durations.remaining(sweeps + modes[:1]) == 15.0
    assert durations.remaining(flows) == 10.0 and durations.remaining([]) == 0.0
    assert study_run.TaskDurations().remaining(flows) is None


# Large tasks are everybody's


LARGE = PACK.replace("n = 16", "n = [16, 64]").replace('seeds = "1:2"', "seed = 1")
LARGE += '[sweep]\nomega = "1"\n[shear]\nstep = 1e-3\nstrain = 2e-3\n[spectrum]\n'


@pytest.mark.parametrize(
    ("text", "limits", "everybodys", "late"),
    [
        # not packings, nor what one rank does in any case
        (LARGE, {2: 63, 3: 10}, [("sweep", 64)], [("spectrum", 64)]),
        (LARGE, {2: 64, 3: 10}, [], []),
        (LARGE, {}, [], []),
        (LADDER, {2: 10, 3: 10}, [], []),
    ],
)
def test_large_tasks_are_everybodys_and_what_reads_their_files_comes_after_them(
    text, limits, everybodys, late
):
    (_, apart), *rest = study_run.task_groups(tasks(text), limits)
    assert [task.level for task in apart] == sorted(task.level for task in apart)
    told = [(together, [(task.command, task.columns["n"]) for task in some]) for together, some in rest]
    assert told == [(True, everybodys), (False, late)]
    assert len(apart) == len(tasks(text)) - len(everybodys) - len(late)


# What a study says and does beside its tasks


CONTENT = {  # command -> format and arrays
    "sweep": ("sweep", {"omega": [1.0], "G": [1j], "error_bound": [0.0]}),
    "modes": ("modes", {"eigenvalues": [1.0], "participation_ratio": [1.0], "floppiness": [1.0]}),
    "correlate": (
        "correlation",
        {"omega": [1.0], "length": np.ones((1, 1, 2)), "length_error": np.ones((1, 1, 2))},
    ),
}


def make(job, out, argv, overwrite):
    """In place of a run: the file of a task at once."""
    if job.NAME == "pack":
        write_packing(out, published())
    else:
        kind, arrays = CONTENT[job.NAME]
        stored(out, kind, arrays, pressure=1.0, k=1.0)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_a_study_says_how_far_it_is_and_keeps_new_records_alone(
    session, shared_path, capsys, monkeypatch, reporting
):
    """Rank 0 does all tasks; those of modes are expected to take 30 000 s, in which the other rank would help."""
    monkeypatch.setattr(study_run, "ESTIMATE_INTERVAL", -1.0)
    (shared_path / "journal").mkdir(exist_ok=True)
    found, calls = list(tasks(PACK + "[modes]\n")), []

    def make_or_fail(job, out, argv, overwrite):
        calls.append(job.NAME)
        if len(calls) == 2:
            raise InputError("no")
        make(job, out, argv, overwrite)

    def run(records):
        claims = session.comm.bcast(Claims(shared_path) if session.rank == 0 else None)
        runner = TaskRunner(shared_path, records, execute=make_or_fail)
        work = study_run.StudyRanks(session, runner, claims, found, lambda: None)
        capsys.readouterr()
        work.run_separately(found if session.rank == 0 else [])
        return [record["task"] for record in work.new_records], capsys.readouterr().err.splitlines()

    earlier = {"z": {"task": "z", **record("modes", 3e4)}}
    new, said = run(earlier)
    assert session.rank or new == [task.name for task in found]
    both, one = ("17 h", "4.2 h") if session.size == 1 else ("8.3 h", "2.1 h")
    expected = [
        f"[1/4] {found[0].file}; {both} left",
        f"[2/4] {found[1].file}: no; 1 failed; {both} left",
        f"[3/4] {found[2].file}; 1 failed; {one} left",
        f"[4/4] {found[3].file}: {found[1].file} failed; 2 failed",
    ]
    assert session.rank or [re.sub(r" \S+ s;", ";", line) for line in said] == expected
    new, said = run(earlier | records_of(shared_path))
    assert session.rank or (new == [found[1].name, found[3].name] and len(said) == 4)
    assert calls == (["pack", "pack", "modes", "pack", "modes"] if session.rank == 0 else [])


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_a_summary_lists_a_few_failures(session, tmp_path, capsys, monkeypatch):
    """Three fail, twice: the list is too long first, and just long enough then."""
    (tmp_path / "s.toml").write_text(PACK.replace("1:2", "1:1") + "[modes]\ncount = [97, 98, 99]\n")
    words = ["study", str(tmp_path / "s.toml"), "--out", str(tmp_path / "study")]
    for limit, more in ((2, ["  … and 1 more, see the table"]), (3, [])):
        monkeypatch.setattr(study_job, "MAX_LISTED_FAILURES", limit)
        assert cli.dispatch(words) == study_job.FAILURE_STATUS
        first, *failures = capsys.readouterr().out.splitlines()
        assert first.startswith(f"{tmp_path / 'study' / 'table.csv'}: 4 tasks, 3 failed, ")
        table = jampetsc.load(tmp_path / "study")
        listed = zip(table["file"][1 : limit + 1], table["state"][1:], strict=False)
        assert failures == [f"  {file}: {state}" for file, state in listed] + more


def test_notes_are_counted_by_command_and_kind():
    notes = {"0.h5": "few: 7; unstable to shear: G0 = -1", "1.h5": "few: 9", "2.h5": None}
    rows = [{"file": file, "command": "sweep", "notes": text} for file, text in notes.items()]
    assert count_notes([*rows, {"file": "3.h5", "command": "pack"}]) == [
        "  note in 2 of 3 sweep tasks, which count like the others: few: 7 (0.h5)",
        "  note in 1 of 3 sweep tasks, which count like the others: unstable to shear: G0 = -1 (0.h5)",
    ]


# The numbers of a file


def result(path, kind, attributes=(), **arrays):
    return stored(path, kind, arrays, **dict(attributes))


def test_numbers_of_a_file_are_its_scalars_and_the_few_words_that_a_row_tells(tmp_path):
    attributes = {
        "particle_count": 16, "prestress": True, "eta0": np.float64(0.5), "law": "contact", "argv": "x", "ranks": 2,
        "wall_seconds": 1.0, "negative_modes": 0, "numpy_version": "3", "sizes": "bidisperse", "method": "direct",
        "notes": "few: 7",
    }  # fmt: skip
    found = numbers_of(result(tmp_path / "q.h5", "quasistatic", attributes.items()))
    words = {"law": "contact", "method": "direct", "notes": "few: 7"}
    assert found == {"n": 16, "prestress": 1, "eta0": 0.5, **words}
    assert type(found["prestress"]) is int
    write_packing(tmp_path / "p.h5", published().with_record(phi=0.5, seed=3, protocol="quench"))
    found = numbers_of(tmp_path / "p.h5")
    assert (found["n"], found["seed"]) == (published().n, 3) and found["phi"] == published().phi
    assert "protocol" not in found


LENGTHS = np.arange(12.0).reshape(2, 3, 2)  # lane, frequency, part
JAM = {
    "phi": [0.84] * 4,
    "seed": [1, 2, 3, 4],
    "jammed": [1.0, 0.0, np.nan, 1.0],
    "phi_J": [0.84, np.nan, np.nan, 0.86],
    "segregation": [np.nan] * 4,
}


@pytest.mark.parametrize(
    ("kind", "arrays", "expected"),
    [
        ("modes", {"eigenvalues": [0.1, 0.2], "participation_ratio": [0.5, 0.6], "floppiness": [2.0, 3.0]},
         {"lowest_eigenvalue": 0.1, "lowest_participation": 0.5, "lowest_floppiness": 2.0}),
        ("correlation", {"omega": [1.0, 1e-3, 0.1], "length": LENGTHS, "length_error": -LENGTHS},
         {"omega": 1e-3, "length_storage": 2.0, "length_loss": 3.0, "length_storage_error": -2.0,
          "length_loss_error": -3.0}),
        ("jam", JAM,
         {"samples": 4, "jammed_fraction": 2 / 3, "jammed_fraction_error": independent_share([1, 0, 1]).error,
          "jammed_fraction_samples": 3, "phi_J": 0.85, "phi_J_error": 0.01 * half_width(1)}),
        ("jam", {"phi": [0.84], "seed": [1], "jammed": [1.0], "phi_J": [0.84]},
         {"samples": 1, "jammed_fraction": 1.0, "jammed_fraction_error": 0.25, "jammed_fraction_samples": 1,
          "phi_J": 0.84}),
    ],
)  # fmt: skip
def test_numbers_of_arrays(tmp_path, kind, arrays, expected):
    assert numbers_of(result(tmp_path / "a.h5", kind, **arrays)) == pytest.approx(expected)


ENDS = np.array([2.0**-10, 0.01, 0.02, 0.05, 0.1])  # of the critical branch at p = ENDS[0]/10
BOTH = ["storage", "loss"]


@pytest.mark.parametrize(
    ("x", "storage", "loss", "known"),
    [
        (ENDS, 1, 1, BOTH),
        (ENDS[1:], 1, 1, []),  # four are too few
        (ENDS * [1 - 1e-9, 1, 1, 1, 1], 1, 1, []),
        (ENDS * [1, 1, 1, 1, 1 + 1e-9], 1, 1, []),
        (ENDS, [1, 1, -1, 1, 1], 1, ["loss"]),
        (ENDS, 1, [1, 1, -1, 1, 1], ["storage"]),
        (np.outer([1e-3, 1, 1e3], ENDS).ravel(), np.repeat([7, 1, 3], 5), 1, BOTH),  # nothing beside it
    ],
)
@pytest.mark.parametrize(("k", "tau1"), [(1.0, 1.0), (64.0, 0.25)])
def test_slopes_of_a_sweep_are_those_of_its_critical_branch(tmp_path, x, storage, loss, known, k, tau1):
    G = k * (np.multiply(storage, x**0.5) + 1j * np.multiply(loss, x**0.4))
    attributes = {"pressure": ENDS[0] / 10.0 * k, "k": k, "tau1": tau1}
    arrays = {"omega": x / tau1, "G": G, "error_bound": np.zeros(len(x))}
    found = numbers_of(result(tmp_path / "s.h5", "sweep", attributes.items(), **arrays))
    slopes = {name.removeprefix("exponent_"): one for name, one in found.items() if "exponent" in name}
    assert slopes == pytest.approx({name: {"storage": 0.5, "loss": 0.4}[name] for name in known})


def test_a_sweep_that_reaches_its_plateau_tells_it(tmp_path):
    omega = np.geomspace(1e-8, 1e-2, 13)
    arrays = {"omega": omega, "G": 0.3 + 2j * omega, "error_bound": np.zeros(13)}
    attributes = {"pressure": 1e-4, "k": 1.0}
    found = numbers_of(result(tmp_path / "s.h5", "sweep", attributes.items(), **arrays))
    assert [found[name] for name in ("G0", "eta0", "omega_star")] == pytest.approx([0.3, 2.0, 0.15])


# One study in a folder


def test_a_lock_tells_who_has_it_while_it_is_held_and_ends_with_its_machine(tmp_path):
    file, here = tmp_path / "lock", f"{socket.gethostname()} {os.getpid()}\n"
    Lock(tmp_path).release()  # was never taken
    file.write_text(f"{socket.gethostname()} 1234567890123\n")  # of a study that was killed here
    lock = Lock(tmp_path)
    lock.take()
    assert file.read_text() == here and [path.name for path in tmp_path.iterdir()] == ["lock"]
    handles = len(os.listdir("/proc/self/fd"))
    mine = here.split()
    with pytest.raises(
        InputError, match=rf"runs there \(process {mine[1]} on {mine[0]}\)\. Wait for it, .*folder\.$"
    ):
        Lock(tmp_path).take()
    assert len(os.listdir("/proc/self/fd")) == handles  # what was refused keeps nothing open
    lock.release()
    assert file.read_text() == ""
    with open(file, "a+") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        with pytest.raises(InputError, match=r"\(process \? on another machine\)"):
            Lock(tmp_path).take()
    assert 4 * journal.TOUCH_INTERVAL <= journal.MAX_TOUCH_AGE == 120.0
    for age in (60, 121):  # since another machine has touched it
        file.write_text("elsewhere 123\n")
        os.utime(file, (time.time() - age,) * 2)
        if age < journal.MAX_TOUCH_AGE:
            with pytest.raises(InputError, match=r"process 123 on elsewhere.*its lock expires in (5|6)\d s"):
                Lock(tmp_path).take()
            assert os.listdir(tmp_path) == ["lock"]  # the clock was read without a trace
            assert len(os.listdir("/proc/self/fd")) < handles  # that of the lock was among them
    file.write_text("elsewhere 123\n")
    os.utime(file, (2.3e9,) * 2)  # in 2042
    with pytest.raises(
        InputError, match=r"Its lock has a time in the future \(2042-11-\d\d\); if no .* remove .*lock\.$"
    ):
        Lock(tmp_path).take()
    file.write_text("")
    lock.take()
    lock.release()
    with pytest.raises(InputError, match=r"lock: not writable \(No such file or directory\)"):
        Lock(tmp_path / "none").take()


def test_where_files_have_no_locks_only_another_machine_counts(tmp_path, monkeypatch):
    def refuse(file, how):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    lock = Lock(tmp_path)
    lock.take()
    lock.release()


def test_a_lock_is_touched_until_it_is_released(tmp_path, monkeypatch):
    monkeypatch.setattr(journal, "TOUCH_INTERVAL", 0.005)
    lock, path = Lock(tmp_path), tmp_path / "lock"
    lock.take()
    os.utime(path, (0, 0))
    deadline = time.monotonic() + 20
    while os.stat(path).st_mtime == 0:
        assert time.monotonic() < deadline
        time.sleep(0.002)
    lock.release()
    time.sleep(0.02)
    os.utime(path, (0, 0))
    time.sleep(0.03)
    assert os.stat(path).st_mtime == 0


def run_in(folder, tmp_path):
    """Run a small study in a folder."""
    (tmp_path / "asked.toml").write_text(PACK)
    cli.dispatch(["study", str(tmp_path / "asked.toml"), "--out", str(folder)])


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("name", ["lock", "table.csv", "study.toml", "journal"])
def test_a_study_writes_through_no_link_of_its_folder(session, tmp_path, name):
    """Of a folder that came from others: what the link names was emptied, or received the files."""
    folder, target = tmp_path / "study", tmp_path / "mine"
    (folder / "journal").mkdir(parents=True)
    if name == "journal":
        target.mkdir()
        (folder / name).rmdir()
    else:
        target.write_text("precious")
    (folder / name).symlink_to(target)
    with pytest.raises(InputError, match=rf"{name}: a symbolic link, by which files elsewhere would change"):
        run_in(folder, tmp_path)
    assert list(target.iterdir()) == [] if name == "journal" else target.read_text() == "precious"
    assert {path.name for path in folder.iterdir()} == {"journal", name}


def test_a_task_writes_through_no_link(tmp_path):
    (task, *_) = tasks("[jam]\nn = 16\nphi = 0.8\nseeds = '1:1'\n")
    record, outside = {"task": task.name, "row": {}, "seconds": 1.0}, tmp_path / "outside"
    outside.mkdir()
    folder = tmp_path / "study"
    (folder / "journal").mkdir(parents=True)
    for name in (task.file, f"{task.file}.resume", f"{task.name}.parts", f"journal/{task.name}"):
        (folder / name).symlink_to(outside if name[-1] == "s" or name[-1] == "e" else outside / "file")
        if "/" in name:
            with pytest.raises(InputError, match=f"{name}: a symbolic link"):
                keep_record(folder, record)
        else:
            assert "a symbolic link" in TaskRunner(folder, {}, execute=make).run(task, [])["why"]
        (folder / name).unlink()
    with pytest.raises(OSError, match="symbolic link"):
        (folder / "lock").symlink_to(outside / "file")
        locked(folder / "lock")
    assert list(outside.iterdir()) == []


def test_words_of_the_table_are_no_formulas_of_a_spreadsheet(tmp_path):
    words = ["=1+1", "@SUM(A1)", "-cmd", "+a", "'quoted", "'=b", "plain", "a=b"]
    rows = [{"command": "pack", "state": "done", "file": one, "seconds": -1.5} for one in words]
    text = table_text(rows)
    cells = [line.split(",")[2] for line in text.splitlines()[1:]]
    assert cells == ["'=1+1", "'@SUM(A1)", "'-cmd", "'+a", "''quoted", "''=b", "plain", "a=b"]
    assert {line.split(",")[-1] for line in text.splitlines()[1:]} == {"-1.5"}
    (tmp_path / "table.csv").write_text(text)
    found = jampetsc.load(tmp_path)
    assert found["file"].tolist() == words and found["seconds"].tolist() == [-1.5] * len(words)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_a_study_needs_a_folder(session, tmp_path):
    (tmp_path / "file").touch()
    for path, message in (
        (tmp_path / "file", "file: not a folder. Choose another folder"),
        (tmp_path / "file" / "study", r"not writable \(Not a directory\)"),
    ):
        with pytest.raises(InputError, match=message):
            run_in(path, tmp_path)


# What became of tasks


def test_rows_are_in_the_order_of_the_study_then_what_was_done_before():
    def made(name, state):
        return {"state": state, "why": "no", "seconds": 0.12345, "row": {"command": "pack", "file": name}}

    second, third, first = tasks(PACK.replace("1:2", "1:3"))
    states = {"z": "done", second.name: "failed", first.name: "done", "y": "done", "x": "failed"}
    records = {name: made(name, state) for name, state in states.items()}
    rows = rows_of([first, second, third, first], records)
    assert [(row["file"], row["state"]) for row in rows] == [
        (first.name, "done"), (second.name, "failed: no"), ("y", "done"), ("z", "done"),
    ]  # fmt: skip
    assert {row["seconds"] for row in rows} == {0.123}


def test_columns_of_the_table_are_in_one_order_and_what_is_no_number_is_empty():
    rows = [
        {"seconds": 1.5, "G0": 2.0, "command": "sweep", "held": True, "phi_J": float("nan")},
        {"n": 3, "seconds": 2.5, "command": "pack", "beta": "", "G0": None},
    ]
    assert table_text(rows) == "command,n,G0,held,phi_J,beta,seconds\nsweep,,2.0,1,,,1.5\npack,3,,,,,2.5\n"


@pytest.fixture
def runner(tmp_path):
    """A runner in a folder where every file of a small study is there and recorded."""
    found, made = tasks(PACK + MEAN), TaskRunner(tmp_path, {}, execute=make)
    for task in found:
        made.records[task.name] = made.run(task, task.inputs)
    return made, found


def test_what_is_left(runner):
    runner, found = runner
    pack, sweep_, mean = (of(found, name)[0] for name in ("pack", "sweep", "correlate"))
    all_three = [pack.name, sweep_.name, mean.name]
    packing, file = (
        (runner.folder / task.file, (runner.folder / task.file).read_bytes()) for task in (pack, sweep_)
    )

    def left():
        return runner.unfinished(found)

    assert left() == ([], [])
    for spoil in (lambda: file[0].write_text("another"), file[0].unlink):
        spoil()
        assert left() == ([sweep_.name, mean.name], [sweep_.file])
    file[0].write_bytes(file[1])
    packing[0].write_text("24 disks")
    assert left() == (all_three, [pack.file])
    unchanged = [runner.files_unchanged(runner.records[task.name]) for task in (pack, sweep_, mean)]
    assert unchanged == [False, False, True]  # as to their files and those that they have read
    packing[0].write_bytes(packing[1])
    assert left() == ([], []) and runner.files_unchanged(runner.records[sweep_.name])
    runner.records[pack.name]["state"] = "failed"
    assert left() == (all_three, [])
    del runner.records[pack.name]
    assert left() == (all_three, [])
    found = [mean]
    runner.records[mean.name] = runner.run(mean, mean.inputs[:1])  # it is of a seed more now
    assert left() == ([mean.name], [])


def test_what_was_read_counts_and_is_named_where_it_is_not_there(runner):
    runner, found = runner
    sweep_, mean = of(found, "sweep")[0], of(found, "correlate")[0]
    assert runner.run(mean, mean.inputs[::-1]) is runner.records[mean.name]
    for task in (sweep_, mean):
        made = runner.run(task, [])
        assert (made["state"], made["why"]) == ("failed", f"{task.inputs[0].file} failed")
        assert "digest" not in made and made["row"]["command"] == task.command


def test_a_row_says_what_was_asked_for_before_what_was_found():
    task = of(tasks(PACK + "[sweep]\nno-prestress = true\nbeta = 0.1\n"), "sweep")[0]
    row = row_of(task, {"beta": 5.0, "prestress": 0, "packing": "p.h5"})
    assert row["beta"] == 0.1 and row["packing"] == "p.h5" and row["file"] == task.file
    assert "no_prestress" not in row and row["prestress"] == 0
    assert row_of(task.inputs[0], {})["packing"] == task.inputs[0].file


def test_a_file_is_taken_over_only_from_the_same_job_and_packing(tmp_path):
    task = of(tasks(PACK + "[modes]\n"), "modes")[0]
    (there,), path, packing = task.inputs, tmp_path / task.file, tmp_path / task.inputs[0].file
    job = task.settings.job_of([str(packing)])

    def is_made(task=task):
        made = []
        execute = lambda *words: (made.append(1), make(*words))  # noqa: E731
        assert TaskRunner(tmp_path, {}, execute=execute).run(task, task.inputs)["state"] == "done"
        return bool(made)

    def left_behind(**changed):
        request = Request(dataclasses.replace(job, **changed), task.words)
        with ResultWriter(path, "jampetsc-modes", request=request) as writer:
            for name, values in CONTENT["modes"][1].items():
                writer.dataset(name, values)

    write_packing(packing, published())
    assert is_made()
    left_behind()
    assert not is_made()
    left_behind(count=3)
    assert is_made() and is_made(there)  # of another job
    write_packing(packing, published())
    stored(path, *CONTENT["modes"])  # that does not say with which settings
    assert is_made()
    left_behind()
    write_packing(packing, published().with_record(seed=2))
    assert is_made()
    (tmp_path / f"{task.file}.resume").mkdir()
    (tmp_path / f"{task.file}.resume" / "00000-rank-0000").touch()
    (tmp_path / "other.h5.resume").touch()
    left_behind()
    assert not is_made()
    assert {one.name for one in tmp_path.iterdir()} == {task.file, there.file, "other.h5.resume"}

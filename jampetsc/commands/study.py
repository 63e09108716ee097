"""`jampetsc study`: an ensemble of packings and of what is asked of each, on any number of ranks."""

MANY = 10  # failures that the summary tells

DESCRIPTION = """\
Run every task of STUDY.toml that is not done yet: tables are commands, keys their long options, lists are multiplied
out, and every response runs on every packing. Under mpirun each rank takes the next task as soon as it is free. The
same command continues a study that was stopped, on another number of ranks too; a changed STUDY.toml adds tasks.
Writes FOLDER/table.csv, one row per task; jampetsc.load(FOLDER) reads it."""
EPILOG = """\
STUDY.toml, for instance:

  [pack]                         [[sweep]]
  n = [256, 1024]                beta = [1.0, 1e-3]
  pressure = [1e-2, 1e-3]        omega = "1e-8:1e2:61"
  seeds = "1:20"                 [quasistatic]

A task that fails is a row with its reason and is tried again by the next run; the status is then 3."""


def add_parser(subparsers) -> None:
    """Add `study` to the command line."""
    parser = subparsers.add_parser(
        "study",
        help="an ensemble: packings, responses and their table",
        description=DESCRIPTION,
        epilog=EPILOG,
    )
    parser.add_argument("study", metavar="STUDY", help="what to do (TOML)")
    parser.add_argument("--out", required=True, metavar="FOLDER", help="folder of all its files")
    parser.add_argument(
        "--dry-run", action="store_true", help="print the tasks and an estimate of their cost"
    )
    parser.set_defaults(run=run, family=type(parser), takes_petsc=lambda args: not args.dry_run)


def run(args, petsc_argv) -> int:
    """Do what is left. Collective."""
    import time
    from pathlib import Path

    from jampetsc.commands import parsers_of
    from jampetsc.studies.kinds import KINDS
    from jampetsc.studies.plan import plan, read
    from jampetsc.studies.run import check_folder

    began = time.perf_counter()
    parsers = parsers_of(args.family, KINDS)
    folder = Path(args.out)
    if args.dry_run:
        check_folder(folder, args.study)
        print(_outlook(plan(args.study, read(args.study), parsers), folder, parsers))
        return 0

    from jampetsc import session
    from jampetsc.collective import by_rank_0
    from jampetsc.solvers import eigen, inertia, local, shifted
    from jampetsc.solvers.rehearsal import rehearse
    from jampetsc.storage.ensemble import TABLE
    from jampetsc.studies import run as study

    running = session.start("real", petsc_argv)
    content = by_rank_0(
        running.comm, lambda: read(args.study)
    )  # of one rank for all: it may be edited meanwhile
    tasks = plan(args.study, content, parsers)
    rehearse(local.rehearse, shifted.rehearse, inertia.rehearse, eigen.rehearse)
    rows = study.run(tasks, folder, parsers, args.study, content, running)
    failures = [row for row in rows if row["state"] != "done"]
    if running.rank == 0:
        print(_summary(folder / TABLE, rows, failures, study.elapsed(began)))
    return 3 if failures else 0


def _summary(table, rows, failures, elapsed) -> str:
    """What a user wants to read after a study."""
    lines = [f"{table}: {len(rows)} tasks, {len(failures)} failed, {elapsed}"]
    for row in failures[:MANY]:
        lines.append(f"  {row['file']}: {row['state']}")
    if len(failures) > MANY:
        lines.append(f"  … and {len(failures) - MANY} more, see the table")
    unstable = [row for row in rows if row.get("G0", 0.0) < 0]
    if unstable:
        lines.append(
            f"  G0 < 0 in {len(unstable)} of {sum('G0' in row for row in rows)} rows: kept in the averages"
        )
    return "\n".join(lines)


def _outlook(tasks, folder, parsers) -> str:
    """The tasks, which of them are done, and what the others may cost."""
    from jampetsc.studies.costs import Costs, in_words
    from jampetsc.studies.journal import records_of
    from jampetsc.studies.run import told_of
    from jampetsc.studies.tasks import Runner

    records = records_of(folder)
    costs = Costs(records.values())
    names, changed = Runner(folder, parsers, records).left(tasks)
    names = set(names)
    left = [task for task in tasks if task.name in names]
    lines = [f"{'to do' if task.name in names else 'done '}  {' '.join(task.words)}" for task in tasks]
    for command in dict.fromkeys(task.command for task in tasks):
        mine = [task for task in left if task.command == command]
        known = any(
            record["state"] == "done" for record in records.values() if record["row"]["command"] == command
        )
        guess = "" if known or not mine else ", by a rough rule until some are done"
        lines.append(f"{command}: {len(mine)} to do, about {in_words(costs.total(mine))} on one rank{guess}")
    if changed:
        lines.append(told_of(changed))
    lines.append(f"{len(left)} of {len(tasks)} tasks to do, about {in_words(_sum(costs, left))} on one rank")
    return "\n".join(lines)


def _sum(costs, tasks):
    """Seconds of all tasks where there is an estimate for each command, else None."""
    totals = [
        costs.total([task for task in tasks if task.command == command])
        for command in {task.command for task in tasks}
    ]
    return None if None in totals else sum(totals)

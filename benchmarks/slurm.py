"""Job scripts of run/slurm on a Slurm of one node, which is set up for them on the loopback of this machine.

    .venv/bin/python benchmarks/slurm.py [--ranks 3] [--mpi pmix] [--keep FOLDER]

As root on Debian or Ubuntu. Slurm and munge are installed by apt if they are missing; no service is started. munged,
slurmctld and slurmd run from a temporary folder while the program lasts, and end with it and with whatever they have
started. The node is given more cores and memory than the machine may have, so that the scripts need no other heads.

Each line is one job, as it was submitted, with its seconds and what was checked. The program ends with 1 if a job did
not do what its script says.
"""

import argparse
import contextlib
import ctypes
import glob
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import environment, machine

import jampetsc

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = {"munged": "munge", "slurmctld": "slurmctld", "slurmd": "slurmd", "sbatch": "slurm-client"}
CORES, MEMORY = 16, 256_000  # that the node claims; MB
PMIX = "libpmix-dev", "/usr/lib/*/pmix2/lib/libpmix.so"  # by this name Debian's Slurm loads PMIx
START_TIME = 60.0  # seconds in which the node must become idle
JOB_TIME = 600.0
SUBREAPER = 36  # PR_SET_CHILD_SUBREAPER: what the daemons leave becomes a child of this process

CONFIGURATION = """
ClusterName=loopback
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller}
SlurmdPort={node}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SlurmdParameters=config_overrides
ReturnToService=2
MpiDefault=none
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory={memory} State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ranks", type=int, default=3)
    parser.add_argument("--mpi", default="pmix", help="of srun; pmix is what the scripts have")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="where logs and results stay")
    args = parser.parse_args()
    if os.getuid() != 0:
        sys.exit("benchmarks/slurm.py: needs root, for munge and for jobs. Run it with sudo.")
    install_missing()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    ctypes.CDLL(None).prctl(SUBREAPER, 1, 0, 0, 0)
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="slurm-")))
        stack.callback(copy_results, folder, args.keep)
        stack.callback(end_children)
        start_daemons(folder)
        version = run(["sinfo", "--version"]).stdout.strip()
        print(f"{version}, {mpi_version()}, {machine()}", flush=True)
        checks = (
            check_launcher,
            check_ensemble,
            check_continuation,
            check_mpirun,
            check_figure,
            check_scaling,
        )
        failures = [check(folder, args) for check in checks]
    sys.exit(any(failures))


def install_missing():
    """Install the packages of missing programs; apt is kept from starting services."""
    missing = sorted({package for program, package in PROGRAMS.items() if not shutil.which(program)})
    package, library = PMIX
    if not glob.glob(library):
        missing.append(package)
    if not missing:
        return
    if not shutil.which("apt-get"):
        sys.exit(f"{' '.join(missing)}: not installed, and apt-get is missing. Install them.")
    print(f"installing {' '.join(missing)}", flush=True)
    quiet = os.environ | {"DEBIAN_FRONTEND": "noninteractive", "RUNLEVEL": "1"}
    for words in (["update"], ["install", "-y", "--no-install-recommends", *missing]):
        done = subprocess.run(["apt-get", "-q", *words], env=quiet, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"apt-get {' '.join(words)}: {done.stderr.strip().splitlines()[-1]}")


def free_ports(count):
    """Ports of the loopback that nothing listens on."""
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]


def start_daemons(folder):
    """Start munge, the controller and the node, which reads its configuration in `folder`; wait until it is idle."""
    for name in ("state", "spool", "work"):
        (folder / name).mkdir()
    key = folder / "munge.key"
    key.write_bytes(os.urandom(1024))
    key.chmod(0o400)
    folder.chmod(0o755)  # munge refuses a socket that others could replace
    host = socket.gethostname().partition(".")[0]
    controller, node = free_ports(2)
    sizes = {"cores": max(CORES, os.cpu_count()), "memory": MEMORY}
    text = CONFIGURATION.format(folder=folder, host=host, controller=controller, node=node, **sizes)
    (folder / "slurm.conf").write_text(text)
    os.environ["SLURM_CONF"] = str(folder / "slurm.conf")
    version = subprocess.run(["slurmd", "-V"], capture_output=True, text=True).stdout.split()[-1]
    # containers may have no cgroups of their own; before 23.02 nothing asks for them
    if tuple(map(int, version.split(".")[:2])) >= (23, 2):
        (folder / "cgroup.conf").write_text("CgroupPlugin=disabled\n")
    files = {name: folder / f"munge.{name}" for name in ("socket", "pid", "log", "seed")}
    options = [f"--{word}={files[name]}" for word, name in
               (("socket", "socket"), ("pid-file", "pid"), ("log-file", "log"), ("seed-file", "seed"))]  # fmt: skip
    daemons = [
        ["munged", "--foreground", "--force", f"--key-file={key}", *options],
        ["slurmctld", "-D"],
        ["slurmd", "-D"],
    ]
    for words in daemons:
        with (folder / f"{words[0]}.out").open("w") as out:
            subprocess.Popen(words, stdout=out, stderr=out, start_new_session=True)
        deadline = time.monotonic() + START_TIME
        while words[0] == "munged" and not files["socket"].exists() and time.monotonic() < deadline:
            time.sleep(0.1)
    deadline = time.monotonic() + START_TIME
    while run(["sinfo", "--noheader", "--format=%t"], check=False).stdout.strip() != "idle":
        if time.monotonic() > deadline:
            logs = "".join(path.read_text()[-600:] for path in sorted(folder.glob("*.out")))
            sys.exit(f"Slurm: the node is not idle after {START_TIME:.0f} s. What its daemons say:\n{logs}")
        time.sleep(0.3)


def end_children():
    """End every process below this one: jobs and daemons first, then what they leave to this process."""
    run(["scancel", "--full", "--user=root"], check=False)
    for wait, number in ((5.0, signal.SIGTERM), (5.0, signal.SIGKILL)):
        deadline = time.monotonic() + wait
        while (children := list_children()) and time.monotonic() < deadline:
            for pid in children:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, number)
            time.sleep(0.3)
            with contextlib.suppress(ChildProcessError):
                while os.waitpid(-1, os.WNOHANG)[0]:
                    pass


def list_children() -> list[int]:
    """Processes below this one that still run."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, parent = stat.read_text().rpartition(")")[2].split()[:2]
            if state != "Z":
                parents[int(stat.parent.name)] = int(parent)
    below, found = {os.getpid()}, []
    while more := [pid for pid, parent in parents.items() if parent in below and pid not in below]:
        below |= set(more)
        found += more
    return found


def copy_results(folder, keep):
    """Copy logs and results of `folder` to where the user keeps them."""
    if keep is not None:
        special = shutil.ignore_patterns("*.socket*", "*.key", "spool", "state")
        shutil.copytree(folder, keep, ignore=special, dirs_exist_ok=True)


def run(words, check=True, **variables):
    """A program run to its end, with its output as text."""
    env = environment() | {"PATH": f"{ROOT}/.venv/bin:{os.environ['PATH']}", **variables}
    done = subprocess.run(list(map(str, words)), env=env, capture_output=True, text=True)
    if check and done.returncode:
        sys.exit(f"{' '.join(map(str, words))}: {(done.stderr or done.stdout).strip()[-500:]}")
    return done


def mpi_version():
    """Name and version of MPI."""
    code = "from mpi4py import MPI; print(MPI.Get_library_version().split(',')[0])"
    return run([sys.executable, "-c", code]).stdout.strip().strip("\0")


def submit(folder, name, words, **variables):
    """Submit a job and wait for it: (seconds, exit status, what it printed)."""
    log = folder / "work" / f"{name}.log"
    began = time.perf_counter()
    sbatch = ["sbatch", "--wait", f"--chdir={folder / 'work'}", f"--output={log}"]
    done = run([*sbatch, *words], check=False, **variables)
    text = log.read_text(errors="replace").replace("\0", "") if log.exists() else ""
    return time.perf_counter() - began, done.returncode, text + done.stderr


def print_job(what, outcome, expectations):
    """Print the line of a job; whether one of the expectations {text: bool} failed."""
    seconds, status, text = outcome
    wrong = [name for name, is_met in expectations.items() if not is_met] + ["exit status 0"] * (status != 0)
    print(
        f"{what}: {seconds:.1f} s, {'; not: ' + ', '.join(wrong) if wrong else ', '.join(expectations)}",
        flush=True,
    )
    if wrong:
        print(text[-3000:], flush=True)
    return bool(wrong)


def check_launcher(folder, args):
    """The launcher of the scripts makes one MPI of all ranks."""
    code = "from mpi4py import MPI; print('ranks', MPI.COMM_WORLD.size)"
    script = f'exec srun --mpi={args.mpi} {sys.executable} -c "{code}"'
    outcome = submit(folder, "ranks", [f"--ntasks={args.ranks}", "--mem-per-cpu=1G", f"--wrap={script}"])
    found = outcome[2].count(f"ranks {args.ranks}")
    return print_job(
        f"srun --mpi={args.mpi}", outcome, {f"{args.ranks} ranks in one MPI": found == args.ranks}
    )


def study_expectations(folder, seeds):
    """Expectations of a study of ensemble.sbatch: packings at three pressures and their sweeps."""
    table = jampetsc.load(folder) if (folder / "table.csv").exists() else None
    rows = 3 * seeds
    complete = (
        table is not None and table.where(command="sweep").rows == table.where(command="pack").rows == rows
    )
    return {
        f"{rows} sweeps of {rows} packings": complete,
        "none failed": table is not None and not table.failed.rows,
    }


def check_ensemble(folder, args):
    """ensemble.sbatch with its own launcher."""
    return check_study("ensemble", folder, args.ranks, {"LAUNCH": f"srun --mpi={args.mpi}"})


def check_mpirun(folder, args):
    """ensemble.sbatch with the launcher that its text has for other clusters, on more ranks than cores."""
    return check_study("mpirun", folder, args.ranks, {"LAUNCH": "mpirun --oversubscribe --bind-to none"})


def check_study(name, folder, ranks, variables, seeds=2, size=32):
    """A line about ensemble.sbatch; its study goes to the folder `name`."""
    out = folder / "work" / name
    variables = {"N": str(size), "SEEDS": f"1:{seeds}", "FOLDER": str(out)} | variables
    outcome = submit(folder, name, [f"--ntasks={ranks}", ROOT / "run/slurm/ensemble.sbatch"], **variables)
    return print_job(
        f"ensemble.sbatch, {variables['LAUNCH']}, {ranks} ranks", outcome, study_expectations(out, seeds)
    )


def check_continuation(folder, args, seeds=8, size=64):
    """ensemble.sbatch that is cancelled at its first sweep and submitted again, on one rank less."""
    out, launcher = folder / "work" / "continued", f"srun --mpi={args.mpi}"
    variables = {"N": str(size), "SEEDS": f"1:{seeds}", "FOLDER": str(out), "LAUNCH": launcher}
    log = f"--output={folder / 'work' / 'cancelled.log'}"
    words = ["sbatch", "--parsable", log, f"--ntasks={args.ranks}", ROOT / "run/slurm/ensemble.sbatch"]
    number, deadline = run(words, **variables).stdout.strip(), time.monotonic() + JOB_TIME

    def is_queued():
        return run(["squeue", "--noheader", f"--jobs={number}"], check=False).stdout.strip()

    while not list(out.glob("sweep-*.h5")) and is_queued() and time.monotonic() < deadline:
        time.sleep(0.1)
    run(["scancel", number], check=False)
    while is_queued():
        time.sleep(0.3)
    kept = {path: path.stat().st_mtime_ns for path in out.glob("*-*.h5")}
    print(f"ensemble.sbatch, cancelled with {len(kept)} of {6 * seeds} files", flush=True)
    if not 0 < len(kept) < 6 * seeds:
        print("    too early or too late to show anything", flush=True)
        return True
    ranks = max(1, args.ranks - 1)
    failed = check_study("continued", folder, ranks, {"LAUNCH": launcher}, seeds, size)
    again = [path for path, written in kept.items() if path.stat().st_mtime_ns != written]
    print(f"    {len(again)} of those files made again", flush=True)
    return failed or bool(again)


def check_figure(folder, args):
    """figure.sbatch, at sizes from the environment."""
    out = folder / "work" / "figure"
    variables = {
        "TREE": str(ROOT),
        "N": "32",
        "SEEDS": "1:2",
        "FOLDER": str(out),
        "LAUNCH": f"srun --mpi={args.mpi}",
    }
    words = [f"--ntasks={args.ranks}", ROOT / "run/slurm/figure.sbatch", "bt-fig1"]
    outcome = submit(folder, "figure", words, **variables)
    pictures = [out / f"{name}.png" for name in ("packing", "moduli", "fields", "bt-fig1")]
    made = {f"{path.name}": path.exists() for path in pictures}
    return print_job(f"figure.sbatch bt-fig1, {args.ranks} ranks", outcome, made)


def check_scaling(folder, args):
    """scaling.sbatch, whose ranks are powers of two."""
    out = folder / "work" / "scaling"
    variables = {"TREE": str(ROOT), "N": "100,200", "FOLDER": str(out)}
    outcome = submit(folder, "scaling", ["--ntasks=2", ROOT / "run/slurm/scaling.sbatch"], **variables)
    table = out / "scaling.csv"
    rows = len(table.read_text().splitlines()) - 1 if table.exists() else 0
    expected = {"12 rows": rows == 12, "scaling.png": (out / "scaling.png").exists()}
    return print_job("scaling.sbatch, 1 and 2 ranks", outcome, expected)


if __name__ == "__main__":
    main()

"""Steady shear at a rate."""

import json
import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.io.hdf5 import attributes, check_format, open_file
from jampetsc.io.outputs import check_place, is_same
from jampetsc.io.results import note_lines, noted
from jampetsc.laws.damping import Law
from jampetsc.laws.flow_models import MODELS, Model
from jampetsc.options.job import PACKING_OR_N, TaskInputs
from jampetsc.options.parameters import FILE, composite_parameter, optional_parameter, parameter
from jampetsc.options.physics_options import MODEL
from jampetsc.options.starts import GROUP, ShearJob, random_particles_lines, run_parameter
from jampetsc.options.values import PACKING_OR_RESULT, POSITIVE, TIME_UNIT, input_name, load_source
from jampetsc.packing.packing import Packing
from jampetsc.packing.units import is_within
from jampetsc.petsc import launchers
from jampetsc.progress import Progress, duration_text, note

TOLERANCE = 1e-4
MAX_RATE = 1.0  # of the stiffness of the stiffest contact over its damping, k/kτ₁ or (k/σ²)/kτ₁


@dataclass(frozen=True, eq=False)
class Flow(ShearJob):
    """Steady shear at a rate: stress, pressure, energy balance.

    Shears disks or spheres steadily under Lees–Edwards conditions, by one of Vågberg's six models (thesis sec. 4.3)
    or a damping law, overdamped or with a mass. Starts from a packing, or from random particles of a given number and
    packing fraction; or continues an earlier flow with its settings.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(PACKING_OR_N)
    scalar: ClassVar = None
    OUT: ClassVar = "optional"
    OUT_HELP: ClassVar = "result file (default when a flow is continued: its own file)"
    EPILOG: ClassVar = """examples:
  jampetsc flow --n 1024 --phi 0.8433 --model RD0 --rate 1e-3 --strain 20 --snapshots 40 --out rd0.h5
  jampetsc flow p.h5 --model CD0 --rate 1e-4 --strain 5 --out cd0.h5
  jampetsc flow --n 256 --phi 0.78 --model CDn --mass 1 --rate 1e-3 --strain 40 --out cdn.h5
  jampetsc flow --dimension 3 --n 512 --phi 0.65 --model RD0 --rate 1e-3 --strain 10 --out rd0-3d.h5
  jampetsc flow rd0.h5 --strain 20                      # twenty more
  jampetsc flow p.h5 --model RD0 --rate 1e-3 --strain 3 --series 1e-3 --out rows.h5     # its start in fine rows

A killed run continues when the same command is given again. Many particles use several cores, with the same result
to the last bit; independent runs are faster side by side. The same seed gives the same trajectory where it gives the
same packing (`jampetsc pack --help`); elsewhere trajectories part, and only averages agree."""

    start: Packing | None = optional_parameter(
        "packing to start from, or flow to continue",
        value_type=PACKING_OR_RESULT,
        place=FILE,
        metavar="START",
    )
    model: Model | Law | str | None = composite_parameter(MODEL, None)
    rate: float | None = optional_parameter(
        "shear rate γ̇", above=0.0, high=POSITIVE[1], unit=TIME_UNIT, metavar="R"
    )
    strain: float = parameter(help="how far to shear", above=0.0, metavar="S")
    walls: bool = parameter(False, "between sliding rough walls, rows of disks (not of spheres)", group=GROUP)
    snapshots: int | None = run_parameter(
        "number of states to keep, at equal strains after what is discarded", low=0, metavar="K"
    )
    snapshot_every: float | None = run_parameter(
        "strain between snapshots, instead of their number", above=0.0, metavar="S"
    )
    snapshot_spacing: str | None = run_parameter(
        "log: states at strains that grow by a factor, for mean square displacements (default even)",
        choices=("even", "log"),
    )
    series: float | None = run_parameter(
        "strain of a row of the series, finer than by default; the state at γ = 0 is kept as well, for the start of "
        "the flow",
        above=0.0,
        metavar="S",
    )
    step: float | None = run_parameter(
        "time step, a time as tau1 (default: by the model)", above=0.0, metavar="DT"
    )
    tolerance: float | None = run_parameter(
        f"of the velocities of contact damping (default {TOLERANCE:g})", low=1e-14, high=0.1, metavar="T"
    )

    def __post_init__(self):
        if isinstance(self.model, Law):  # overdamped
            object.__setattr__(self, "model", Model(self.model))
        super().__post_init__()

    def check(self):
        self.check_discard()
        if self.dimension == 3 and self.walls:
            raise InputError(
                f"{named('walls')}: not supported for spheres. Leave it out, or {named('dimension')}."
            )
        every, spacing = named("snapshot_every"), named("snapshot_spacing")
        if self.snapshot_every is not None and (self.snapshots is not None or self.snapshot_spacing == "log"):
            raise InputError(f"{every}: excludes {named('snapshots')} and {spacing} log. Leave them out.")
        if self.snapshot_spacing is not None and not self.snapshots:
            raise InputError(f"{spacing}: requires a number of snapshots. Give {named('snapshots')}.")
        earlier = self._in_memory
        if earlier is not None:
            if earlier.format != self.FORMAT:
                raise InputError(
                    f"{earlier.path}: a {earlier.format}, not a flow. To start a new flow give a packing; to continue "
                    "one, give its result."
                )
            self._refuse_settings(earlier.path)
        elif self.start is None or self._own_settings:
            super().check()
            if self.rate is None:
                raise InputError(f"{named('rate')}: missing. Give the shear rate, such as 1e-3.{self._hint}")
            if self.model is None:
                names = f"{', '.join(MODELS)}, or {named('law')} with its options"
                raise InputError(f"{named('model')}: missing. Give {names}.{self._hint}")
            if self.start is None and self.radii is None:
                self._check_rate(1.0)  # of the smallest disks, whose diameter is 1
            if self.step is not None and not self.rate * self.step <= self.strain * (1.0 + 1e-9):
                raise InputError(
                    f"{named('step')} {self.step:g}: longer than the whole run ({self.strain / self.rate:g} for "
                    f"{named('strain')} {self.strain:g}). Give a shorter one."
                )

    @property
    def implied(self):
        """See `Job`; all but the strain of a flow that is continued is in its file."""
        return super().implied | {"snapshots": 0, "snapshot_spacing": "even", "tolerance": TOLERANCE}

    def _check_rate(self, scale):
        """Refuse a rate out of range for disks whose shortest scale of overlaps is `scale`, see `Potential.scale`."""
        fastest = MAX_RATE / (self.model.law.tau1 * scale**2)
        if not is_within(self.rate, 0.0, fastest):
            raise InputError(f"{named('rate')} {self.rate:g}: must be at most {fastest:.6g}")

    @property
    def _in_memory(self):
        """The result in memory that is given as START, or None."""
        return None if self.start is None or isinstance(self.start, str | Packing) else self.start

    @property
    def _hint(self):
        """End of a message where a START is given, in case it was meant to be continued."""
        if self.start is None:
            return ""
        return f" To continue a flow give only {named('strain')}; its other settings are kept."

    @property
    def _own_settings(self):
        """Parameters that only a new flow may be given: a continued one keeps its own."""
        return [name for name in self.settings() if name not in ("strain", "last", "threads")]

    def _refuse_settings(self, path):
        """Raise InputError for settings that belong to the flow at `path`, which is continued."""
        for name in self._own_settings:
            raise InputError(
                f"{named(name)}: a setting of the flow {path}, which is continued. Leave it out, or start a new flow."
            )

    @property
    def place(self):
        """The flow file that is continued, which the result replaces."""
        if not self._continues:
            raise InputError(f"{named('out')}: missing. Give the file of the result.")
        return self.start

    @property
    def _continues(self):
        """Whether START is a flow to continue."""
        return self._in_memory is not None or (isinstance(self.start, str) and _is_flow(self.start))

    def check_outputs(self, to):
        """See `Job`; but a continued flow may replace its own file."""
        if (
            to.path is not None
            and isinstance(self.start, str)
            and is_same(to.path, self.start)
            and self._continues
        ):
            check_place(to.path, self.FORMAT)
            self.check_last(to)
        else:
            super().check_outputs(to)

    def work(self, to):
        from jampetsc.commands import run_files
        from jampetsc.commands.flow_files import check_space
        from jampetsc.flows.flow_run import run_flow
        from jampetsc.flows.trajectory import Trajectory

        began = time.perf_counter()
        run, origin = self._continued_run() if self._continues else self._new_run()
        if launchers.has_several_ranks():
            note("one rank does one flow, on threads; independent runs use more ranks")
        schedule = run.schedule
        check_space(to, run.disks.n, schedule.count_snapshots(run.first_averaged_row))
        checkpoint = to.checkpoint()
        resume, rows = run_files.saved_rows(checkpoint), len(run.earlier[0]) if run.earlier else 0
        if resume is not None:
            resume = Trajectory.of(resume[0]), resume[1]
            rows = len(resume[0])

        def save(trajectory, state):
            run_files.save_rows(checkpoint, trajectory.arrays(), state)

        with Progress(
            schedule.count_checks(schedule.rows), "flow", done=schedule.count_checks(rows)
        ) as progress:
            if resume is not None:
                progress.note(f"{to.checkpoint_path}: continues from strain {resume[0].strain:.6g}")
            result = run_flow(
                run,
                team=self.team,
                resume=resume,
                save=None if to.checkpoint_path is None else save,
                report=lambda *numbers: progress.step(_progress_line(*numbers)),
            )
        save(result.trajectory, result.state)  # in case one of the files cannot be written
        provenance = run_files.run_provenance(time.perf_counter() - began, law=_law_parameters(run.model.law))
        facts = provenance | origin | _facts(run, result) | {"settings": json.dumps(run.settings)}
        self.write_last(result.disks.replace(record={}), facts, to)
        # a flow file that is continued in place is replaced last
        state = result.state | {"radii": run.disks.radii}
        run_files.write_series(to.writer(self.FORMAT), result.trajectory.arrays(), state, facts)
        checkpoint.remove()
        return _summary(run, to, result.means, origin)

    def _continued_run(self):
        """(run that continues an earlier flow, attributes of the origin of its disks)."""
        from jampetsc.commands.flow_files import continued_run

        earlier = load_source(self.start)
        self._refuse_settings(earlier.path)
        return continued_run(earlier, self.strain)

    def _new_run(self):
        """(run of a new flow, attributes of the origin of its disks)."""
        from jampetsc.flows.flow_run import define_flow

        if not self._own_settings:
            raise InputError(
                f"{input_name(self.start)}: a packing, not a flow. To start a new flow give {named('model')} and "
                f"{named('rate')}; to continue one, give its file."
            )
        disks, origin = self.disks()
        self._check_rate(float(disks.potential.scale(2.0 * np.array(disks.radii.min()))))
        run = define_flow(
            disks,
            self.model.of_stiffness(disks.potential.k),
            self.rate,
            self.strain,
            wall_disks=origin.get("walls", 0),
            discard=self.discard,
            snapshots=self.snapshots or 0,
            every=self.snapshot_every,
            spacing=self.snapshot_spacing or "even",
            series=self.series,
            step=self.step,
            tolerance=self.tolerance or TOLERANCE,
        )
        return run, origin

    def protocol(self, attributes):
        return f"steady shear, {attributes['model']}, rate {attributes['rate']:g}"

    def random(self, radii, seed):
        """See `ShearJob`; `walls` in the attributes is the number of disks, the first ones, that make up the walls."""
        if not self.walls:
            return super().random(radii, seed)
        from jampetsc.flows.walls import between_walls

        disks, wall_disks = between_walls(
            radii, self.phi, seed, self.made_potential, keeps_order=self.radii is not None
        )
        return disks, {"walls": wall_disks}


def _is_flow(path) -> bool:
    """Whether the file at `path` is a flow file. Raises InputError for other files than jampetsc's."""
    with open_file(path) as h5:
        return check_format(path, attributes(h5)) == Flow.FORMAT


def _progress_line(strain, means, seconds) -> str:
    """Progress of a run; means: so far, None before there are any; seconds: left."""
    averages = (
        "transient" if means is None else f"sigma {means.shear_stress.mean:.4g}, p {means.pressure.mean:.4g}"
    )
    return f"strain {strain:.4g}, {averages}, {duration_text(seconds)} left"


def _law_parameters(law) -> dict:
    return law.parameters if law.family else {"tau1": law.tau1}


def _facts(run, result) -> dict:
    """Attributes of the file, without provenance and origin of the disks."""
    from jampetsc.commands.run_files import potential_facts

    disks, model, k = run.disks, run.model, run.disks.potential.k
    return {
        "model": str(model),
        "rate": run.rate,
        "phi": run.phi,
        "mass": model.mass,
        "quality": float(np.sqrt(model.mass * k)) / (k * model.law.tau1) if model.mass else None,
        "background_drag": model.background_drag,
        "particle_count": disks.n - run.wall_disks,
        **({"dimension": 3} if disks.dimension == 3 else {}),
        **potential_facts(disks),
        "step": run.scheme.step,
        "method": run.scheme.method,
        "tolerance": run.scheme.tolerance,
        "discard": run.schedule.discard,
        **result.means.facts(),
        "substeps": result.state["substeps"],
        "notes": noted(result.means.warnings()),
    }


def _summary(run, to, means, origin) -> str:
    """Summary of a run for its user, in lines; origin: attributes of the origin of its disks."""
    from jampetsc.commands.run_files import run_units, sample_sizes

    walls = f" between walls of {run.wall_disks} disks" if run.wall_disks else ""
    lines = [
        f"{to}: {run.model}{walls}, phi = {run.phi:.6g}, rate {run.rate:g}, {run.scheme.method} with steps of "
        f"{run.scheme.step:.3g}; means over strain {means.strain:.4g}",
        f"  sigma = {means.shear_stress} (elastic {means.parts[0]:.4g}, viscous {means.parts[1]:.4g}, kinetic "
        f"{means.parts[2]:.4g}), p = {means.pressure}, sigma/p = "
        f"{means.shear_stress.mean / means.pressure.mean:.4g}",
        f"  2N_c/N = {means.contact_number}, energy balance {means.energy_balance:.4f}, correlation strain "
        f"{means.correlation_strain:.2g}, {sample_sizes(means.shear_stress, means.pressure)}",
    ]
    if means.walls:
        stress, pressure = means.walls.values()
        lines.append(f"  on the walls: sigma = {stress}, p = {pressure}")
    lines += [*random_particles_lines(origin), run_units(run.disks, run.model.law.tau1)]
    return "\n".join(lines + note_lines(means.warnings()))

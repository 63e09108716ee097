"""Quasistatic shear."""

import time
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from jampetsc.analysis.jammed_samples import correlated_share
from jampetsc.errors import InputError, named
from jampetsc.io.results import note_lines, noted
from jampetsc.laws.loads import DEFAULT, LoadChoice
from jampetsc.options.job import PACKING_OR_N, TaskInputs
from jampetsc.options.parameters import parameter
from jampetsc.options.physics_options import LOAD, LOAD_NAMES, check_finite_strain
from jampetsc.options.starts import (
    ShearJob,
    minimum_tolerance_parameter,
    random_particles_lines,
    run_parameter,
)
from jampetsc.packing.packing import PLACES, deformed
from jampetsc.packing.strain import strain_of, strained
from jampetsc.petsc import session
from jampetsc.progress import Progress

MAX_STEPS = 1e8  # steps of a run
MAX_LINES = 50  # of progress in a log
MAX_STRAIN = 1e4  # strain of a run
DESCENTS = DEFAULT_DESCENT, _ = "steepest", "lbfgs"


@dataclass(frozen=True, eq=False)
class Shear(ShearJob):
    """Quasistatic shear: affine step, minimise, repeat.

    Shears disks or spheres in small affine steps, each followed to the minimum of the energy (Vågberg, thesis
    sec. 4.7).
    """

    STUDY_INPUTS: ClassVar = TaskInputs(PACKING_OR_N, one_rank=True)
    EPILOG: ClassVar = """examples:
  jampetsc shear --n 64 --phi 0.845 --step 1e-3 --strain 8 --out qs.h5
  jampetsc shear p.h5 --step 1e-3 --strain 1 --out from-p.h5
  jampetsc shear p.h5 --events --step 1e-3 --strain 0.01 --last there.h5 --out there-events.h5
  jampetsc shear there.h5 --events --step 1e-3 --strain -0.01 --out back.h5
  jampetsc shear p.h5 --events --step 1e-3 --strain -0.01 --load compression --out compressed-events.h5

A killed run continues when the same command is given again. Options of the Newton steps of its quenches have the
prefix -newton_."""
    SOLVERS: ClassVar = ("newton_",)

    step: float = parameter(help="strain of one step", above=0.0, high=0.1, metavar="DG")
    strain: float = parameter(
        help="how far to shear, γ; negative (the other way) with events alone",
        low=-MAX_STRAIN,
        high=MAX_STRAIN,
        metavar="S",
    )
    events: bool = parameter(
        False,
        "follow each minimum exactly from event to event: contacts that open or close, instabilities",
        group="run",
    )
    d2min: bool = parameter(
        False,
        "with events, displacement and D²min of each particle in the largest drop of the energy",
        group="run",
    )
    descent: str | None = run_parameter(
        "with events, way down from an instability: steepest descent, which overdamped particles take, or L-BFGS "
        "(default steepest)",
        choices=DESCENTS,
    )
    load: LoadChoice | None = run_parameter(
        f"with events, {LOAD_NAMES}; with zeros below its diagonal. The cell becomes 1 + γE (default {DEFAULT})",
        value_type=LOAD,
    )
    tolerance: float = minimum_tolerance_parameter(group="run")

    def check(self):
        super().check()
        if self.strain < 0.0 and not self.events:
            raise InputError(f"{named('strain')} {self.strain:g}: must be positive without {named('events')}")
        if abs(self.strain) < self.step:
            raise InputError(
                f"{named('strain')} {self.strain:g}: must be at least {named('step')} ({self.step:g})"
            )
        for name in ("descent", "d2min", "load"):
            if getattr(self, name) and not self.events:
                raise InputError(f"{named(name)}: of {named('events')} alone. Leave it out, or give both.")
        if abs(self.strain) / self.step > MAX_STEPS:
            raise InputError(
                f"{named('step')} {self.step:g}: {abs(self.strain) / self.step:.3g} steps (at most {MAX_STEPS:.0e}). "
                "Give a larger one."
            )
        if self.load:
            check_finite_strain(self.load, self._signed_step * self._steps, "shear")

    @property
    def implied(self):
        """See `Job`."""
        defaults = {"descent": DEFAULT_DESCENT, "load": LoadChoice(DEFAULT)}
        return super().implied | (defaults if self.events else {})

    @property
    def _event_settings(self) -> dict:
        """Attributes of a run that follows events."""
        return {"descent": self.descent or DEFAULT_DESCENT, "load": self.load or LoadChoice(DEFAULT)}

    @property
    def _steps(self) -> int:
        return max(1, int(np.ceil(abs(self.strain) / self.step - 1e-9)))

    @property
    def _signed_step(self) -> float:
        return float(np.copysign(self.step, self.strain))

    def protocol(self, attributes):
        events = ", every event followed" if self.events else ""
        kind = f"strain {self.load}" if self.load else "shear"
        return f"quasistatic {kind}, steps of {attributes['step']:g}{events}"

    def work(self, to):
        from jampetsc.analysis.strain_series import StrainSeries, discarded_strain
        from jampetsc.commands.run_files import run_provenance, run_units, save_rows, saved_rows, write_series
        from jampetsc.jamming.stepwise_shear import PATH_COLUMNS, shear_stepwise
        from jampetsc.minimisation.minimise import proved
        from jampetsc.petsc.hessian_solver import HessianSolver

        running = session.current()
        if running.size > 1:
            raise InputError(
                f"shear: started on {running.size} ranks, but one run is one process. Run it without mpirun, or many "
                "by a study."
            )
        (disks, origin), solver, start_time = self.disks(), HessianSolver(), time.perf_counter()
        steps = self._steps
        discard = discarded_strain(abs(self.strain), self.discard)
        checkpoint = to.checkpoint()
        resume, rows = saved_rows(checkpoint), 0
        if resume is not None:
            series = StrainSeries(PATH_COLUMNS)
            series.restore(resume[0])
            resume, rows = (series, resume[1]), len(series)

        def report(series):
            rows = len(series)
            if rows * MAX_LINES // steps > (rows - 1) * MAX_LINES // steps:
                progress.step(f"strain {series.strain:.4g}, p {series.rows['pressure'][-1]:.4g}")

        with Progress(MAX_LINES, "shear", done=rows * MAX_LINES // steps) as progress:
            if resume is not None:
                progress.note(f"{to}: continues from strain {series.strain:.6g}")
            path = shear_stepwise(
                disks,
                self._signed_step,
                steps,
                solver,
                self.tolerance,
                discard=discard,
                team=self.team,
                start=self._start(disks),
                resume=resume,
                save=lambda series, state: save_rows(checkpoint, series.arrays(), state),
                report=report,
            )
        notes = self._notes(path)
        facts = run_provenance(time.perf_counter() - start_time, running) | origin | self._facts(disks, path)
        facts["notes"] = noted(notes)
        if self.last is not None:
            self.write_last(proved(path.disks.replace(record={}), solver), facts, to)
        minimum = {name: getattr(path.disks, name) for name in (*PLACES, "radii")}
        arrays = path.series.arrays() | _event_arrays(path, self.d2min)
        write_series(to.writer(self.FORMAT), arrays, minimum, facts)
        checkpoint.remove()
        lines = [_summary(self, to, disks.phi, path), *random_particles_lines(origin), run_units(disks)]
        return "\n".join([*lines, *note_lines(notes)])

    def _start(self, disks):
        """What makes the `StepwiseShear` of these disks. Raises InputError for a load that their cell does not take."""
        from jampetsc.jamming.shear_events import EventShear
        from jampetsc.jamming.stepwise_shear import StepwiseShear

        if not self.events:
            return StepwiseShear
        settings = self._event_settings
        (load,) = settings["load"].of(disks.dimension)
        end = strained(strain_of(load.gradient), self._steps * self._signed_step)
        period, diameter = deformed(disks, 0.0, end).period, 2.0 * float(disks.radii.max())
        if period < diameter:
            raise InputError(
                f"{named('strain')} {self.strain:g}: makes the cell repeat at a distance of {period:.6g} (largest "
                f"particle {diameter:.6g}). Give a smaller one, or more particles."
            )
        return partial(EventShear, descent=settings["descent"], load=load)

    def _notes(self, path) -> list[str]:
        from jampetsc.analysis.strain_series import short_run_warnings

        stress, pressure = path.averages["shear_stress"], path.averages["pressure"]
        notes = short_run_warnings(abs(self.strain) - path.discard, self.step, stress, pressure)
        if path.came_apart is not None:
            notes.insert(
                0,
                f"ended early: particles come apart at strain {path.came_apart:.6g}. Compress the packing to shear it "
                "farther",
            )
        return notes

    def _facts(self, disks, path) -> dict:
        """Attributes of the file, without provenance and origin of the disks."""
        from jampetsc.analysis.strain_series import average_facts
        from jampetsc.commands.run_files import potential_facts
        from jampetsc.jamming.stepwise_shear import PLASTIC_RATIO, energy_cut

        return {
            "step": self.step,
            "phi": disks.phi,
            "particle_count": disks.n,
            **({"dimension": 3} if disks.dimension == 3 else {}),
            **potential_facts(disks),
            "tolerance": self.tolerance,
            "discard": path.discard,
            "energy_cut": energy_cut(disks.potential),
            "plastic_share": PLASTIC_RATIO,
            "newton_steps": path.effort.newton_steps,
            "saddles": path.effort.saddles,
            "shakes": path.effort.shakes,
            **(self._event_settings if self.events else {}),
            **({} if path.came_apart is None else {"came_apart": path.came_apart}),
            **average_facts(**path.averages),
        }


def _event_arrays(path, d2min) -> dict:
    """Datasets of the events of a path, none where they were not followed."""
    if path.events is None:
        return {}
    columns = path.events.arrays()
    columns |= {name: columns[name].astype(int) for name in ("kind", "particles", "contacts")}
    if d2min and (largest := path.events.largest)["row"] >= 0:
        columns |= {"largest": int(largest["row"])}
        columns |= {name: largest[name] for name in ("positions", "cell", "displacement", "d2min")}
    return {f"events/{name}": values for name, values in columns.items()}


def _summary(job, to, phi, path) -> str:
    """Summary of a run for its user, in lines."""
    from jampetsc.commands.run_files import sample_sizes

    series, averages = path.series, path.averages
    evaluations, events = series.column("evaluations").mean(), int(series.column("plastic").sum())
    share = correlated_share([series.column("jammed")[path.averaged_rows]])
    stress, pressure = averages["shear_stress"], averages["pressure"]
    changes = "" if path.events is None else f", {len(path.events)} events in all"
    return (
        f"{to}: phi = {phi:.6g}, {len(series)} steps of {job.step:g}, {evaluations:.0f} force evaluations each, "
        f"{events} plastic event{'s' * (events != 1)}{changes}\n"
        f"  sigma = {stress}, p = {pressure}, {_share_text(share)}, 2N_c/N = {averages['contact_number']}; "
        f"{sample_sizes(stress, pressure)}"
    )


MIN_INDEPENDENT = 2.0  # states of one run, below which an interval says nothing


def _share_text(share) -> str:
    """How much of one run is jammed; a run that never changes has no error of its own."""
    if share.value in (0.0, 1.0):
        return "jammed at every step" if share.value else "jammed at no step"
    value = next(text for digits in range(3, 18) if (text := f"{share.value:.{digits}g}") not in ("0", "1"))
    if share.independent < MIN_INDEPENDENT:
        return f"jammed at {value} of the steps (too few independent ones for an error)"
    return f"jammed at {value} of the steps (68 % interval {share.low:.2g} to {share.high:.2g})"

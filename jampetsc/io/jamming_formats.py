"""Formats of results of quasistatic shear and of samples that jam."""

from jampetsc.io.declaration import Format
from jampetsc.io.provenance import PROVENANCE
from jampetsc.io.result_formats import DISK_ROWS

SHEAR = Format(
    datasets=r"""
strain | (T,) | float | | γ
energy | (T,) | float | `units` | U of all disks
shear_stress, pressure | (T,) | float | `units` | σ_xy, p; under another `load` σ = V⁻¹ dU/dγ, V the volume before any
  strain
jammed | (T,) | float | | 1 where U/N exceeds `energy_cut` k, else 0
contact_number | (T,) | float | | 2N_c/N of all N disks, rattlers included; `coordination` leaves them out
nonaffine | (T,) | float | mean diameter | rms non-affine displacement of the step: large where disks rearrange
dissipated | (T,) | float | `units` | V ½(σ + σ′) Δγ − ΔU: work of the step that is not stored as energy;
  with `--events` the sum of the drops
plastic | (T,) | float | | 1 where `dissipated` exceeds `plastic_share` G_A V Δγ², more than the error of the
  trapezoidal rule: disks rearranged; G_A is the modulus of affine motion. With `--events` where there is one of kind 2
proved | (T,) | float? | | 1 where the Hessian was factorised and has no negative mode: wherever contacts are alike, and
  in every 50th row
evaluations | (T,) | float | | force evaluations that the step took
events/strain | (e,) | float? | | with `--events`: γ of each event; several at one strain are one change
events/kind | (e,) | int? | | 0: a contact opens, 1: closes, 2: the minimum is lost and disks rearrange, 3 and 4: a
  contact without force, of a particle that nothing holds, begins and ends, 5: an event that rounding hides, after which
  disks are quenched 1e-6 of strain further
events/particles | (e, 2) | int? | | numbers of the two particles of the contact; of kind 2 those that move farthest
events/shear_stress, events/pressure, events/energy | (e, 2) | float? | `units` | σ, p and U before and after it
events/contacts | (e, 2) | int? | | contacts that bear a force before and after it
events/drop | (e,) | float? | `units` | energy that is dissipated
events/participation | (e,) | float? | | (Σu²)²/Σu⁴ of the displacements of kind 2, how many particles move; else 0
events/largest | scalar | int? | | with `--d2min`: row of the largest drop
events/positions, events/displacement | (N, D) | float? | length | with `--d2min`: of the particles before it, and to
  the minimum after it, without the mean
events/cell | (D, D) | float? | length | with `--d2min`: rows of the cell at it
events/d2min | (N,) | float? | length² | with `--d2min`: D²min of the particles in it, the mean of \|u_j − u_i − J r\|²
  over neighbours with a gap below half a mean diameter, at the best J; nan without neighbours
events/lowest_eigenvalue | (e,) | float? | `units` | lowest one of K before it, rattlers and translations
  left out; 0 where it vanishes
state/base, state/offset | (N, D) | float | length | the last minimum, coordinates in two parts
state/cell_base, state/cell_offset | (D, D) | float | length | its cell in two parts
state/radii | (N,) | float | length | radii of the disks
""",
    attributes=r"""
step, phi, tolerance, discard | float, float, float, float | | Δγ, φ, max\|F\|/(p d) of a minimum, strain left out of
  means
energy_cut, plastic_share, newton_steps | float, float, int | | 1e-16, with α > 5/2 its power 2α/5; ¼;
  factorisations of all steps
saddles | int? | | saddles that were left
descent | text in steepest lbfgs? | | with `--events`: way down from an instability
came_apart | float? | | with `--events`: γ where no contact was left, at which the run ended
shakes | int? | | how often disks were shaken where no minimum was found
shear_stress_mean, shear_stress_error, pressure_mean, pressure_error, energy_mean, energy_error, contact_number_mean, \
contact_number_error, jammed_mean, jammed_error, plastic_mean, plastic_error, dissipated_mean, dissipated_error | float
  | | means over strain > `discard`, jammed or not; errors from the autocorrelation
shear_stress_samples, pressure_samples, energy_samples, contact_number_samples, jammed_samples, plastic_samples, \
dissipated_samples | float | | effective sample size of each series; 1 for a constant one, whose
  error, 0 here, is not known
""".replace("\\\n", "")
    + DISK_ROWS,
    common=PROVENANCE,
)

JAM = Format(
    datasets=r"""
phi, seed | (S,) | float | | φ; seed of the random start, which is another one at each φ
energy, pressure | (S,) | float | `units` | U/N and p at the minimum, nan where none was found
jammed | (S,) | float | | 1 where U/N exceeds `energy_cut` k, else 0
contact_number | (S,) | float | | 2N_c/N of all N disks, rattlers included; `coordination` leaves them out
strain | (S,) | float? | | protocol shear: γ; samples of one seed are of one run
phi_J | (S,) | float? | | protocol compress: φ where this sample's energy vanishes, to 1e-5
segregation | (S,) | float? | | protocol compress: assortativity of sizes among neighbours (gap below 0.2 mean
  diameters), 0 mixed, 1 separated; nan for one size
""",
    attributes=r"""
protocol | text in random shear compress | | how samples were made
step, strain, discard, every | float? | | of shear: Δγ, γ of each run, γ before the first sample and between samples;
  of compress: Δγ, and γ by which a sample is sheared before its φ_J is determined
separated | bool? | | true if large disks started on one side of the cell, else missing
temperature, cooling_rate, sweeps | float, float, int? | | of compress: T in units of energy over `k`, decrease of ln T
  per sweep of N moves, sweeps at T
energy_cut, tolerance | float | | 1e-16, with α > 5/2 its power 2α/5; max\|F\|/(p d) of a minimum
"""
    + DISK_ROWS,
    common=PROVENANCE,
)

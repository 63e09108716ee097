"""Formats of results: flows, oscillations, step strains, correlations, collapses, fits of flow curves."""

from jampetsc.io.declaration import Format
from jampetsc.io.provenance import PROVENANCE
from jampetsc.packing.potentials import EXPONENTS, MAX_EXPONENT, MIN_EXPONENT, STIFFNESSES

CORRELATION = Format(
    datasets=r"""
omega | (F,) | float | 1/time | frequencies
G | (F,) | complex | k | G* there, the mean over the packings
lane_width | (W,) | float | length | of lanes along x
delta | (W, X + 1) | float | length | mean δ of the pairs in a bin; the first is 0
C, C_error | (W, F, 2, X + 1) | float | | C(δ) = ⟨u_y(x) u_y(x + δ)⟩/⟨u_y²⟩ and its standard error; nan in empty bins
length, length_error | (W, F, 2) | float | length | first root of C; nan without one
minimum, minimum_error | (W, F, 2) | float | length | δ of the smallest C
""",
    attributes=r"""
packings | int | | number of packings averaged
pairs | (W,) int | | number of pairs of disks for each lane width
phase | text in stress strain | | what Re u_y is in phase with; `strain` where it is missing
along | text in x y both | | axis of the lanes: u_y along x, u_x along y or the mean of both; `x` where it is missing
L, mean_diameter | float > 0 | length | side of the cell along x, mean diameter
""",
    common=PROVENANCE,
)

OSCILLATE = Format(
    datasets=r"""
omega | (M,) | float | 1/time | ω, increasing
amplitude | (A,) | float | k | of what is imposed: stress, of spheres in k/length, or strain, which has no unit
G | (A, M) | complex | k | G* = first harmonic of the stress over that of the strain
error | (A, M) | float | k | estimate of \|ΔG*\|: the difference from the result with half of the steps, plus the
  errors of the solver and of ending after finitely many cycles
G_error | (A, M) | complex? | k | moving contacts: errors of G' and G'' as real and imaginary part. Where cycles
  fluctuate, of the mean over cycles, a 68 % interval, plus the energy that steps lose
harmonics | (A, M, 2) | complex | | third and fifth harmonic over the first, of the strain where stress is imposed and
  the other way round
work | (A, M) | float | k | ∮σdγ of a cycle, per area, of spheres per volume
energy_balance | (A, M) | float | | energy dissipated in a cycle and, with moving contacts, stored, over the work,
  minus 1
harmonics_error | (A, M, 2) | float? | | errors of \|harmonics\|: the difference from half of the steps or, where
  cycles fluctuate, of the mean over them
strain_waveform | (A, M, T) | float? | | γ at T equal intervals of a cycle, the first at ωt = 0 of a drive ∝ sin ωt;
  mean of the cycles that G is the mean of, without drift
stress_waveform | (A, M, T) | float? | k | σ at these times, likewise
repeats | (A, M) | bool? | | moving contacts: whether later cycles hardly change G; else cycles fluctuate
averaged_cycles | (A, M) | int? | | moving contacts: number of cycles that G, harmonics, work and waveforms are means
  of: 1 where cycles repeat, else those after the transient
regularisation_effect | (A, M) | float? | k | fixed contacts: estimate of \|ΔG*\| when `regularisation` is halved
cycle_change | (A, M) | float? | k | moving contacts: \|ΔG*\| between the last two cycles
drift | (A, M) | float? | | moving contacts: change of the strain in the last cycle under an imposed stress
newton_steps | (A, M) | int | | work
linear_iterations | (A, M) | int? | | work where `solver` is `cycle`
factorisations | (A, M) | int? | | work where `solver` is `steps`
steps_taken | (A, M) | int? | | moving contacts: time steps of all cycles; of a step that was halved, its parts
cycles | (A, M) | int? | | moving contacts: number of cycles in both runs, with half of the steps and with all
""",
    attributes=r"""
load, stress_measure | text? | | the displacement gradient E: a name, or its numbers (missing: simple shear `xy`), and
  the stress measure of G*: energy along F = 1 + εE
control, contacts, steps | text in stress strain, text in fixed moving, int > 0 | | what is imposed; whether contacts
  move; steps of a cycle
solver | text in cycle steps | | `cycle`: a whole cycle at once, for fixed contacts; `steps`: time steps, for moving
  contacts
regularisation | float | | force below which a contact counts as linear, over the force at the rms velocity; 0 for
  linear damping
""",
    common=PROVENANCE,
)

RELAX = Format(
    datasets=r"""
time | (T,) | float | time | t, increasing
strain | (S,) | float | | step strains γ, increasing
G | (S, T) | float | k | G(t, γ) = (σ(t) − σ(0⁻))/γ, σ the elastic and viscous stress of the load per volume before the
  step; from `relaxed_time` on its last value
error | (S, T) | float | k | estimate of \|ΔG\|: the difference from a result with time steps twice as long
energy | (S, T) | float | k | U(t) − U(0⁻) per volume before the step
dissipated | (S, T) | float | k | energy dissipated since 0⁺ per volume: `initial_energy` = `energy` + `dissipated`
contacts_opened, contacts_closed | (S, T) | int | | contacts of the packing at rest that do not touch at t, and contacts
  that it did not have
initial_G | (S,) | float | k | G(0⁺), without the Dirac part of the step
initial_energy | (S,) | float | k | U(0⁺) − U(0⁻) per volume
relaxed_time | (S,) | float | time | t from which forces balance; nan: not within the times
negative_modes | (S,) | int | | of K with pre-stress at the end, 0 for a minimum; −1 where it is not at rest or not
  rigid
newton_steps, factorisations, steps_taken | (S,) | int | | work of both runs; of a step that was halved, its parts
""",
    attributes=r"""
load, stress_measure | text | | the displacement gradient E: a name, or its numbers, and the stress measure: energy
  along F = 1 + γE
accuracy | float > 0 | | relative error of energy that time steps may have
rest_stress | float | k | σ(0⁻), the stress of the load in the packing at rest
""",
    common=PROVENANCE,
)

POTENTIAL_ROWS = f"""
potential | text in {" ".join(EXPONENTS)} | | energy of an overlap
exponent | float? | | α of the potential `power`, from {MIN_EXPONENT:g} to {MAX_EXPONENT:g}
stiffness | text in {" ".join(STIFFNESSES)} | | convention of the contact stiffness
""".strip()

DISK_ROWS = f"""
units | text | | of the disks
{POTENTIAL_ROWS}
dimension | int in 2 3? | | 3 for spheres, else missing
sizes | text? | | law of the sizes, or list of radii, where the run has made the particles
"""

FLOW = Format(
    datasets=r"""
strain | (T,) | float | | γ at the end of a row
time | (T,) | float | time | t there
shear_stress, pressure | (T, 3) | float | `units` | elastic, viscous and kinetic parts of σ and p
energy, dissipation | (T,) | float | | U, plus for disks with a mass the kinetic energy of `velocities` and spins;
  dissipated power
contact_number, clusters, largest_cluster, deepest_overlap | (T,) | float | | 2N_c/N of all N disks, rattlers included
  (not `coordination`, which leaves them out), number of clusters of touching disks, disks in the largest, largest
  overlap over σ_ij
start/shear_stress, start/pressure | (3,) | float? | `units` | with `--series`: parts of σ and p at γ = 0, as shear
  sets in
start/energy, start/dissipation | scalar | float? | | likewise
start/contact_number, start/clusters, start/largest_cluster, start/deepest_overlap | scalar | float? | | likewise
wall_shear_stress, wall_pressure | (T,) | float? | `units` | with `--walls`: force per length of the disks on the
  walls at the end of a row, mean of both, along and across them
velocity_profile | (T, 20) | float? | γ̇H | with `--walls`: mean v_x of the disks in 20 layers of equal height H/20 at
  the end of a row, from −½ at the lower wall to ½ at the upper one; nan without disks
snapshots/strain | (S,) | float? | | with `--snapshots` or `--snapshot-every`: their strain
snapshots/cell | (S, D, D) | float? | length | their cell
snapshots/radii | (N,) | float? | length | radii of the disks
snapshots/positions | (S, N, D) | float? | length | centres; with `--walls` the disks of the walls come first
snapshots/velocities | (S, N, D) | float? | length/time | velocities without the affine flow, at these positions
  (backward Euler)
snapshots/images | (S, N, D) | int? | | k₁, k₂: x + k₁ a₁ + k₂ a₂ with the `cell` of the snapshot is the position that
  was never folded back into the cell, `flow.snapshot(i).unwrapped`; between snapshots it changes by Δγ y and the
  non-affine displacement. Older files have none
snapshots/spins | (S, N) or (S, N, 3) | float? | 1/time | laws with rotations: angular velocities; that of
  uniform shear is −γ̇/2 about z
snapshots/psi6_local, snapshots/psi6_global | (S,) | float? | | six-fold order ⟨\|ψ₆\|⟩ and \|⟨ψ₆⟩\| of results
  kept without positions
state/base, state/offset, state/offsets, state/velocities, state/accelerations | (N, D) | float | | `state`: with which
  `jampetsc flow FILE --strain MORE` continues; not for analysis
state/radii | (N,) | float | | likewise
state/spins, state/spin_rates | (N,) or (N, 3) | float | | likewise
state/cell_base, state/cell_offset | (D, D) | float | | likewise
state/images | (N, D) | int | | likewise
state/order | (N,) | int | | likewise, a permutation
state/tally | (10,) | float | | likewise
state/skin | scalar | float | | likewise
state/sorted_at | scalar | float | | likewise
state/steps, state/list_age, state/rebuilds | scalar | int | | likewise
state/substeps | scalar | int | | likewise
state/started | scalar | bool | | likewise
""",
    attributes=r"""
rate, phi, model | float > 0, float > 0, text | | γ̇, φ, the model
mass, quality, background_drag | float? | | mass of a disk; Q and δ if they were given
shear_stress_mean, shear_stress_error, pressure_mean, pressure_error | float | `units` | means over strain > `discard`,
  errors from their autocorrelation
contact_number_mean, contact_number_error | float | | likewise
largest_cluster_mean | float | | disks in the largest cluster of touching disks, mean over strain > `discard`
shear_stress_samples, pressure_samples, contact_number_samples | float | | effective sample size; below
  20 the error is rough
energy_balance, correlation_strain, discard | float | | σγ̇V/⟨D⟩, nan where disks follow the
  affine flow; correlation strain of σ; strain left out of the means
walls | int? | | with `--walls`: number of disks of a wall; φ is then that of the other disks in the area between the
  walls
wall_shear_stress_mean, wall_shear_stress_error, wall_pressure_mean, wall_pressure_error | float? | `units` | with
  `--walls`: means over strain > `discard`, as those above
wall_shear_stress_samples, wall_pressure_samples | float? | | likewise
method, step, tolerance, settings | text, float, float, text | | integrator, time step, tolerance of CD0's solve, and
  as JSON what a run that continues this one keeps
substeps | int | | number of parts of divided time steps, which are halved until no disk moves by more than a quarter
  of the largest diameter: CD0 from a random start of many disks
"""
    + DISK_ROWS,
    common=PROVENANCE,
)

VELOCITY_CORRELATION = Format(
    datasets=r"""
x | (X,) | float | length | middle of each bin of \|x\|
g_y, g_y_error | (X,) | float | | ⟨v_y v_y⟩/⟨v_y²⟩ of pairs with \|y\| < `lane_width`/2, one standard error over
  snapshots; nan without pairs
pairs | (X,) | float | | number of pairs, all snapshots
""",
    attributes=r"""
lane_width, bin_width | float > 0 | length | width of a lane in y, width of a bin in x
mean_diameter | float > 0 | length | mean diameter of the disks
snapshots | int | | number of snapshots of all files
mean_square | float | | ⟨u_y²⟩/γ̇²
minimum, minimum_at | float | | least g_y, and the x of the parabola through it and its neighbours
minimum_error, minimum_at_error | float | | their standard errors, from blocks of snapshots; nan for fewer than 20
model, rate, units | text, float, text | | as in the flow files
mass | float? | | as in the flow files
""",
    common=PROVENANCE,
)

COLLAPSE = Format(
    datasets=r"""
phi | (M,) | float | | φ
rate | (M,) | float? | 1/time | γ̇, of fits to rates
size | (M,) | float? | | L = N^(1/D), of fits to sizes
N | (M,) | float | | number of disks
value, error, runs | (M,) | float | | the observable, its error (half of a 68 % interval), number of runs or samples
  averaged
x, leading, correction | (M,) | float | | x, and the two parts of the fit, b^(y/zν) f₀ and b^(y/zν + ω) f₁
correlations | (P, P) | float? | | correlations of the errors of the parameters in `fitted`, of the linearised model
curve/x, curve/f0, curve/f1 | (200,) | float | | the scaling functions
drift/cut, drift/chi2_per_dof | (K,) | float | | largest rate or smallest N of fits to fewer and fewer points; their
  χ²/dof
drift/parameters, drift/errors | (K, P) | float | | their parameters and errors (nan: not determined by the data)
""",
    attributes=r"""
dimension | int in 2 3? | | 3 for spheres, else missing
observable, scaling, fitted | text, text in rate size, text | | the observable; what it scales with; names of the free
  parameters in the order of the columns
functions, corrections | text, bool | | polynomial or spline and its degree; whether there is f₁
phi_J, y, znu, nu, omega | float, float, float > 0, float > 0, float? | | parameters, fitted or fixed; for rates zν
  and ω, which is ω/z, for sizes ν
phi_J_error, y_error, znu_error, nu_error, omega_error | float? | | standard errors of the fitted ones, nan where the
  data do not determine them
*_low, *_high | float? | | ends of the 2σ interval of each fitted one (`y_low`, …), infinite where the data give none
*_shift | float? | | part of its error: the change by fits of higher degrees
notes | text? | | warnings about these numbers, separated by `; `
chi2, dof, probability | float, int > 0, float | | χ², degrees of freedom, probability of a χ² at least as large
common_share | float? | | share of the squared errors that is fitted as common to a rate or size
potential, stiffness, units, sizes, model, protocol | text? | | of the files
mass, exponent | float? | | of the files
""",
    common=PROVENANCE,
)

SCALING = Format(
    datasets=r"""
groups/phi, groups/yield_stress, groups/flow_index | (G,) | float | | of each fit of σ = σ_y + A γ̇^n: φ, σ_y in
  `units`, n
groups/consistency | (G,) | float | `units` timeⁿ | A
groups/yield_stress_low, groups/yield_stress_high, groups/consistency_low, groups/consistency_high, \
groups/flow_index_low, groups/flow_index_high | (G,) | float | | ends of the 95 % intervals, infinite where the data
  give none, nan of what is not fitted
groups/N, groups/seeds, groups/dof | (G,) | int | | number of particles; seeds that have all rates, 1 where they differ
  between rates; degrees of freedom
groups/jackknifed | (G,) | bool | | whether intervals are from the scatter of seeds, else from the profile of χ²
groups/chi2, groups/probability | (G,) | float | | χ², probability of a χ² at least as large
groups/quasistatic_shear_stress, groups/quasistatic_shear_stress_error, groups/quasistatic_pressure, \
groups/quasistatic_pressure_error | (G,) | float | `units` | means of quasistatic shear and their errors, nan without
groups/difference, groups/difference_low, groups/difference_high | (G,) | float | `units` | σ_y minus quasistatic σ, and
  its 95 % interval; nan without quasistatic shear
group, runs | (M,) | int | | of each point: number of its fit, from 0; number of flows
rate | (M,) | float | 1/time | γ̇
shear_stress, shear_stress_error, pressure, pressure_error | (M,) | float | `units` | means over the flows and their
  errors (halves of 68 % intervals)
residual | (M,) | float | | σ minus the law, over the error
drift/group | (K,) | int | | of each fit with the largest rates left out one by one: number of its group
drift/cut | (K,) | float | 1/time | its largest rate
drift/yield_stress, drift/consistency, drift/flow_index, drift/yield_stress_low, drift/yield_stress_high, \
drift/consistency_low, drift/consistency_high, drift/flow_index_low, drift/flow_index_high | (K,) | float | | as above
drift/probability | (K,) | float | | probability of a χ² at least as large
""".replace("\\\n", ""),
    attributes=r"""
form | text in herschel-bulkley bingham power-law | | the law that was fitted
groups | text | | what tells the groups apart, in words separated by `; `, empty for one
dimension | int in 2 3? | | 3 for spheres, else missing
notes | text? | | warnings about these numbers, separated by `; `
units, sizes, model | text? | | of the files
mass | float? | | of the files
"""
    + POTENTIAL_ROWS,
    common=PROVENANCE,
)

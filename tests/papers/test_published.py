"""Figures of the papers have the runs that the works print, and ranges that their claims need."""

import tomllib
from functools import cache
from itertools import product

import launch
import pytest
from test_figures import shown

from jampetsc.options.parameters import parameters
from jampetsc.options.values import FREQUENCIES
from jampetsc.studies.plan import plan
from jampetsc.studies.table_keys import number_of

PUBLISHED = tomllib.loads((launch.ROOT / "papers" / "published.toml").read_text())
MODES = ("--quick", "--paper")


@cache
def tasks(figure, mode):
    """[{option: value}] of the tasks of a figure, with defaults."""
    rows = []
    for task in (
        task for part, study in shown(figure, mode)[0].items() for task in plan(part, study.encode())
    ):
        job = task.settings.job
        usual = {name: parameter.default for name, parameter in parameters(type(job)).items()}
        law = dict(job.law.options if hasattr(job, "law") else ())
        rows.append({"command": task.command} | usual | job.settings() | law | task.columns)
    return rows


def values(rows, option, **where):
    """The values of an option among tasks with these others."""
    chosen = [row for row in rows if all(row.get(name) == value for name, value in where.items())]
    return {number_of(row[option]) for row in chosen if row.get(option) is not None}


@pytest.mark.parametrize("figure", PUBLISHED)
def test_a_figure_has_the_runs_that_the_work_prints(figure):
    for command, options in PUBLISHED[figure].items():
        for option, printed in options.items():
            found = values(tasks(figure, "--paper"), option, command=command)
            assert found >= {number_of(value) for value in printed}, (command, option)


@pytest.mark.parametrize("figure", ["bt-fig3", "bt-fig4", "bt-fig6"])
def test_moduli_reach_from_below_the_lowest_crossover_to_the_viscous_end(figure):
    """ω ~ p is the lowest."""
    for omega in values(tasks(figure, "--paper"), "omega", command="sweep"):
        omega = FREQUENCIES.read(omega)
        assert omega.min() <= 1e-8 and omega.max() >= 1e3 and 71 <= len(omega) <= 141


@pytest.mark.parametrize(("law", "own"), [("contact", {"beta": 1.0}), ("stokes", {"eta_f": 1.0})])
def test_the_viscosity_of_many_sizes_can_be_compared(law, own):
    rows = tasks("bt-fig8", "--paper")
    sizes = values(rows, "n", command="quasistatic", law=law)
    slow = {n: values(rows, "pressure", command="quasistatic", law=law, n=n, **own) for n in sizes}
    x = {n: [p * n**2 for p in some] for n, some in slow.items()}
    assert min(map(min, x.values())) < 1e-2 and max(map(max, x.values())) > 1e4
    for decade in range(7):
        inside = [n for n, some in x.items() if any(0.1 <= one / 10.0**decade <= 10 for one in some)]
        assert len(inside) >= (3 if decade < 6 else 2), decade


@pytest.mark.parametrize("mode", MODES)
def test_rates_and_densities_of_flows(mode):
    flows = tasks("vagberg-fig5.1", mode)
    phis = {phi for phi in values(flows, "phi") if 0.8 <= phi <= 0.87}  # farther ones have fewer rates
    rates = values(flows, "rate", phi=0.8433)
    assert (
        0.8433 in phis and sum(phi < 0.8433 for phi in phis) >= 4 and sum(phi > 0.8433 for phi in phis) >= 2
    )
    assert all(values(flows, "rate", phi=phi) == rates for phi in phis)  # both branches at every rate
    assert len(rates) >= 5 and min(rates) == (1e-5 if mode == "--paper" else 1e-4)
    for model, q in product(("CD", "CDn", "CDt", "RD"), (1, 10, 30)):
        rates = values(tasks("paper4", mode), "rate", model=model, quality=q)
        assert sorted(rates)[1] * q < 4e-3  # hard disks: γ̇ is small beside the rate of a collision

"""What the scripts of run/figures ask for is what the papers have: sizes, pressures, rates, laws, models, pictures."""

import os
import re
from functools import cache
from itertools import product

import pytest
from test_figures import shown

from jampetsc.options.parameters import parameters
from jampetsc.options.values import FREQUENCIES
from jampetsc.studies.plan import plan
from jampetsc.studies.table_keys import number_of

MODES = ("--quick", "--paper")
# figures [mode] commands option [with these others] = the values that their tasks have of it, or >= some of them
ASKED = """\
bt-fig1 pack pressure = 1e-4
bt-fig3,bt-fig4,bt-fig5,bt-fig6,bt-fig7,bt-modes pack pressure = 1e-2 1e-3 1e-4 1e-5
bt-fig1,bt-fig3,bt-fig4,bt-fig5,bt-fig6,bt-fig7,bt-fig8,bt-modes pack stabilise = volume
bt-fig1,bt-fig3,bt-fig4,bt-fig5,bt-fig6 --paper pack n = 32768
bt-fig7,bt-fig8,bt-modes --paper pack n >= 32768
bt-fig1,bt-fig3,bt-fig4,bt-fig5,bt-fig6,bt-fig7,bt-fig8,bt-modes --paper pack seed n=32768 >= 1 2 3 4 5 6 7 8 9 10
bt-fig1 sweep omega beta=1 rotations=1 prestress=1 = 1e-10:1e4:141
bt-fig1 sweep fields beta=1 rotations=1 prestress=1 = 1e-10,1e-3,1e4
bt-fig3 sweep pressure beta=1 rotations=1|0 prestress=1 = 1e-2 1e-3 1e-4 1e-5
bt-fig3 sweep pressure beta=1 rotations=1 prestress=0 = 1e-2 1e-3 1e-4 1e-5
bt-fig3,bt-fig5 quasistatic pressure beta=1 rotations=1 prestress=1 = 1e-2 1e-3 1e-4 1e-5
bt-fig4 sweep pressure beta=0 prestress=1|0 = 1e-2 1e-3 1e-4 1e-5
bt-fig4 sweep beta pressure=1e-4 prestress=1|0 = 0 1e-6 1e-5 1e-4 1e-3 1e-2 0.1 1 10
bt-fig4 sweep beta pressure=1e-2|1e-3|1e-5 prestress=1|0 = 0
bt-fig4 quasistatic betas = 1e-8,1e-7,1e-6,1e-5,1e-4,1e-3,1e-2,1e-1,1,1e1,1e2
bt-fig6 sweep,quasistatic law = stokes
bt-fig6 sweep pressure eta_f=1 prestress=1 = 1e-2 1e-3 1e-4 1e-5
bt-fig6 sweep eta_f pressure=1e-4 prestress=1 = 1e-5 1e-4 1e-3 1e-2 0.1 1 10 100 1e3 1e4 1e5
bt-fig6 quasistatic pressure eta_f=1 = 1e-2 1e-3 1e-4 1e-5
bt-fig7 sweep law = contact stokes
bt-fig7 sweep fields law=contact beta=1 = 1e-9,1e-3,1e3
bt-fig7 sweep omega law=contact beta=1 = 1e-9,1e-3,1e3
bt-fig7 sweep fields law=stokes eta_f=0 = 1e-7:10:17
bt-fig7 sweep omega law=stokes eta_f=0 = 1e-7:10:17
bt-fig7 correlate lane = 0.5,0.25,0.125
bt-fig7 correlate phase = stress strain
bt-modes modes count prestress=0 = 200
bt-modes modes prestress = 0
bt-nonlinear pack pressure >= 1e-4
bt-nonlinear oscillate alpha >= 0.5 0.6667
bt-nonlinear --quick oscillate n alpha=0.5|0.6667 >= 512
compression pack pressure = 1e-2 1e-3 1e-4 1e-5
compression sweep,quasistatic law = contact stokes
compression sweep load = tensor
compression sweep prestress law=contact|stokes = 0 1
compression sweep eta_f law=stokes = 0
compression quasistatic load law=contact|stokes = xy compression
contact-lifetimes flow model = CD CDn RD
contact-lifetimes flow quality = 3
contact-lifetimes flow phi = 0.78
contact-lifetimes flow rate model=CD|CDn|RD = 1e-4 3e-4
lees-edwards flow model = CD CD0 RD0
lees-edwards flow walls = 0
overdamped-limit flow model = CD CD0 CDn CDt RD RD0
overdamped-limit flow quality model=RD|CD >= 0.03 0.1 1
overdamped-limit flow quality model=CDn|CDt >= 0.1 1
paper1 --quick jam cooling_rate protocol=compress = 1e-1 1e-2 1e-3
paper1 --paper jam cooling_rate protocol=compress = 1e-1 1e-2 1e-3 1e-4
paper1 jam separated protocol=compress|shear = 0 1
paper1 --quick jam strain protocol=compress = none 3
paper1 --quick jam step protocol=shear = 2e-3 6.667e-4
paper1 jam potential = harmonic
paper2 --quick jam n protocol=random = 32 64 128 256
paper2 --quick jam n protocol=shear = 32 64 128
paper2 --paper jam n protocol=random|shear = 32 64 128 256 512 1024
paper2 --quick jam step protocol=shear = 2e-3
paper2 --quick jam phi protocol=shear = 0.82 0.83 0.835 0.84 0.845 0.85 0.855
paper3 jam phi protocol=random|shear = 0.84
paper3 jam potential protocol=random|shear = harmonic hertzian
paper3 --quick jam n protocol=random|shear = 64
paper3 --paper jam n protocol=random|shear = 64 256
paper4 flow model = CD CDn CDt RD
paper4 flow quality model=CD|CDn|CDt|RD >= 1 3 10 30
paper4 flow phi model=CD|CDn|CDt|RD quality=10 >= 0.74 0.78
paper4 --quick flow quality model=CD = 0.3 1 3 10 30
paper4 --paper flow quality model=CD = 0.1 0.3 1 3 10 30
paper5 flow model = CD CD0 RD0
paper5 --quick flow phi model=RD0|CD0 = 0.8 0.82 0.83 0.84 0.8433 0.848 0.86
paper5 --paper flow phi model=RD0|CD0 = 0.8 0.82 0.83 0.838 0.8433 0.848 0.852 0.86
paper5 --quick flow rate model=RD0|CD0 phi=0.8|0.8433 = 1e-4 3e-4 1e-3 3e-3 1e-2
paper5 --paper flow rate model=RD0|CD0 phi=0.8|0.8433 = 1e-5 3e-5 1e-4 3e-4 1e-3 3e-3 1e-2
paper5 flow quality model=CD phi=0.8|0.8433 = 0.1 0.3 1
paper5 correlate model = CD CD0
split-coordinates pack pressure >= 1e-7
three-dimensions pack,sweep,quasistatic pressure >= 1e-2 1e-3 1e-4 2e-5
three-dimensions pack dimension = 3
three-dimensions --paper pack seed n=8192 pressure=1e-4|2e-5 >= 1 2 3 4 5 6 7 8 9 10 11 12
three-dimensions --paper pack n >= 8192
three-dimensions sweep prestress = 0 1
three-dimensions-flow flow dimension = 3
three-dimensions-flow flow model = RD0
three-dimensions-flow flow phi >= 0.6425 0.6475
three-dimensions-flow --paper flow rate phi=0.635|0.6425|0.6475|0.655 = 1e-4 3e-4 1e-3 3e-3 1e-2
three-dimensions-jamming jam dimension = 3
three-dimensions-jamming jam protocol = random
three-dimensions-jamming jam phi n=256 >= 0.635 0.64 0.6425 0.6475
three-dimensions-jamming --paper jam n >= 64 128 256 512 1024
vagberg-fig4.6-4.7 flow n = 256
vagberg-fig4.6-4.7 flow phi = 0.8
vagberg-fig4.6-4.7 flow rate = 1e-3
vagberg-fig4.6-4.7 flow strain = 100
vagberg-fig4.6-4.7 flow discard = 0
vagberg-fig4.6-4.7 flow sizes = bidisperse monodisperse
vagberg-fig4.8,vagberg-fig5.1 flow n = 1024
vagberg-fig4.8 flow model = RD0 CD0
vagberg-fig4.8 flow phi model=RD0|CD0 = 0.8 0.8433
vagberg-fig4.8 --quick flow,correlate rate model=RD0|CD0 phi=0.8|0.8433 = 1e-4 1e-3 1e-2
vagberg-fig4.8 --paper flow,correlate rate model=RD0|CD0 phi=0.8|0.8433 = 1e-5 1e-4 1e-3 1e-2
vagberg-fig4.8 correlate bin model=RD0 = 0.1667 0.25 0.3333
vagberg-fig4.8 --quick flow snapshots = 200
vagberg-fig4.8 --paper flow snapshots = 400
vagberg-fig5.1 flow model = RD0
vagberg-fig5.1 flow phi >= 0.6 0.95
vagberg-fig5.1-slow flow model = RD0
vagberg-fig5.1-slow --paper flow n = 4096
vagberg-fig5.1-slow --paper flow rate >= 1e-6 3e-6 1e-5 3e-5 1e-4 3e-4
vagberg-flow-curves flow model = CDn RD0
vagberg-flow-curves flow quality model=CDn = 1
vagberg-flow-curves flow rate model=CDn phi=0.78 >= 1e-4 3e-4 1e-3
vagberg-flow-curves --quick flow rate model=RD0 phi=0.8|0.8433 n=1024 >= 1e-4 1e-3
vagberg-flow-curves --paper flow rate model=RD0 phi=0.8|0.8433 n=1024 >= 1e-5 1e-4
vagberg-flow-curves --quick flow rate model=RD0 phi=0.8433 n=4096 >= 1e-4 1e-3
vagberg-flow-curves --paper flow rate model=RD0 phi=0.8433 n=4096 >= 1e-5 1e-3
walls flow walls = 1
walls flow model = CD CD0
walls --quick flow strain discard=5 = 20
walls --paper flow strain discard=15 = 30"""
PICTURES = """\
bt-fig1 draw.py bt-fig1.png
bt-fig1 draw.py bt-fig1-fields.png
bt-fig1 plot --kind moduli
bt-fig1 plot --kind fields --total --phase stress
bt-fig3 3a.png --kind moduli --where rotations=1,prestress=1
bt-fig3 3b.png --kind collapse --mu 0.5 --lambda 1 --where rotations=1,prestress=1
bt-fig3 3c.png --kind exponents --where command=sweep,rotations=1,prestress=1
bt-fig3 3d.png --kind exponents --where command=quasistatic
bt-fig4 draw.py bt-fig4a.png
bt-fig4 draw.py bt-fig4b.png
bt-fig4 4a.png --kind collapse --mu 0.5 --lambda 0 --where beta=0,prestress=1
bt-fig4 4a-no-prestress.png --kind collapse --mu 0.5 --lambda 0 --where beta=0,prestress=0
bt-fig4 4b.png --kind moduli --where command=sweep,pressure=1e-4,prestress=1
bt-fig4 4b-inset.png --kind viscosities --where pressure=1e-4
bt-fig5 5.png --kind medians
bt-fig6 6a.png --kind collapse --mu 0.5 --lambda 1 --where eta_f=1,prestress=1
bt-fig6 6b.png --kind moduli --where command=sweep,pressure=1e-4,prestress=1
bt-fig7 draw.py bt-fig7a.png
bt-fig7 draw.py bt-fig7cd.png
bt-fig7 7a.png --kind correlation --where law=contact,phase=stress,pressure=1e-4
bt-fig7 7b.png --kind correlation --where law=stokes,eta_f=0,phase=stress,pressure=1e-4
bt-fig7 7cd.png --kind length --where law=stokes,eta_f=0,phase=stress
bt-fig7 draw.py bt-fig7cd-in-phase-with-the-strain.png
bt-fig8 draw.py bt-viscosity-ratio.png
bt-fig8 8a.png --kind finite-size --where law=contact
bt-fig8 draw.py bt-fig8b.png
bt-modes plot --kind lowest-modes
paper2 draw.py paper2.png
paper4 plot --kind regimes
paper5 collapse --where model=RD0
paper5 collapse --where model=CD0
vagberg-fig4.6-4.7 draw.py vagberg-fig4.6-4.7.png
vagberg-fig4.6-4.7 4.6.png --kind snapshot --where sizes=monodisperse,seed=1
vagberg-fig4.6-4.7 4.7.png --kind snapshot --where sizes=bidisperse,seed=1
vagberg-fig4.6-4.7 plot --kind order
vagberg-fig4.8 4.8a.png --kind lanes --where model=RD0,phi=0.8
vagberg-fig4.8 4.8b.png --kind lanes --where model=CD0,phi=0.8
vagberg-fig5.1 collapse --observable pressure --fit phi_J,y,znu !--corrections
vagberg-fig5.1 collapse --observable shear_stress --fit phi_J,y,znu !--corrections
vagberg-fig5.1 draw.py vagberg-fig5.1.png
three-dimensions-flow collapse --observable pressure --fit phi_J,y,znu !--corrections
three-dimensions-flow collapse --observable shear_stress --fit phi_J,y,znu !--corrections
three-dimensions-flow plot --kind branches
three-dimensions-jamming collapse --finite-size --observable jammed --fit phi_J,y=0,nu !--corrections
three-dimensions-jamming collapse --finite-size --observable jammed --fit phi_J,y=0,nu,omega --corrections
vagberg-fig5.1-slow collapse --observable pressure --fit phi_J,y,znu !--corrections
vagberg-fig5.1 plot --kind branches
vagberg-flow-curves plot --kind flow
walls plot --kind profile"""


@cache
def asked(figure, mode):
    """([what a task of its studies is asked for, or has by default], [the words of a picture]) of a figure."""
    studies, pictures = shown(figure, mode)
    rows = []
    for task in (task for part, study in studies.items() for task in plan(part, study.encode())):
        job = task.settings.job
        usual = {name: one.default for name, one in parameters(type(job)).items()}
        law = dict(job.law.options if hasattr(job, "law") else ())
        rows.append({"command": task.command} | usual | job.settings() | law | task.columns)
    return rows, pictures


def values(rows, option, **where):
    """The values of an option among tasks with these others."""
    some = [row for row in rows if all(row.get(name) == value for name, value in where.items())]
    return {"none" if row.get(option) is None else number_of(row[option]) for row in some}


@pytest.mark.parametrize("line", ASKED.splitlines())
def test_a_figure_asks_for_what_the_paper_has(line):
    told, sign, wanted = re.split(r" (>?=) ", line)
    figures, *words = told.split()
    modes = [words.pop(0)] if words[0] in MODES else MODES
    commands, option, *others = words
    others = [
        [(name, number_of(one)) for one in ones.split("|")] for name, ones in (o.split("=") for o in others)
    ]
    wanted = {number_of(one) for one in wanted.split()}
    for figure, mode, command, where in product(
        figures.split(","), modes, commands.split(","), product(*others)
    ):
        found = values(asked(figure, mode)[0], option, command=command, **dict(where))
        assert found >= wanted if sign == ">=" else found == wanted, (figure, mode, where)


@pytest.mark.parametrize("line", PICTURES.splitlines())
def test_a_figure_draws_what_the_paper_draws(line):
    figure, *words = line.split()
    some = {word for word in words if word[0] != "!"}
    none = {word[1:] for word in words if word[0] == "!"}
    for mode in MODES:
        lines = [[os.path.basename(word) for word in picture] for picture in asked(figure, mode)[1]]
        assert any(
            not none & set(one) and all(any(w == o or o.startswith(f"{w},") for o in one) for w in some)
            for one in lines
        )


@pytest.mark.parametrize("figure", ["bt-fig3", "bt-fig4", "bt-fig6"])
def test_moduli_reach_from_below_the_lowest_crossover_to_the_viscous_end(figure):
    """ω ~ p is the lowest."""
    for omega in values(asked(figure, "--paper")[0], "omega", command="sweep"):
        omega = FREQUENCIES.read(omega)
        assert omega.min() <= 1e-8 and omega.max() >= 1e3 and 71 <= len(omega) <= 141


@pytest.mark.parametrize(("law", "own"), [("contact", {"beta": 1.0}), ("stokes", {"eta_f": 1.0})])
def test_the_viscosity_of_many_sizes_can_be_compared(law, own):
    rows = asked("bt-fig8", "--paper")[0]
    sizes = values(rows, "n", command="quasistatic", law=law)
    slow = {n: values(rows, "pressure", command="quasistatic", law=law, n=n, **own) for n in sizes}
    x = {n: [p * n**2 for p in some] for n, some in slow.items()}
    assert min(map(min, x.values())) < 1e-2 and max(map(max, x.values())) > 1e4
    for decade in range(7):
        inside = [n for n, some in x.items() if any(0.1 <= one / 10.0**decade <= 10 for one in some)]
        assert len(inside) >= (3 if decade < 6 else 2), decade


@pytest.mark.parametrize("mode", MODES)
def test_rates_and_densities_of_flows(mode):
    flows = asked("vagberg-fig5.1", mode)[0]
    phis = {phi for phi in values(flows, "phi") if 0.8 <= phi <= 0.87}  # farther ones have fewer rates
    rates = values(flows, "rate", phi=0.8433)
    assert (
        0.8433 in phis and sum(phi < 0.8433 for phi in phis) >= 4 and sum(phi > 0.8433 for phi in phis) >= 2
    )
    assert all(values(flows, "rate", phi=phi) == rates for phi in phis)  # both branches at every rate
    assert len(rates) >= 5 and min(rates) == (1e-5 if mode == "--paper" else 1e-4)
    for model, q in product(("CD", "CDn", "CDt", "RD"), (1, 10, 30)):
        rates = values(asked("paper4", mode)[0], "rate", model=model, quality=q)
        assert sorted(rates)[1] * q < 4e-3  # hard disks: γ̇ is small beside the rate of a collision

"""What the figures of steady flow ask for is what Vågberg's thesis has: N, φ, γ̇, strain, models, and what is drawn."""

from itertools import pairwise

import pytest
from test_figures import shown

from jampetsc.studies.plan import plan

MODES = ((), ("--paper",))
PHI_J = 0.8433


@pytest.fixture(scope="module")
def asked():
    """The function (name, words) → ([a flow's keys], [other tasks], [words of a picture])."""

    def ask(name, words):
        studies, pictures = shown(name, *words)
        tasks = [task for part, study in studies.items() for task in plan(part, study.encode())]
        flows = [task.columns for task in tasks if task.command == "flow"]
        return flows, [task for task in tasks if task.command != "flow"], pictures

    return ask


def values(flows, name, **where):
    """The values of a key among those flows that have these others, in order."""
    return sorted({one[name] for one in flows if name in one and where.items() <= one.items()})


def drawn(pictures):
    """({(kind, where)} of pictures that `jampetsc plot` draws, the words of every `jampetsc collapse`)."""
    plots = [dict(pairwise(words)) for words in pictures if words[0] == "plot"]
    return {(words["--kind"], words.get("--where", "")) for words in plots}, [
        dict(pairwise(words)) for words in pictures if words[0] == "collapse"
    ]


@pytest.mark.parametrize("words", MODES)
def test_figures_4_6_and_4_7(asked, words):
    flows, _, pictures = asked("vagberg-fig4.6-4.7", words)
    for name, value in (("n", 256), ("phi", 0.80), ("rate", 1e-3), ("strain", 100), ("discard", 0)):
        assert values(flows, name) == [value]
    assert values(flows, "sizes") == ["bidisperse", "monodisperse"]
    wanted = {("snapshot", f"sizes={sizes}disperse,seed=1") for sizes in ("mono", "bi")}
    assert drawn(pictures)[0] == wanted | {("order", "")}


@pytest.mark.parametrize("words", MODES)
def test_figure_4_8(asked, words):
    flows, others, pictures = asked("vagberg-fig4.8", words)
    cases = [(model, phi) for model in ("RD0", "CD0") for phi in (0.80, PHI_J)]
    assert values(flows, "n") == [1024] and {(one["model"], one["phi"]) for one in flows} == set(cases)
    for model, phi in cases:
        rates = values(flows, "rate", model=model, phi=phi)
        assert rates == [1e-5, 1e-4, 1e-3, 1e-2][0 if words else 1 :]
    assert all(flow["strain"] > 1 and flow["snapshots"] >= 200 for flow in flows)
    assert len(others) == len(flows) and {task.command for task in others} == {"correlate"}
    assert drawn(pictures)[0] == {("lanes", f"model={model},phi={phi:g}") for model, phi in cases}


@pytest.mark.parametrize("words", MODES)
def test_figure_5_1(asked, words):
    flows, _, pictures = asked("vagberg-fig5.1", words)
    assert values(flows, "n") == [1024] and values(flows, "model") == ["RD0"]
    phis, rates = values(flows, "phi"), values(flows, "rate")
    assert PHI_J in phis and sum(phi < PHI_J for phi in phis) >= 4 and sum(phi > PHI_J for phi in phis) >= 2
    assert all(values(flows, "rate", phi=phi) == rates for phi in phis)  # both branches at every rate
    assert len(rates) >= 5 and rates[0] == (1e-5 if words else 1e-4)
    kinds, fits = drawn(pictures)
    assert ("branches", "") in kinds
    assert [fit["--observable"] for fit in fits] == ["pressure", "shear_stress"]
    assert all(fit["--fit"] == "phi_J,y,znu" and "--corrections" not in fit for fit in fits)


@pytest.mark.parametrize("words", MODES)
def test_flow_curves(asked, words):
    flows, _, pictures = asked("vagberg-flow-curves", words)
    lowest = 1e-5 if words else 1e-4
    for n in (1024, 4096):  # p at φ_J over γ̇ = 1e-3 … 1e-5
        rates = values(flows, "rate", model="RD0", phi=PHI_J, n=n)
        assert rates[0] == lowest and 1e-3 in rates
    assert {lowest, 10 * lowest} <= set(values(flows, "rate", model="RD0", phi=0.80))  # the Newtonian end
    assert values(flows, "model") == ["CDn", "RD0"] and values(flows, "quality", model="CDn") == [1]
    assert {1e-4, 3e-4, 1e-3} <= set(values(flows, "rate", model="CDn", phi=0.78))
    assert {kind for kind, _ in drawn(pictures)[0]} == {"flow"}


@pytest.mark.parametrize("words", MODES)
def test_paper_4(asked, words):
    flows, _, pictures = asked("paper4", words)
    assert values(flows, "model") == ["CD", "CDn", "CDt", "RD"]
    for model in values(flows, "model"):
        assert set(values(flows, "quality", model=model)) >= {1, 3, 10, 30}
        assert len(values(flows, "phi", model=model, quality=10)) >= 3
        for q in (1, 10, 30):  # hard disks: γ̇ is small beside the rate of a collision
            assert values(flows, "rate", model=model, quality=q)[1] * q < 4e-3
    assert values(flows, "quality", model="CD")[0] == (0.1 if words else 0.3)
    assert ("regimes", "") in drawn(pictures)[0]


@pytest.mark.parametrize("words", MODES)
def test_paper_5(asked, words):
    flows, others, pictures = asked("paper5", words)
    phis = values(flows, "phi", model="RD0")
    assert phis == values(flows, "phi", model="CD0") and PHI_J in phis and len(phis) >= 7
    for phi in (0.80, PHI_J):
        drag, contact, massive = (set(values(flows, "rate", model=m, phi=phi)) for m in ("RD0", "CD0", "CD"))
        assert min(drag & contact) == (1e-5 if words else 1e-4) and len(drag & contact) >= 5
        assert massive <= contact and values(flows, "quality", model="CD", phi=phi) == [0.1, 0.3, 1]
    assert values([flow for flow in flows if "snapshots" in flow], "model") == ["CD", "CD0"]
    assert {task.command for task in others} == {"correlate"}
    assert [fit["--where"] for fit in drawn(pictures)[1]] == ["model=RD0", "model=CD0"]


@pytest.mark.parametrize("words", MODES)
def test_walls(asked, words):
    flows, _, pictures = asked("walls", words)
    assert values(flows, "walls") == [True] and values(flows, "model") == ["CD", "CD0"]
    assert all(flow["discard"] >= 5 and flow["strain"] >= 2 * flow["discard"] for flow in flows)
    assert [kind for kind, _ in drawn(pictures)[0]] == ["profile"]

"""Laws as data: the table, what its rows mean, and what is refused."""

from functools import partial

import pytest
from samples import LAWS, physics, published

import jampetsc
from jampetsc.errors import InputError
from jampetsc.laws.damping import FAMILIES, MAX_WEIGHT, UNDAMPED, WEIGHTS, Law, damping_law

TRANSVERSE = physics(normal=0.0, rotations=False)


@pytest.mark.parametrize(
    ("law", "weights"),
    [
        (damping_law(), (1, 0, 1, 0, 0)),
        (damping_law(beta=0.5, normal=2.0), (2, 0, 0.5, 0, 0)),
        (damping_law(rotations=False, beta=0.5), (1, 0.5, 0, 0, 0)),
        (TRANSVERSE.law, (0, 1, 0, 0, 0)),
        (damping_law("stokes"), (0, 0, 0, 1, 1)),
        (damping_law("stokes", eta_f=0.0), (0, 0, 0, 1, 0)),
        (damping_law("custom", normal=1, transverse=0.3, drag=0.1), (1, 0.3, 0, 0.1, 0)),
        (damping_law("custom", sliding=0.5, eta_f=2.0), (0, 0, 0.5, 0, 2)),
        (UNDAMPED, (0, 0, 0, 0, 0)),
    ],
    ids=str,
)
def test_weights(law, weights):
    assert (*law.on_contacts, law.drag, law.eta_f) == weights
    assert (law.dofs(2), law.dofs(3)) == ((3, 6) if law.sliding else (2, 3))
    assert law.holds_translations == bool(law.drag)


START = {"custom": {"drag": 1.0}}  # by default nothing dissipates


@pytest.mark.parametrize("name", FAMILIES)
def test_every_option_of_a_family_does_something(name):
    family, base = FAMILIES[name], damping_law(name, **START.get(name, {}))
    defaults = {option: row.default for option, row in family.options.items()}
    assert base == damping_law(name, **defaults | START.get(name, {}))
    for option, row in family.options.items():
        other = base.altered(**{option: not row.default if isinstance(row.default, bool) else 0.25})
        assert [getattr(other, weight) for weight in WEIGHTS] != [getattr(base, weight) for weight in WEIGHTS]
        assert str(other) != str(base) and dict(other.options)[option] != row.default
    law = damping_law(beta=0.1, tau1=2.0, exponent=0.5, rotations=False).altered(beta=0.3)
    assert law == damping_law(beta=0.3, tau1=2.0, exponent=0.5, rotations=False)  # the rest is kept


@pytest.mark.parametrize(
    ("name", "options", "says"),
    [
        ("glue", {}, "law glue: not supported. Choose one of contact, stokes, custom"),
        ("stokes", {"beta": 1.0}, "beta: an option of law contact, not of stokes"),
        ("contact", {"eta_f": 1.0}, "eta_f: an option of law stokes or custom, not of contact"),
        ("stokes", {"rotations": False}, "rotations: an option of law contact"),
        ("contact", {"beta": -1.0}, "beta -1: must lie between 0 and 1e"),
        ("contact", {"normal": float("nan")}, "normal nan: must lie"),
        ("stokes", {"eta_f": 10 * MAX_WEIGHT}, "eta_f 1e+13: must lie"),
        ("contact", {"tau1": 0.0}, "tau1 0: must be positive"),
        ("contact", {"tau1": "slow"}, "tau1 'slow': must be a number"),
        ("contact", {"beta": None}, "beta None: must be a number"),
        ("contact", {"normal": 0.0, "beta": 0.0}, "nothing dissipates"),
        ("custom", {}, "custom law: nothing dissipates. Raise one of the weights"),
        ("custom", {"drag": -1.0}, "drag -1: must lie between 0 and 1e"),
        ("custom", {"beta": 1.0}, "beta: an option of law contact, not of custom"),
    ],
)
def test_refused(name, options, says):
    with pytest.raises(InputError) as caught:
        damping_law(name, **options)
    assert says in str(caught.value)


@pytest.mark.parametrize("name", ["normal", "transverse", "sliding", "drag", "eta_f"])
def test_weights_of_a_law_without_a_family_have_limits_too(name):
    assert getattr(Law("own", **{name: 1e12}), name) == 1e12
    assert damping_law(normal=MAX_WEIGHT).normal == MAX_WEIGHT
    for weight in (-1e-300, 1.001e12, float("nan"), float("inf")):
        with pytest.raises(InputError, match=rf"{name} = .*: must lie between 0 and 1e\+12"):
            Law("own", **{name: weight})
    for tau1 in (0.0, -1.0, float("inf"), float("nan")):
        with pytest.raises(InputError, match=r"tau1 .*: must be positive"):
            Law("own", normal=1.0, tau1=tau1)


def test_a_fluid_alone_does_not_damp_disks():
    """Viscosity of the fluid, without drag on a disk, leaves every motion free."""
    assert not Law("own", eta_f=1.0).damps_contacts
    with pytest.raises(InputError, match=r"nothing dissipates\. Raise one of the weights"):
        damping_law(normal=0.0, beta=0.0, rotations=False)
    for eta_f in (0.0, 1.0):
        for ask in (jampetsc.sweep, jampetsc.quasistatic, partial(jampetsc.flow, rate=1e-2, strain=0.1)):
            with pytest.raises(InputError, match=r"own: nothing dissipates\. Raise one of the weights"):
                ask(published(), Law("own", eta_f=eta_f))


@pytest.mark.parametrize("fluid", ["drag", "eta_f"])
def test_power_laws_are_refused_with_a_fluid(fluid):
    """The fluid's part is linear, and must not be left out silently."""
    law = Law("both", normal=1.0, **{fluid: 0.1})
    with pytest.raises(
        InputError, match=r"law both: not supported, the fluid dissipates as well\. Give a law of contacts"
    ):
        jampetsc.oscillate(published(), law, omega=1.0, strain=1e-6)
    with pytest.raises(
        InputError, match="alpha: power-law damping is of contacts alone, and both has a fluid"
    ):
        jampetsc.sweep(published(), law, alpha=0.5, stress=1e-6)


def test_samples_cover_the_table():
    """Every option of every family has a value that is not its default in some law that tests compare."""
    for name, family in FAMILIES.items():
        for option, row in family.options.items():
            values = {dict(one.law.options)[option] for one in LAWS.values() if one.law.family == name}
            assert values - {row.default}, option

"""The plants of chapter 2 against their transfer functions."""

import numpy as np
import pytest
from scipy import signal

from models import (
    LinearPlant,
    mass_spring_damper,
    sinusoid,
    stable_plant,
    state_space,
    step_reference,
    unstable_plant,
)
from ocp import ProblemError

# (2.49) and (2.52): zeros -1, -2; poles -1 +- j and -3 or 3.
NUMERATOR = np.poly([-1, -2])
DENOMINATORS = (np.poly([-1 + 1j, -1 - 1j, -3]).real, np.poly([-1 + 1j, -1 - 1j, 3]).real)


@pytest.mark.parametrize(
    ("plant", "denominator"),
    list(zip((stable_plant(), unstable_plant()), DENOMINATORS, strict=True)),
    ids=["stable", "unstable"],
)
def test_thesis_plants_have_the_poles_of_their_transfer_functions(plant, denominator):
    sampled = LinearPlant.from_transfer_function(NUMERATOR, denominator).sampled(0.1)
    key = lambda z: (z.real, z.imag)  # noqa: E731
    given, exact = (sorted(np.linalg.eigvals(p.A), key=key) for p in (plant, sampled))
    np.testing.assert_allclose(given, exact, atol=2.5e-3)  # the printed digits
    gains = [(p.C @ np.linalg.solve(np.eye(3) - p.A, p.B)).item() for p in (plant, sampled)]
    assert gains[0] == pytest.approx(gains[1], rel=0.05)
    exact_gain = NUMERATOR[-1] / denominator[-1]
    assert gains[1] == pytest.approx(exact_gain, rel=1e-9)


def test_transfer_function_and_state_space_have_the_same_step_response():
    plant = LinearPlant.from_transfer_function([1.0, 2.0], [1.0, 3.0, 5.0])
    t, y = signal.step(([1.0, 2.0], [1.0, 3.0, 5.0]), T=np.linspace(0, 2, 21))
    sampled, x = plant.sampled(0.1), np.zeros(2)
    for k in range(21):
        assert (sampled.C @ x).item() == pytest.approx(y[k], abs=1e-9)
        x = sampled.A @ x + sampled.B[:, 0]
    assert t[1] == pytest.approx(sampled.dt or 0)


def test_mass_spring_damper_is_unstable_with_the_thesis_stiffness():
    plant = mass_spring_damper()
    np.testing.assert_allclose(plant.A, [[0, 1], [2, -1]])
    assert np.linalg.eigvals(plant.A).max() == pytest.approx(1.0)
    assert plant.model.x_names == ("position", "velocity")
    assert plant.y.numel() == 1


def test_references():
    t = np.linspace(0, 4, 4001)
    w = sinusoid(t)
    assert w[:, 0].max() == pytest.approx(3.0)
    np.testing.assert_allclose(np.gradient(w[:, 0], t)[1:-1], w[1:-1, 1], atol=1e-5)
    assert not sinusoid(t, moving=False)[:, 1].any()
    np.testing.assert_allclose(step_reference([0, 1, 2], [5, 6], at=1.0), [[0, 0], [5, 6], [5, 6]])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: state_space(np.ones((2, 3)), np.ones((2, 1))), r"A has shape \(2, 3\)"),
        (lambda: state_space(np.eye(2), np.ones((3, 1))), r"B has shape \(3, 1\)"),
        (lambda: state_space(np.eye(2) * np.nan, np.ones((2, 1))), "finite"),
        (lambda: mass_spring_damper(mass=0.0), "mass"),
        (lambda: mass_spring_damper().sampled(-1.0), "dt"),
        (lambda: stable_plant().sampled(0.1), "sampled already"),
        (lambda: LinearPlant.from_transfer_function([1, 0, 0], [1, 1]), "transfer function"),
    ],
)
def test_bad_plants_are_refused(make, message):
    with pytest.raises(ProblemError, match=message):
        make()

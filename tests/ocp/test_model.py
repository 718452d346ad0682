"""Models: what is read off the symbols, and what is refused."""

import casadi as ca
import pytest

from ocp import Model, ProblemError


def build(**changes) -> Model:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    given = {"name": "cart", "x": x, "u": u, "f": ca.vertcat(x[1], u)}
    return Model(**(given | changes))


def test_reads_sizes_and_names_off_the_symbols() -> None:
    model = build(x_units=("m", "m/s"), u_units=("N",))
    assert (model.nx, model.nu) == (2, 1)
    assert model.x_names == ("x_0", "x_1")
    assert model.u_names == ("u",)
    assert not model.is_discrete
    assert build(dt=0.1).is_discrete


def test_stacks_a_list_into_f() -> None:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    model = Model(name="cart", x=x, u=u, f=[x[1], u])  # type: ignore[arg-type] # a list is welcome
    assert model.f.shape == (2, 1)
    assert model.f.is_dense()


def test_structural_zeros_in_f_become_numbers() -> None:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    f = ca.SX(2, 1)
    f[0] = u
    assert Model(name="half", x=x, u=u, f=f).f.is_dense()


def test_time_is_a_symbol_of_its_own_per_model() -> None:
    assert not ca.is_equal(build().t, build().t)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"x": ca.DM(2, 1)}, ("x is a DM", "SX.sym")),
        ({"u": 1.0}, ("u is a float",)),
        ({"u": ca.DM(1.0)}, ("u is a DM",)),
        ({"x": ca.SX.sym("x", 2, 2)}, ("x must be", "(2, 2)")),
        ({"x": ca.SX.sym("x", 1, 2)}, ("x must be", "(1, 2)")),
        ({"u": 2.0 * ca.SX.sym("u")}, ("u must be", "(2.*u) is an expression")),
        ({"x": ca.vertcat(*[ca.SX.sym("q")] * 1, ca.SX(1, 1))}, ("x must be",)),
        ({"t": ca.SX.sym("t", 2)}, ("t has shape (2, 1)",)),
        ({"f": ca.SX.sym("y", 3)}, ("f has 3 rows", "2 states")),
        ({"f": ca.MX.sym("y", 3)}, ("f has 3 rows",)),
        ({"f": ca.SX.sym("y", 2, 2)}, ("f has shape (2, 2)",)),
        ({"dt": 0.0}, ("dt = 0.0",)),
        ({"dt": -1.0}, ("dt = -1.0",)),
        ({"dt": float("nan")}, ("dt = nan",)),
        ({"dt": float("inf")}, ("dt = inf",)),
        ({"x_units": ("m",)}, ("x_units has 1", "2 symbols")),
        ({"u_units": ("m", "N")}, ("u_units has 2", "1 symbols")),
    ],
)
def test_refuses(changes: dict, words: tuple[str, ...]) -> None:
    with pytest.raises(ProblemError) as caught:
        build(**changes)
    assert "model 'cart'" in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def test_refuses_a_symbol_twice() -> None:
    q = ca.SX.sym("q")
    with pytest.raises(ProblemError, match="same symbol twice: q, q"):
        build(x=ca.vertcat(q, q))

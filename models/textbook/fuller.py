"""Fuller's problem: infinitely many switches in finite time."""

from models.textbook.ends import ends_at
from models.textbook.mass import mass
from ocp import OCP, Box


def fuller() -> OCP:
    r"""Bring a mass to rest with least squared deviation: chattering.

    .. math::

        \min \int_0^{3.5} x^2 \, dt, \quad \ddot x = u, \; |u| \le 1, \quad
        (x, \dot x): (0, 1) \to (0, 0)

    Optimum: 0.2683938. The problem is self-similar (x → s²x, v → sv, t → st), the control
    u = -sign(x + C v|v|) with C = √((√33 - 1)/24) [Fuller 1963]. From (0, 1) the first switch is
    at v_1 = -1/√(1 + 2C); from switch to switch abs(v) shrinks by q = √((1 - 2C)/(1 + 2C)) and the
    cost of an arc by q⁵: a geometric sum, and the origin is reached at t = 1 + abs(v_1)(1 + (1 +
    q)/(1 - q)) = 2.92 < 3.5, after which the mass rests.
    """
    model = mass()
    return OCP(
        name="Fuller",
        model=model,
        x0=[0.0, 1.0],
        horizon=3.5,
        running_cost=model.x[0] ** 2,
        control_bounds=Box(-1.0, 1.0),
        constraints=ends_at(model.x, 0.0),
    )

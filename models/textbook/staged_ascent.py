"""A rocket of two stages and nine boosters on its way into a transfer orbit, in four phases."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp import OCP, Constraint, FreeTime, Guess, Link, Model, Phases

# Earth: gravity [m^3/s^2], radius [m], rotation [rad/s]; air at the ground [kg/m^3], its scale [m].
GRAVITY, RADIUS, ROTATION = 3.986012e14, 6378145.0, 7.29211585e-5
DENSITY, SCALE = 1.225, 7200.0
# Of the rocket: area [m^2], drag coefficient, payload [kg].
AREA, DRAG, PAYLOAD = 4.0 * np.pi, 0.5, 4164.0
LATITUDE = np.radians(28.5)
# The orbit: semi-major axis [m], eccentricity, inclination, ascending node, periapsis [rad].
AXIS, ECCENTRICITY = 24361140.0, 0.7308
INCLINATION, NODE, PERIAPSIS = np.radians([28.5, 269.8, 130.5])
# Of the speed in the drag, which is then smooth at rest [m/s].
_AT_REST = 1e-4
_MOST_BOOSTERS, _FIRST_BOOSTERS = 9, 6


@dataclass(frozen=True)
class Stage:
    """A stage or a booster.

    Attributes:
        thrust: [N].
        fuel: [kg].
        empty: mass without fuel [kg].
        burn: how long it burns [s].
    """

    thrust: float
    fuel: float
    empty: float
    burn: float

    @property
    def flow(self) -> float:
        """Fuel burnt per second [kg/s]."""
        return self.fuel / self.burn


BOOSTER = Stage(628500.0, 17010.0, 2280.0, 75.2)
FIRST = Stage(1083100.0, 95550.0, 8830.0, 261.0)
SECOND = Stage(110094.0, 16820.0, 2480.0, 700.0)

R, V, U = ca.SX.sym("r", 3), ca.SX.sym("v", 3), ca.SX.sym("u", 3)
M = ca.SX.sym("mass")


def staged_ascent() -> Phases:
    r"""Bring as much mass as possible into an orbit that is given.

    .. math::

        \min -m(t_f), \quad \dot r = v, \; \dot v = -\mu \frac{r}{|r|^3} + \frac{T u + D}{m}, \;
        \dot m = -\text{flow}, \quad |u| = 1, \; |r| \ge R

    In four phases: the first stage with six boosters (75.2 s), with the other three (75.2 s), by
    itself (to 261 s), then the second stage. What has burnt out is dropped. The drag D is that of
    the speed relative to the air, which turns with the Earth. Of the five elements of the orbit,
    eccentricity and periapsis stand as the components of the eccentricity vector.

    Optimum: -7529.71230 kg; collocation on Radau and on Gauss points agrees to 1e-6 kg. Problem and
    data: [Betts 2010].
    """
    start = np.array([np.cos(LATITUDE), 0.0, np.sin(LATITUDE)]) * RADIUS
    rest = np.array([start, _turning(start)])
    arrival = _perigee()
    parts = (
        ("six boosters", _FIRST_BOOSTERS, FIRST, BOOSTER.burn),
        ("three boosters", _MOST_BOOSTERS - _FIRST_BOOSTERS, FIRST, BOOSTER.burn),
        ("first stage", 0, FIRST, FIRST.burn - 2 * BOOSTER.burn),
        ("second stage", 0, SECOND, 0.9 * SECOND.burn),
    )
    dropped = (
        _FIRST_BOOSTERS * BOOSTER.empty,
        (_MOST_BOOSTERS - _FIRST_BOOSTERS) * BOOSTER.empty,
        FIRST.empty,
    )
    mass = PAYLOAD + sum(s.fuel + s.empty for s in (FIRST, SECOND, *[BOOSTER] * _MOST_BOOSTERS))
    phases = []
    for (name, boosters, stage, duration), drop in zip(parts, (*dropped, 0.0), strict=True):
        near = rest if boosters else arrival
        burnt = duration * (boosters * BOOSTER.flow + stage.flow)
        phases.append(_phase(name, boosters, stage, duration, near, (mass, mass - burnt)))
        mass -= burnt + drop
    links = tuple(Link(ca.vertcat(R, V, M - drop)) for drop in dropped)
    return Phases("staged ascent", tuple(phases), links)


def _phase(
    name: str,
    boosters: int,
    stage: Stage,
    duration: float,
    near: np.ndarray,
    masses: tuple[float, float],
) -> OCP:
    """Return one of the phases; its guess is a place and a speed (2, 3), and the mass."""
    is_last = stage is SECOND
    rows = (
        Constraint("direction of thrust", ca.sumsqr(U), 1.0, 1.0),
        Constraint("altitude", ca.norm_2(R) / 1e3, lower=RADIUS / 1e3 - 1e-3),
    )
    return OCP(
        name=name,
        model=_model(name, boosters, stage),
        x0=[*near.ravel(), masses[0]],
        horizon=FreeTime(duration, 100.0, stage.burn) if is_last else duration,
        terminal_cost=-M if is_last else 0.0,
        constraints=(*rows, _orbit()) if is_last else rows,
        guess=Guess(x=[[*near.ravel(), mass] for mass in masses], u=[0.0, 1.0, 0.0]),
    )


def _model(name: str, boosters: int, stage: Stage) -> Model:
    distance = ca.norm_2(R)
    relative = V - _turning(R)
    speed = ca.sqrt(ca.sumsqr(relative) + _AT_REST**2)
    density = DENSITY * ca.exp(-(distance - RADIUS) / SCALE)
    force = (boosters * BOOSTER.thrust + stage.thrust) * U
    force -= 0.5 * density * AREA * DRAG * speed * relative
    return Model(
        name=name,
        x=ca.vertcat(R, V, M),
        u=U,
        f=ca.vertcat(
            V, -GRAVITY * R / distance**3 + force / M, -boosters * BOOSTER.flow - stage.flow
        ),
        x_units=("m", "m", "m", "m/s", "m/s", "m/s", "kg"),
        x_nominal=[*[RADIUS] * 3, *[1e3] * 3, 1e5],
        u_nominal=1.0,
    )


def _turning(r: ca.SX | np.ndarray) -> ca.SX | np.ndarray:
    """Return the speed of the Earth, and of its air, at a place."""
    if isinstance(r, np.ndarray):
        return ROTATION * np.array([-r[1], r[0], 0.0])
    return ROTATION * ca.vertcat(-r[1], r[0], 0.0)


def _orbit() -> Constraint:
    """Return the five elements of the orbit as equations that are smooth."""
    momentum = ca.cross(R, V)
    size = ca.norm_2(momentum)
    node = ca.vertcat(-momentum[1], momentum[0], 0.0)
    node = node / ca.norm_2(node)
    across = ca.cross(momentum / size, node)
    vector = ca.cross(V, momentum) / GRAVITY - R / ca.norm_2(R)
    axis = 1.0 / (2.0 / ca.norm_2(R) - ca.sumsqr(V) / GRAVITY)
    elements = ca.vertcat(
        axis / AXIS,
        ca.dot(vector, node),
        ca.dot(vector, across),
        momentum[2] / size,
        node[0] * np.sin(NODE) - node[1] * np.cos(NODE),
    )
    wanted = [
        1.0,
        ECCENTRICITY * np.cos(PERIAPSIS),
        ECCENTRICITY * np.sin(PERIAPSIS),
        np.cos(INCLINATION),
        0.0,
    ]
    return Constraint("orbit", elements, wanted, wanted, at="terminal")


def _perigee() -> np.ndarray:
    """Return place and speed where the orbit is nearest to the Earth, (2, 3)."""

    def about(axis: int, angle: float) -> np.ndarray:
        i, j = [k for k in range(3) if k != axis]
        turned = np.eye(3)
        turned[[i, j], [i, j]] = np.cos(angle)
        turned[i, j], turned[j, i] = -np.sin(angle), np.sin(angle)
        return turned

    frame = about(2, NODE) @ about(0, INCLINATION) @ about(2, PERIAPSIS)
    nearest = AXIS * (1.0 - ECCENTRICITY)
    speed = np.sqrt(GRAVITY / AXIS * (1.0 + ECCENTRICITY) / (1.0 - ECCENTRICITY))
    return np.array([frame @ [nearest, 0.0, 0.0], frame @ [0.0, speed, 0.0]])

"""Small sound problems; a mistake is one of them with something replaced."""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from ocp import OCP, Box, Constraint, FreeTime, Guess, Model, Signal

Units = Mapping[str, str]


def _problem(name: str, states: Units, controls: Units, sound: dict[str, Any], given: dict) -> OCP:
    """Build a problem from its sound parts, some replaced.

    A part may be a function of the symbols: states, controls, t, the names in ``symbols`` and in
    ``z``, which are algebraic variables, and of each state at the start, as ``start_<state>``.
    ``states`` and ``more`` among the parts add symbols to its states and controls.
    """
    parts: dict[str, Any] = sound | given
    states, controls = {**states, **parts.pop("states", {})}, {**controls, **parts.pop("more", {})}
    z = parts.pop("z", ())
    names = (*states, *controls, "t", *z, *parts.pop("symbols", ()))
    start = {f"start_{n}": ca.SX.sym(f"{n}(t0)") for n in states}
    s = SimpleNamespace(**{n: ca.SX.sym(n) for n in names}, **start)
    parts = {key: part(s) if callable(part) else part for key, part in parts.items()}
    units = parts.pop("units", True)
    model = Model(
        name=name,
        x=ca.vertcat(*[getattr(s, n) for n in states]),
        u=ca.vertcat(*[getattr(s, n) for n in controls]),
        f=ca.vertcat(*parts.pop("f")),
        t=s.t,
        dt=parts.pop("dt", None),
        x_units=tuple(states.values()) if units else (),
        u_units=tuple(controls.values()) if units else (),
        z=ca.vertcat(ca.SX(0, 1), *[getattr(s, n) for n in z]),
        algebraic=ca.vertcat(ca.SX(0, 1), *parts.pop("algebraic", ())),
        z_guess=parts.pop("z_guess", None),
        start=ca.vertcat(*start.values()),
    )
    whole: dict[str, Any] = {"name": name, "model": model} | parts
    return OCP(**whole)


def ends(target: dict[str, float]) -> Any:
    """Return the terminal equations state = number, each under the name 'end <state>'."""
    return lambda s: tuple(
        Constraint(f"end {n}", getattr(s, n), v, v, at="terminal") for n, v in target.items()
    )


def cart(**given: Any) -> OCP:
    """Move 2 kg by 1 m in 2 s, from rest to rest, with least force."""
    sound = {
        "f": lambda s: (s.velocity, s.force / 2),
        "x0": [0.0, 0.0],
        "horizon": 2.0,
        "running_cost": lambda s: s.force**2,
        "control_bounds": Box(-10.0, 10.0),
        "constraints": ends({"position": 1.0, "velocity": 0.0}),
    }
    return _problem("cart", {"position": "m", "velocity": "m/s"}, {"force": "N"}, sound, given)


def oscillator(**given: Any) -> OCP:
    """Damp the Van der Pol oscillator."""
    sound = {
        "f": lambda s: (s.x2, (1 - s.x1**2) * s.x2 - s.x1 + s.u),
        "x0": [1.0, 0.0],
        "horizon": 4.0,
        "running_cost": lambda s: (s.x1**2 + s.x2**2 + s.u**2) / 2,
    }
    return _problem("oscillator", {"x1": "", "x2": ""}, {"u": ""}, sound, given)


def pendulum(**given: Any) -> OCP:
    """Swing a pendulum to the side."""
    sound = {
        "f": lambda s: (s.rate, s.torque - ca.sin(s.angle)),
        "x0": [0.0, 0.0],
        "horizon": 3.0,
        "running_cost": lambda s: s.torque**2,
        "terminal_cost": lambda s: 10 * ((s.angle - 1.5) ** 2 + s.rate**2),
        "control_bounds": Box(-2.0, 2.0),
    }
    return _problem("pendulum", {"angle": "rad", "rate": "rad/s"}, {"torque": "N m"}, sound, given)


def lander(**given: Any) -> OCP:
    """Land softly on the moon with least fuel, the time is free."""
    sound = {
        "f": lambda s: (s.speed, s.thrust / s.mass - 1.62, -s.thrust / 3000.0),
        "x0": [100.0, -10.0, 100.0],
        "horizon": FreeTime(guess=15.0, lower=2.0, upper=60.0),
        "terminal_cost": lambda s: -s.mass,
        "control_bounds": Box(0.0, 500.0),
        "state_bounds": Box([0.0, -100.0, 50.0], [200.0, 100.0, 200.0]),
        "constraints": ends({"height": 0.0, "speed": 0.0}),
    }
    states = {"height": "m", "speed": "m/s", "mass": "kg"}
    return _problem("lander", states, {"thrust": "N"}, sound, given)


def _clear(s: SimpleNamespace) -> ca.SX:
    return (s.x - 5.0) ** 2 + (s.y - 0.3) ** 2


def car(**given: Any) -> OCP:
    """Drive past a disc of 1 m radius to a point ahead, and stop."""
    target = ends({"x": 10.0, "y": 0.0, "speed": 0.0})
    sound = {
        "f": lambda s: (s.speed * ca.cos(s.heading), s.speed * ca.sin(s.heading), s.turn, s.push),
        "x0": [0.0, 0.0, 0.0, 0.0],
        "horizon": 6.0,
        "running_cost": lambda s: s.push**2 + s.turn**2,
        "control_bounds": Box([-4.0, -2.0], [4.0, 2.0]),
        "constraints": lambda s: (*target(s), Constraint("obstacle", _clear(s), lower=1.0)),
        "guess": Guess(x=np.linspace([0.0, 0.0, 0.0, 1.5], [10.0, 0.0, 0.0, 1.5], 5)),
    }
    states = {"x": "m", "y": "m", "heading": "rad", "speed": "m/s"}
    return _problem("car", states, {"push": "m/s^2", "turn": "rad/s"}, sound, given)


def tank(**given: Any) -> OCP:
    """Fill a tank with an open outlet to 2 m."""
    sound = {
        "f": lambda s: (s.inflow - 0.5 * ca.sqrt(s.level),),
        "x0": [1.0],
        "horizon": 5.0,
        "running_cost": lambda s: (s.level - 2.0) ** 2 + 0.1 * s.inflow**2,
        "control_bounds": Box(0.0, 2.0),
        "state_bounds": Box(0.1, 10.0),
    }
    return _problem("tank", {"level": "m"}, {"inflow": "m/s"}, sound, given)


def regulator(**given: Any) -> OCP:
    """Bring a sampled mass to rest."""
    dt = 0.1
    sound = {
        "f": lambda s: (s.place + dt * s.pace + dt**2 / 2 * s.u, s.pace + dt * s.u),
        "dt": dt,
        "x0": [1.0, 0.0],
        "horizon": 40,
        "running_cost": lambda s: s.place**2 + s.pace**2 + s.u**2,
        "terminal_cost": lambda s: 10 * (s.place**2 + s.pace**2),
        "control_bounds": Box(-3.0, 3.0),
    }
    return _problem("regulator", {"place": "m", "pace": "m/s"}, {"u": "m/s^2"}, sound, given)


def room(**given: Any) -> OCP:
    """Heat a room for the least energy: linear in the control, which is bounded."""
    sound = {
        "f": lambda s: ((5.0 - s.warmth) / 4 + 6.0 * s.heater,),
        "x0": [20.5],
        "horizon": 8.0,
        "running_cost": lambda s: s.heater,
        "control_bounds": Box(0.0, 2.0),
        "state_bounds": Box(20.0, 24.0),
    }
    return _problem("room", {"warmth": "degC"}, {"heater": "kW"}, sound, given)


def hand(s: SimpleNamespace) -> ca.SX:
    """Return the place of the arm's hand; both links have 1 m."""
    both = s.q1 + s.q2
    return ca.vertcat(ca.cos(s.q1) + ca.cos(both), ca.sin(s.q1) + ca.sin(both))


def reach(place: tuple[float, float]) -> Any:
    """Return the terminal constraint 'target': the hand is at a place [m]."""
    return lambda s: (Constraint("target", hand(s), list(place), list(place), at="terminal"),)


def arm(**given: Any) -> OCP:
    """Lead the hand of a two-link arm to a point with the least joint speeds."""
    sound = {
        "f": lambda s: (s.w1, s.w2),
        "x0": [0.3, 0.6],
        "horizon": 1.0,
        "running_cost": lambda s: s.w1**2 + s.w2**2,
        "control_bounds": Box(-4.0, 4.0),
        "constraints": reach((0.4, 1.2)),
    }
    units = {"w1": "rad/s", "w2": "rad/s"}
    return _problem("arm", {"q1": "rad", "q2": "rad"}, units, sound, given)


def servo(**given: Any) -> OCP:
    """Follow a sampled reference."""
    wave = np.sin(np.linspace(0.0, 2 * np.pi, 21))
    sound = {
        "f": lambda s: (s.drift, -s.drift + s.voltage),
        "symbols": ("wanted",),
        "x0": [0.0, 0.0],
        "horizon": 4.0,
        "running_cost": lambda s: (s.spot - s.wanted) ** 2 + 0.01 * s.voltage**2,
        "parameters": lambda s: (Signal("reference", s.wanted, wave, hold="linear"),),
    }
    return _problem("servo", {"spot": "m", "drift": "m/s"}, {"voltage": "V"}, sound, given)


def cartpole(**given: Any) -> OCP:
    """Catch a pole on a cart (1 kg, pole 0.3 kg at 0.5 m) that leans by 0.3 rad."""

    def flow(s: SimpleNamespace) -> tuple:
        sin, cos = ca.sin(s.lean), ca.cos(s.lean)
        heavy = 1.0 + 0.3 * sin**2
        pushed = (s.push + 0.3 * sin * (9.81 * cos - 0.5 * s.spin**2)) / heavy
        turned = (9.81 * sin + pushed * cos) / 0.5
        return s.speed, s.spin, pushed, turned

    sound = {
        "f": flow,
        "x0": [0.0, 0.3, 0.0, 0.0],
        "horizon": 2.0,
        "running_cost": lambda s: s.rail**2 + 10 * s.lean**2 + 0.05 * s.push**2,
        "terminal_cost": lambda s: 10 * (s.lean**2 + s.spin**2 + s.speed**2),
        "control_bounds": Box(-20.0, 20.0),
    }
    states = {"rail": "m", "lean": "rad", "speed": "m/s", "spin": "rad/s"}
    return _problem("cart-pole", states, {"push": "N"}, sound, given)


def drone(**given: Any) -> OCP:
    """Fly a planar drone of 1 kg to a point 2 m to the side and 1 m up."""
    sound = {
        "f": lambda s: (
            s.vx,
            s.vz,
            -s.lift * ca.sin(s.tilt),
            s.lift * ca.cos(s.tilt) - 9.81,
            s.roll,
        ),
        "x0": [0.0, 0.0, 0.0, 0.0, 0.0],
        "horizon": 3.0,
        "running_cost": lambda s: (s.lift - 9.81) ** 2 + s.roll**2,
        "control_bounds": Box([0.0, -3.0], [20.0, 3.0]),
        "constraints": ends({"px": 2.0, "pz": 1.0, "vx": 0.0, "vz": 0.0, "tilt": 0.0}),
    }
    states = {"px": "m", "pz": "m", "vx": "m/s", "vz": "m/s", "tilt": "rad"}
    return _problem("drone", states, {"lift": "N", "roll": "rad/s"}, sound, given)


def fastest(**given: Any) -> OCP:
    """Move the cart in minimum time."""
    sound = {
        "horizon": FreeTime(guess=1.5, lower=0.1, upper=20.0),
        "running_cost": 1.0,
    }
    return cart(**(sound | given))

"""Phases that several tests use: a ball that is thrown back, a rocket of two stages, a cut line."""

from dataclasses import replace
from typing import Any

import casadi as ca

from ocp import OCP, Box, Constraint, FreeTime, Link, Model, Phases

GRAVITY, BOUNCE = 9.81, 0.8
H, V, M, U, T = (ca.SX.sym(name) for name in ("height", "speed", "mass", "push", "t"))
BALL = Model(name="ball", x=ca.vertcat(H, V), u=U, f=ca.vertcat(V, U - GRAVITY), t=T)
GROUND = Constraint("ground", H, 0, 0, at="terminal")
TOP = Constraint("top", BALL.x, [1, 0], [1, 0], at="terminal")


def phase(name: str, **changes: Any) -> OCP:
    given: dict[str, Any] = {
        "name": name,
        "model": BALL,
        "x0": [1.0, 0.0],
        "horizon": FreeTime(0.5),
        "running_cost": U**2 / 2,
    }
    return OCP(**(given | changes))


FALL = phase("fall", constraints=(GROUND,))
RISE = phase("rise", x0=[0.0, 3.0], constraints=(TOP,))
IMPACT = Link(ca.vertcat(H, -BOUNCE * V))


def hop(**changes: Any) -> Phases:
    """A ball that is let go, hits the ground, loses a part of its speed, and comes back."""
    given: dict[str, Any] = {
        "name": "hop",
        "phases": (FALL, RISE),
        "links": (IMPACT,),
        "total": 1.5,
    }
    return Phases(**(given | changes))


def hop_cost(speed: float, fall: float, total: float = 1.5) -> float:
    """Return the least cost of a hop that hits the ground with a speed < 0, after ``fall`` s.

    Between given ends the best acceleration a is linear in time, and the integral of a^2/2 is
    2 (v0^2 + v0 v1 + v1^2)/T - 6 d (v0 + v1)/T^2 + 6 d^2/T^3; the push is a + g.
    """
    cost = 0.0
    for d, v0, v1, time in ((-1, 0.0, speed, fall), (1, -BOUNCE * speed, 0.0, total - fall)):
        cost += 2 * (v0**2 + v0 * v1 + v1**2) / time - 6 * d * (v0 + v1) / time**2
        cost += 6 * d**2 / time**3 + GRAVITY * (v1 - v0) + GRAVITY**2 * time / 2
    return cost


def stage(name: str, mass: float, **changes: Any) -> OCP:
    """One of the stages of a rocket that burns what it weighs."""
    model = Model(
        name="rocket",
        x=ca.vertcat(H, V, M),
        u=U,
        f=ca.vertcat(V, U / M - 1 - 0.1 * V**2 * ca.exp(-H), -U / 2),
    )
    given: dict[str, Any] = {
        "name": name,
        "model": model,
        "x0": [0, 0, mass],
        "horizon": 0.6,
        "control_bounds": Box(0, 3.5),
        "running_cost": 0.05 * U**2,
    }
    return OCP(**(given | changes))


def rocket() -> Phases:
    """Two stages; the second starts with the mass that is its own."""
    empty, bare = (Constraint("tank", M, lower=left, at="terminal") for left in (0.7, 0.3))
    final = stage(
        "second", 0.6, horizon=FreeTime(0.5, 0.2, 1.0), terminal_cost=-H, constraints=(bare,)
    )
    return Phases(
        "rocket",
        (stage("first", 1.0, constraints=(empty,)), final),
        (Link(states=("height", "speed")),),
    )


def line(**changes: Any) -> OCP:
    """A mass that follows a wave, over 3 s."""
    given: dict[str, Any] = {
        "horizon": 3.0,
        "running_cost": (H - ca.sin(2 * T)) ** 2 + 0.01 * U**2,
        "model": Model(name="mass", x=BALL.x, u=U, f=ca.vertcat(V, U - 0.3 * V * H), t=T),
    }
    return phase("line", **(given | changes))


def cut_line(durations: tuple[float, ...] = (1.0, 1.0, 1.0)) -> Phases:
    """The same in pieces."""
    pieces = (replace(line(), name=f"piece {i}", horizon=time) for i, time in enumerate(durations))
    return Phases("cut line", tuple(pieces))

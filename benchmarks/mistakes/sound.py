"""Problems in which nothing is wrong: what a diagnosis must be silent on."""

import casadi as ca

from benchmarks.cases import arm_scenario
from benchmarks.mistakes import problems as of
from benchmarks.mistakes.mistake import Sound
from benchmarks.mistakes.wrong_constants import coasting_cart, geared_cart, periodic_cart
from benchmarks.questions.greedy_gap import mass_regulator
from models import stable_plant, thesis_regulator, unstable_plant
from models.textbook import (
    bryson_denham,
    discrete_double_integrator,
    double_integrator_energy,
    double_integrator_minimum_time,
    hypersensitive,
    rayleigh,
    van_der_pol,
)
from ocp import OCP, Constraint, Delay, Peak, Rate, Soft


def _all_along() -> OCP:
    """Move the cart with a budget, a gate, a soft limit, a peak and a rate, all of them met."""
    return of.cart(
        constraints=lambda s: (
            *of.ends({"position": 1.0, "velocity": 0.0})(s),
            Constraint("budget", s.force**2, upper=50.0, at="integral"),
            Constraint("gate", s.position, 0.4, 0.6, at=1.0),
            Constraint("slow", s.velocity, -1.0, 0.7, soft=Soft(linear=100.0)),
        ),
        peaks=lambda s: (Peak("load", ca.fabs(s.force)),),
        rates=lambda s: (Rate(s.force, -50.0, 50.0),),
    )


def _late() -> OCP:
    """Bring the sampled mass to rest through a delay of three steps."""
    return of.regulator(delays=lambda s: (Delay(s.u, 3),))


def _dragged() -> OCP:
    """Move the cart against a drag that an equation gives."""
    return of.cart(
        z=("drag",),
        f=lambda s: (s.velocity, s.force / 2 - s.drag),
        algebraic=lambda s: (s.drag + s.drag**3 - s.velocity,),
        z_guess=[0.0],
    )


SOUND = (
    Sound("cart", of.cart),
    Sound("oscillator", of.oscillator),
    Sound("pendulum", of.pendulum),
    Sound("lander", of.lander),
    Sound("car", of.car),
    Sound("car, start at the near side", lambda: of.car(guess=None)),
    Sound("tank", of.tank),
    Sound("regulator", of.regulator),
    Sound("room", of.room),
    Sound("arm", of.arm),
    Sound("servo", of.servo),
    Sound("cart-pole", of.cartpole),
    Sound("drone", of.drone),
    Sound("fastest", of.fastest),
    Sound("coasting cart with data", coasting_cart),
    Sound("cart with a gear to choose", geared_cart),
    Sound("periodic cart", periodic_cart),
    Sound("budget, gate, soft limit, peak and rate", _all_along, held_out=True),
    Sound("delayed mass", _late, held_out=True),
    Sound("drag by an equation", _dragged, held_out=True),
    Sound("double integrator", double_integrator_energy),
    Sound("Bryson-Denham", bryson_denham),
    Sound("Rayleigh", rayleigh),
    Sound("Van der Pol", van_der_pol, held_out=True),
    Sound("hypersensitive", hypersensitive, held_out=True),
    Sound("minimum time", double_integrator_minimum_time, held_out=True),
    Sound("sampled mass", lambda: discrete_double_integrator(40, 0.1), held_out=True),
    Sound("mass on a spring", mass_regulator, held_out=True),
    Sound("stable plant", lambda: thesis_regulator(stable_plant(), 50), held_out=True),
    Sound("unstable plant", lambda: thesis_regulator(unstable_plant(), 50), held_out=True),
    Sound("arm-001", lambda: arm_scenario("arm-001").ocp("sum"), held_out=True),
    Sound("arm-002, nearest point", lambda: arm_scenario("arm-002").ocp("closest"), held_out=True),
)

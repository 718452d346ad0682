"""Problems in which nothing is wrong: what a diagnosis must be silent on."""

from benchmarks.cases import arm_scenario
from benchmarks.mistakes import problems as of
from benchmarks.mistakes.mistake import Sound
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

"""Problems in which nothing is wrong: what a diagnosis must be silent on."""

from benchmarks.mistakes import problems as of
from benchmarks.mistakes.mistake import Sound
from models import bryson_denham, double_integrator_energy, rayleigh

SOUND = (
    Sound("cart", of.cart),
    Sound("oscillator", of.oscillator),
    Sound("pendulum", of.pendulum),
    Sound("lander", of.lander),
    Sound("car", of.car),
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
)

"""Textbook problems, each with its source."""

from models.textbook.algae import periodic_algae
from models.textbook.around_discs import around_discs
from models.textbook.bouncing_ball import bouncing_ball
from models.textbook.brachistochrone import brachistochrone
from models.textbook.car import car_in_arcs, car_minimum_time
from models.textbook.collision_costs import BarrierCost, bounded_ocp, unbounded_ocp
from models.textbook.consumption import consumption
from models.textbook.double_integrator import (
    discrete_double_integrator,
    double_integrator_bounded_energy,
    double_integrator_distance,
    double_integrator_energy,
    double_integrator_fuel,
    double_integrator_minimum_time,
)
from models.textbook.electric_vehicle import electric_vehicle
from models.textbook.exponential import (
    exponential_energy,
    exponential_fuel,
    exponential_minimum_time,
)
from models.textbook.fishing import fishery, predator_and_prey
from models.textbook.fuller import fuller
from models.textbook.goddard import goddard
from models.textbook.hang_glider import hang_glider
from models.textbook.hanging_chain import hanging_chain
from models.textbook.heated_rod import heated_rod
from models.textbook.hiv import hiv
from models.textbook.integrator import (
    integrator_free_time,
    integrator_free_time_quadratic,
    integrator_priced_end,
    mixed_constraint,
    moving_floor,
    turnpike,
)
from models.textbook.isoperimetric import isoperimetric
from models.textbook.kinetics import alpha_pinene, gas_oil, methanol
from models.textbook.least_peak import least_excursion, least_jerk
from models.textbook.linear_hypersensitive import linear_hypersensitive
from models.textbook.marine_population import marine_population
from models.textbook.medicine import tuberculosis, tumour
from models.textbook.mine import mine
from models.textbook.moon_landing import moon_landing
from models.textbook.mountain_car import mountain_car
from models.textbook.orbit_raise import orbit_raise
from models.textbook.orbit_transfer import orbit_transfer
from models.textbook.oscillator_regulator import oscillator_regulator
from models.textbook.oscillators import hypersensitive, rayleigh, rayleigh_constrained, van_der_pol
from models.textbook.overhead_crane import overhead_crane
from models.textbook.pendulum import pendulum_minimum_time, pendulum_swing_up
from models.textbook.polar_arm import polar_arm
from models.textbook.reactors import catalyst_mixing, parallel_reactions, two_catalysts
from models.textbook.rod_pendulum import rod_pendulum
from models.textbook.rope import dido
from models.textbook.shuttle import shuttle_reentry
from models.textbook.staged_ascent import staged_ascent
from models.textbook.state_constrained_mass import beam, breakwell, bryson_denham
from models.textbook.tangent_steering import linear_tangent_steering
from models.textbook.turning import interceptor, shortest_turn
from models.textbook.two_link_arm import two_link_arm_energy, two_link_arm_minimum_time
from models.textbook.zermelo import zermelo

__all__ = [
    "BarrierCost",
    "alpha_pinene",
    "around_discs",
    "beam",
    "bouncing_ball",
    "bounded_ocp",
    "brachistochrone",
    "breakwell",
    "bryson_denham",
    "car_in_arcs",
    "car_minimum_time",
    "catalyst_mixing",
    "consumption",
    "dido",
    "discrete_double_integrator",
    "double_integrator_bounded_energy",
    "double_integrator_distance",
    "double_integrator_energy",
    "double_integrator_fuel",
    "double_integrator_minimum_time",
    "electric_vehicle",
    "exponential_energy",
    "exponential_fuel",
    "exponential_minimum_time",
    "fishery",
    "fuller",
    "gas_oil",
    "goddard",
    "hang_glider",
    "hanging_chain",
    "heated_rod",
    "hiv",
    "hypersensitive",
    "integrator_free_time",
    "integrator_free_time_quadratic",
    "integrator_priced_end",
    "interceptor",
    "isoperimetric",
    "least_excursion",
    "least_jerk",
    "linear_hypersensitive",
    "linear_tangent_steering",
    "marine_population",
    "methanol",
    "mine",
    "mixed_constraint",
    "moon_landing",
    "mountain_car",
    "moving_floor",
    "orbit_raise",
    "orbit_transfer",
    "oscillator_regulator",
    "overhead_crane",
    "parallel_reactions",
    "pendulum_minimum_time",
    "pendulum_swing_up",
    "periodic_algae",
    "polar_arm",
    "predator_and_prey",
    "rayleigh",
    "rayleigh_constrained",
    "rod_pendulum",
    "shortest_turn",
    "shuttle_reentry",
    "staged_ascent",
    "tuberculosis",
    "tumour",
    "turnpike",
    "two_catalysts",
    "two_link_arm_energy",
    "two_link_arm_minimum_time",
    "unbounded_ocp",
    "van_der_pol",
    "zermelo",
]

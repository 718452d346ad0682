"""Robots, obstacles, tasks and textbook problems, each as symbolic models."""

from models.arm import PlanarArm
from models.avoidance import clearance_constraint
from models.carima import Carima, CarimaPlant
from models.carima_ocp import carima_ocp
from models.cart_pole import CartPole, cart_pole_swing_up, cart_pole_upright
from models.dilemma import BarrierCost, bounded_ocp, unbounded_ocp
from models.distance_cost import Combine, DistanceCost
from models.distances import distance_to_segment, signed_distance
from models.linear import (
    LinearPlant,
    mass_spring_damper,
    stable_plant,
    state_space,
    unstable_plant,
)
from models.linear_problems import (
    lq_regulator,
    sinusoid,
    step_reference,
    thesis_regulator,
    thesis_tracking,
    tracking_ocp,
)
from models.obstacle_data import obstacles_from_data
from models.obstacles import Capsule, Disc, Obstacle, Polygon, link_distances
from models.paths import Path, line, path_position, path_velocity
from models.posture_cost import (
    JointLimitCost,
    ManipulabilityCost,
    PostureCost,
    squared_manipulability,
)
from models.redundancy import Cost, Form, redundancy_ocp
from models.scenarios import ArmScenario, Difficulty, random_scenarios
from models.seven_links import seven_links
from models.textbook.brachistochrone import brachistochrone
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
from models.textbook.fuller import fuller
from models.textbook.goddard import goddard
from models.textbook.hanging_chain import hanging_chain
from models.textbook.integrator import (
    integrator_free_time,
    integrator_free_time_quadratic,
    mixed_constraint,
    moving_floor,
    turnpike,
)
from models.textbook.isoperimetric import isoperimetric
from models.textbook.linear_hypersensitive import linear_hypersensitive
from models.textbook.oscillator_regulator import oscillator_regulator
from models.textbook.oscillators import hypersensitive, rayleigh, rayleigh_constrained, van_der_pol
from models.textbook.pendulum import pendulum_minimum_time, pendulum_swing_up
from models.textbook.polar_arm import polar_arm
from models.textbook.reactors import catalyst_mixing, two_catalysts
from models.textbook.tangent_steering import linear_tangent_steering
from models.textbook.turn_round import beam, breakwell, bryson_denham
from models.textbook.two_link_arm import two_link_arm_energy, two_link_arm_minimum_time
from models.textbook.zermelo import zermelo

__all__ = [
    "ArmScenario",
    "BarrierCost",
    "Capsule",
    "Carima",
    "CarimaPlant",
    "CartPole",
    "Combine",
    "Cost",
    "Difficulty",
    "Disc",
    "DistanceCost",
    "Form",
    "JointLimitCost",
    "LinearPlant",
    "ManipulabilityCost",
    "Obstacle",
    "Path",
    "PlanarArm",
    "Polygon",
    "PostureCost",
    "beam",
    "bounded_ocp",
    "brachistochrone",
    "breakwell",
    "bryson_denham",
    "carima_ocp",
    "cart_pole_swing_up",
    "cart_pole_upright",
    "catalyst_mixing",
    "clearance_constraint",
    "discrete_double_integrator",
    "distance_to_segment",
    "double_integrator_bounded_energy",
    "double_integrator_distance",
    "double_integrator_energy",
    "double_integrator_fuel",
    "double_integrator_minimum_time",
    "electric_vehicle",
    "exponential_energy",
    "exponential_fuel",
    "exponential_minimum_time",
    "fuller",
    "goddard",
    "hanging_chain",
    "hypersensitive",
    "integrator_free_time",
    "integrator_free_time_quadratic",
    "isoperimetric",
    "line",
    "linear_hypersensitive",
    "linear_tangent_steering",
    "link_distances",
    "lq_regulator",
    "mass_spring_damper",
    "mixed_constraint",
    "moving_floor",
    "obstacles_from_data",
    "oscillator_regulator",
    "path_position",
    "path_velocity",
    "pendulum_minimum_time",
    "pendulum_swing_up",
    "polar_arm",
    "random_scenarios",
    "rayleigh",
    "rayleigh_constrained",
    "redundancy_ocp",
    "seven_links",
    "signed_distance",
    "sinusoid",
    "squared_manipulability",
    "stable_plant",
    "state_space",
    "step_reference",
    "thesis_regulator",
    "thesis_tracking",
    "tracking_ocp",
    "turnpike",
    "two_catalysts",
    "two_link_arm_energy",
    "two_link_arm_minimum_time",
    "unbounded_ocp",
    "unstable_plant",
    "van_der_pol",
    "zermelo",
]

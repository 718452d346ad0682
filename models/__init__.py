"""Robots, obstacles, tasks and plants, each as a symbolic model."""

from models.arm import PlanarArm
from models.avoidance import clearance_constraint
from models.carima import Carima, CarimaPlant
from models.carima_ocp import carima_ocp
from models.cart_pole import CartPole, cart_pole_swing_up, cart_pole_upright
from models.distance_cost import Combine, DistanceCost
from models.distances import distance_to_segment, signed_distance
from models.free_body import free_body_ocp
from models.linear import LinearPlant, mass_spring_damper, stable_plant, state_space, unstable_plant
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

__all__ = [
    "ArmScenario",
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
    "carima_ocp",
    "cart_pole_swing_up",
    "cart_pole_upright",
    "clearance_constraint",
    "distance_to_segment",
    "free_body_ocp",
    "line",
    "link_distances",
    "lq_regulator",
    "mass_spring_damper",
    "obstacles_from_data",
    "path_position",
    "path_velocity",
    "random_scenarios",
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
    "unstable_plant",
]

"""A robot description from a URDF file or text."""

from collections.abc import Iterable
from pathlib import Path
from typing import get_args
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from models._numbers import checked_tensor
from models.robot.description import (
    BoxShape,
    Collision,
    CylinderShape,
    Description,
    Inertia,
    Joint,
    JointType,
    Limits,
    Link,
    MeshShape,
    Mimic,
    Pose,
    Shape,
    SphereShape,
)
from models.robot.rotations import roll_pitch_yaw
from ocp import ProblemError
from ocp.internal import check_instance, check_not_negative

_TYPES = get_args(JointType)
_INSTEAD = {
    "planar": "write two prismatic joints and a continuous one",
    "floating": "free-flying bases are not part of this model; fix the base",
}


def read_urdf(source: str | Path, *, tidy: float = 1e-9) -> Description:
    """Return what a URDF says of links, joints, masses, limits and collision shapes.

    Visuals, materials, transmissions and extensions of simulators are passed over. ``package://``
    stays in the names of files, see ``resolve_file``. What a joint ``<mimic>`` follows, and
    whether the links are a tree, is checked where the ``Robot`` is made.

    Args:
        source: path of a file, or the text itself.
        tidy: an angle of an ``rpy`` within this of quarter turns is taken as them [rad]; 0: as it
            is written. See ``sine_and_cosine``.

    Raises:
        ProblemError: naming the file, link or joint, and what is wrong: malformed XML, an unknown
            type of joint, a mass below 0, limits without room, a number that is none.
    """
    check_not_negative(tidy, "URDF: tidy")
    root = _root(source)
    if root.tag != "robot":
        raise ProblemError(f"URDF: the outermost element is <{root.tag}>, <robot> is needed")
    links = tuple(_link(element, tidy) for element in root.findall("link"))
    joints = tuple(_joint(element, tidy) for element in root.findall("joint"))
    if not links:
        raise ProblemError("URDF: there is no <link>; a xacro file has to be expanded first")
    return Description(root.get("name", "robot"), links, joints)


def _root(source: str | Path) -> Element:
    check_instance(source, (str, Path), "URDF: source")
    builder = TreeBuilder()
    try:
        given, encoding = _bytes_of(source)
        # Without namespaces: many descriptions have prefixes, of simulators, that nobody declares.
        parser = expat.ParserCreate(encoding)
        parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
        parser.Parse(given, True)
    except OSError as error:
        raise ProblemError(f"URDF: the file cannot be read: {error}") from error
    except (expat.ExpatError, LookupError, UnicodeError, ValueError) as error:
        raise ProblemError(f"URDF: this is no XML: {error}") from error
    return builder.close()


def _bytes_of(source: str | Path) -> tuple[bytes, str | None]:
    """Return the description and its encoding; None: the one that a file declares itself."""
    text = str(source)
    if isinstance(source, Path) or not ("<" in text or "\n" in text):
        path = Path(source)
        if not path.is_file():
            raise ProblemError(f"URDF: there is no file {path}")
        return path.read_bytes().lstrip(), None
    return text.strip("\ufeff \t\r\n").encode(), "utf-8"


def _link(element: Element, tidy: float) -> Link:
    what = f"URDF: link '{_name(element, 'a link')}'"
    inertial = element.find("inertial")
    shapes = (_collision(e, f"{what}: collision", tidy) for e in element.findall("collision"))
    return Link(
        name=_name(element, "a link"),
        inertia=None if inertial is None else _inertia(inertial, what, tidy),
        collisions=tuple(shapes),
    )


def _inertia(element: Element, what: str, tidy: float) -> Inertia:
    mass = _number(_child(element, "mass", what), "value", f"{what}: mass")
    if mass < 0.0:
        raise ProblemError(f"{what}: its mass is {mass} kg, it must be 0 or more")
    entries = _child(element, "inertia", what)
    xx, xy, xz, yy, yz, zz = (
        _number(entries, name, f"{what}: inertia")
        for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    checked_tensor(tensor, what)
    pose = _origin(element, what, tidy)
    return Inertia(mass, pose.translation, pose.rotation @ tensor @ pose.rotation.T)


def _collision(element: Element, what: str, tidy: float) -> Collision:
    geometry = _child(element, "geometry", what)
    shape = next((made for e in geometry if (made := _shape(e, what)) is not None), None)
    if shape is None:
        known = [e.tag for e in geometry] or ["nothing"]
        raise ProblemError(
            f"{what}: its geometry is {known[0]}; box, sphere, cylinder and mesh are known"
        )
    return Collision(shape, _origin(element, what, tidy), element.get("name", ""))


def _shape(element: Element, what: str) -> Shape | None:
    if element.tag == "box":
        x, y, z = _positive(_vector(element, "size", what), f"{what}: size of the box")
        return BoxShape((x, y, z))
    if element.tag == "sphere":
        return SphereShape(*_positive([_number(element, "radius", what)], f"{what}: radius"))
    if element.tag == "cylinder":
        sizes = [_number(element, name, what) for name in ("radius", "length")]
        return CylinderShape(*_positive(sizes, f"{what}: radius and length"))
    if element.tag == "mesh":
        x, y, z = _vector(element, "scale", what, (1.0, 1.0, 1.0)).tolist()
        return MeshShape(_text(element, "filename", what), (x, y, z))
    return None


def _joint(element: Element, tidy: float) -> Joint:
    name = _name(element, "a joint")
    what = f"URDF: joint '{name}'"
    kind = _type(element, what)
    return Joint(
        name=name,
        type=kind,
        parent=_text(_child(element, "parent", what), "link", f"{what}: parent"),
        child=_text(_child(element, "child", what), "link", f"{what}: child"),
        origin=_origin(element, what, tidy),
        axis=_axis(element, kind, what),
        limits=_limits(element, kind, what),
        damping=_friction(element, "damping", what),
        friction=_friction(element, "friction", what),
        mimic=_mimic(element, what),
    )


def _type(element: Element, what: str) -> JointType:
    given = _text(element, "type", what)
    for kind in _TYPES:
        if given == kind:
            return kind
    instead = f"; {_INSTEAD[given]}" if given in _INSTEAD else ""
    raise ProblemError(f"{what} has the type '{given}'; known are {', '.join(_TYPES)}{instead}")


def _axis(element: Element, kind: JointType, what: str) -> np.ndarray:
    given = element.find("axis")
    axis = np.array([1.0, 0.0, 0.0]) if given is None else _vector(given, "xyz", f"{what}: axis")
    length = np.linalg.norm(axis)
    if length == 0.0 and kind != "fixed":
        raise ProblemError(f"{what}: its axis is 0 0 0, a direction is needed")
    return axis / length if length else axis


def _limits(element: Element, kind: JointType, what: str) -> Limits:
    """Return the limits; a continuous joint has none of its angle."""
    given = element.find("limit")
    if kind == "fixed" or (given is None and kind == "continuous"):
        return Limits()
    if given is None:
        raise ProblemError(f"{what} is {kind} and has no <limit>; write lower, upper, velocity")
    lower, upper = (_number(given, name, f"{what}: limit", 0.0) for name in ("lower", "upper"))
    velocity, effort = (
        _number(given, name, f"{what}: limit", np.inf) for name in ("velocity", "effort")
    )
    if min(velocity, effort) < 0.0:
        raise ProblemError(f"{what}: limits of velocity {velocity} and effort {effort}: below 0")
    if kind == "continuous":
        return Limits(velocity=velocity, effort=effort)
    if lower >= upper:
        raise ProblemError(
            f"{what}: its limits, {lower:g} to {upper:g}, leave no room (a limit that is not "
            "written is 0); make it fixed or continuous, or give both"
        )
    return Limits(lower, upper, velocity, effort)


def _friction(element: Element, name: str, what: str) -> float:
    given = element.find("dynamics")
    value = 0.0 if given is None else _number(given, name, f"{what}: dynamics", 0.0)
    if value < 0.0:
        raise ProblemError(f"{what}: its {name} is {value}, it must be 0 or more")
    return value


def _mimic(element: Element, what: str) -> Mimic | None:
    given = element.find("mimic")
    if given is None:
        return None
    return Mimic(
        _text(given, "joint", f"{what}: mimic"),
        _number(given, "multiplier", f"{what}: mimic", 1.0),
        _number(given, "offset", f"{what}: mimic", 0.0),
    )


def _origin(element: Element, what: str, tidy: float) -> Pose:
    given = element.find("origin")
    if given is None:
        return Pose.identity()
    zero = (0.0, 0.0, 0.0)
    angles = _vector(given, "rpy", f"{what}: origin", zero)
    return Pose(roll_pitch_yaw(angles, tidy), _vector(given, "xyz", f"{what}: origin", zero))


# -- reading one attribute --------------------------------------------------------


def _name(element: Element, what: str) -> str:
    return _text(element, "name", f"URDF: {what}")


def _child(element: Element, tag: str, what: str) -> Element:
    found = element.find(tag)
    if found is None:
        raise ProblemError(f"{what}: <{element.tag}> has no <{tag}>")
    return found


def _text(element: Element, attribute: str, what: str) -> str:
    value = element.get(attribute)
    if not value:
        raise ProblemError(f'{what}: <{element.tag}> has no {attribute}="..."')
    return value


def _number(element: Element, attribute: str, what: str, default: float | None = None) -> float:
    if default is not None and element.get(attribute) is None:
        return default
    return float(_numbers(_text(element, attribute, what), 1, f"{what}: {attribute}")[0])


def _vector(
    element: Element, attribute: str, what: str, default: tuple[float, ...] | None = None
) -> np.ndarray:
    if default is not None and element.get(attribute) is None:
        return np.array(default)
    return _numbers(_text(element, attribute, what), 3, f"{what}: {attribute}")


def _numbers(text: str, size: int, what: str) -> np.ndarray:
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError as error:
        raise ProblemError(f"{what} = '{text}' is not numeric") from error
    if values.size != size or not np.isfinite(values).all():
        raise ProblemError(f"{what} = '{text}': {size} finite numbers are needed")
    return values


def _positive(values: Iterable[float], what: str) -> list[float]:
    numbers = [float(value) for value in values]
    if min(numbers) <= 0.0:
        raise ProblemError(f"{what} = {numbers}: they must be positive")
    return numbers

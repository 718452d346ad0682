"""What a URDF says, and every way in which it can be wrong."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from models.robot import (
    BoxShape,
    CylinderShape,
    MeshShape,
    Robot,
    SphereShape,
    read_urdf,
    resolve_file,
)
from ocp import ProblemError
from tests.robot.robots import TREE, text_of

HEAD = '<robot name="r"><link name="a"/><link name="b"/><link name="c"/>'
BODY = """<link name="b"><inertial><mass value="{mass}"/><inertia ixx="{ixx}" ixy="0" ixz="0"
    iyy="1" iyz="0" izz="1"/></inertial></link>"""


def joint(name: str, parent: str, child: str, rest: str = "", kind: str = "continuous") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{rest}</joint>"
    )


AB, BC = joint("j", "a", "b"), joint("k", "b", "c")


def test_what_it_says_is_kept() -> None:
    found = read_urdf(TREE)
    assert found.name == "tree"
    assert [link.name for link in found.links][:3] == ["base", "column", "left"]
    column, left = found.links[1], found.links[2]
    tube, mesh = column.collisions
    assert tube.name == "tube"
    assert tube.shape == CylinderShape(0.05, 0.4)
    assert tube.pose.translation.tolist() == [0.0, 0.0, 0.2]
    assert mesh.shape == MeshShape("package://tree/column.stl", (1.0, 2.0, 3.0))
    assert left.collisions[0].shape == BoxShape((0.1, 0.2, 0.3))
    assert found.links[3].collisions[0].shape == SphereShape(0.1)
    assert column.inertia is not None
    assert column.inertia.mass == 6.0
    shoulder = found.joints[1]
    assert (shoulder.damping, shoulder.friction) == (0.5, 0.3)
    np.testing.assert_allclose(np.linalg.norm(shoulder.axis), 1.0)
    assert shoulder.limits.upper == np.inf


def test_a_file_is_read_as_its_text(tmp_path: Path) -> None:
    file = tmp_path / "tree.urdf"
    file.write_text(TREE, encoding="utf-8")
    for source in (file, str(file)):
        assert [j.name for j in read_urdf(source).joints] == [
            j.name for j in read_urdf(TREE).joints
        ]


def test_a_byte_order_mark_is_passed_over() -> None:
    assert read_urdf("\ufeff" + TREE).name == "tree"


def test_files_in_their_own_encoding_are_read(tmp_path: Path) -> None:
    file = tmp_path / "tree.urdf"
    text = TREE.replace('"tree"', '"Bäumchen"', 1)
    for encoding in ("utf-16", "iso-8859-1", "utf-8-sig"):
        declared = text.replace('encoding="utf-8"', f'encoding="{encoding.removesuffix("-sig")}"')
        file.write_bytes(declared.encode(encoding))
        assert read_urdf(file).name == "Bäumchen"
    assert read_urdf(text.replace('"utf-8"', '"iso-8859-1"')).name == "Bäumchen"


@pytest.mark.parametrize(
    "content", [b'<robot name="\xff"/>', b'<?xml version="1.0" encoding="x"?>']
)
def test_files_that_cannot_be_decoded_are_named(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "odd.urdf"
    file.write_bytes(content)
    with pytest.raises(ProblemError, match="this is no XML"):
        read_urdf(file)


def test_prefixes_that_nobody_declared_are_passed_over() -> None:
    text = HEAD + AB + BC + "<drake:diagram xyz:id='1'/></robot>"
    assert Robot.from_urdf(text).n == 2


def test_a_file_that_is_no_text_is_named() -> None:
    nothing: Any = None
    with pytest.raises(ProblemError, match="resolve_file: file is"):
        resolve_file(nothing, {})
    with pytest.raises(ProblemError, match="resolve_file: packages is"):
        resolve_file("package://a/b", nothing)


def test_files_of_packages_are_resolved() -> None:
    assert resolve_file("package://p/m/a.stl", {"p": "/data"}) == Path("/data/m/a.stl")
    assert resolve_file("a.stl", {}, base="/data") == Path("/data/a.stl")
    assert resolve_file("file:///x/a.stl", {}, base="/data") == Path("/x/a.stl")
    with pytest.raises(ProblemError, match="where is the package 'p'\\? Known are: q"):
        resolve_file("package://p/a.stl", {"q": "/data"})


def test_the_capsules_of_the_panda_are_kept() -> None:
    shapes = [s.shape for link in read_urdf(text_of("panda")).links for s in link.collisions]
    assert len([s for s in shapes if isinstance(s, CylinderShape)]) == 12
    assert len([s for s in shapes if isinstance(s, BoxShape)]) == 10


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot", "this is no XML: unclosed token: line 1"),
        ("<robot name='r'><link name='a'>", "this is no XML: mismatched tag"),
        ("<sdf/>", "outermost element is <sdf>, <robot> is needed"),
        ("<robot/>", "there is no <link>; a xacro file has to be expanded"),
        ("no/such.urdf", "there is no file no/such.urdf"),
        ("a text\nwithout XML" * 999, "this is no XML: syntax error"),
        ("<robot name='robot'><link/>", 'a link: <link> has no name="..."'),
        (HEAD + joint("j", "a", "b", kind="screw"), "joint 'j' has the type 'screw'; known are"),
        (HEAD + joint("j", "a", "b", kind="planar"), "'planar'; .*write two prismatic joints"),
        (HEAD + joint("j", "a", "b", kind="floating"), "free-flying bases are not part"),
        (HEAD + joint("j", "a", "b", kind="revolute"), "joint 'j' is revolute and has no <limit>"),
        (
            HEAD + joint("j", "a", "b", '<limit lower="1" upper="1"/>', "revolute"),
            "joint 'j': its limits, 1 to 1, leave no room",
        ),
        (
            HEAD + joint("j", "a", "b", '<limit effort="1"/>', "prismatic"),
            "limits, 0 to 0, leave no room .a limit that is not written is 0.",
        ),
        (
            HEAD + joint("j", "a", "b", '<limit velocity="-1"/>'),
            "joint 'j': limits of velocity -1.0 .* below 0",
        ),
        (HEAD + joint("j", "a", "b", '<axis xyz="0 0 0"/>'), "joint 'j': its axis is 0 0 0"),
        (HEAD + joint("j", "a", "b", '<axis xyz="0 0"/>'), "axis: xyz = '0 0': 3 finite numbers"),
        (HEAD + joint("j", "a", "b", '<origin xyz="0 0 x"/>'), "'0 0 x' is not numeric"),
        (HEAD + joint("j", "a", "b", '<origin rpy="0 0 inf"/>'), "rpy = '0 0 inf': 3 finite"),
        (HEAD + joint("j", "a", "b", '<dynamics damping="-1"/>'), "joint 'j': its damping is -1"),
        (HEAD + '<joint name="j" type="fixed"><parent link="a"/></joint>', "has no <child>"),
        (HEAD + '<joint name="j"/>', "joint 'j': <joint> has no type"),
        ('<robot><link name="a"/>' + BODY.format(mass=-1, ixx=1), "link 'b': its mass is -1.0 kg"),
        ('<robot><link name="a"/>' + BODY.format(mass=1, ixx=-2), "link 'b': a principal moment"),
        ('<robot><link name="a"/>' + BODY.format(mass="", ixx=1), "link 'b': mass: <mass> has no"),
        (
            '<robot><link name="a"><inertial><mass value="1"/></inertial></link>',
            "link 'a': <inertial> has no <inertia>",
        ),
        (
            '<robot><link name="a"><collision><geometry><cone/></geometry></collision></link>',
            "link 'a': collision: its geometry is cone; box, sphere",
        ),
        (
            '<robot><link name="a"><collision><geometry><sphere radius="0"/></geometry>'
            "</collision></link>",
            "link 'a': collision: radius = .0.0.: they must be positive",
        ),
    ],
)
def test_what_is_wrong_is_named(text: str, message: str) -> None:
    complete = text + "</robot>" if text.startswith("<robot") and len(text) > 20 else text
    with pytest.raises(ProblemError, match=message):
        read_urdf(complete)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD + AB, "links 'a' and 'c' both have no parent"),
        (HEAD + AB + joint("k", "b", "d"), "joint 'k': its child, link 'd', is not in"),
        (HEAD + AB + BC + joint("l", "a", "c"), "link 'c' has two parents, by joint 'k' and by"),
        (
            '<robot name="r"><link name="o"/><link name="a"/><link name="b"/>'
            + AB
            + joint("k", "b", "a"),
            "link 'b' hangs, by joint 'j', on itself: a loop without a base",
        ),
        (HEAD + AB + joint("j", "b", "c"), "two joints are called 'j'"),
        (HEAD + '<link name="a"/>' + AB + BC, "two links are called 'a'"),
        (
            HEAD + AB + joint("k", "b", "c", '<mimic joint="x"/>'),
            "joint 'k' mimics joint 'x', which is not there",
        ),
        (
            HEAD + joint("j", "a", "b", '<mimic joint="j"/>') + BC,
            "joint 'j' mimics itself, by j",
        ),
        (
            HEAD + joint("j", "a", "b", kind="fixed") + joint("k", "b", "c", '<mimic joint="j"/>'),
            "joint 'k' mimics joint 'j', which is fixed",
        ),
    ],
)
def test_what_is_no_tree_is_named(text: str, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        Robot.from_urdf(text + "</robot>")


def test_a_loop_of_all_links_is_named() -> None:
    text = '<robot name="r"><link name="a"/><link name="b"/>' + AB + joint("k", "b", "a")
    with pytest.raises(ProblemError, match="a loop without a base"):
        Robot.from_urdf(text + "</robot>")

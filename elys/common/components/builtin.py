"""The components ELYS comes with. SI units, y up, right-handed; a camera and a sun look along their local -z."""

from __future__ import annotations

from typing import Annotated, Literal

from elys.common.components.curve import Curve
from elys.common.components.declaration import Component, Kind, Quat, Values, Vec3, about, component


@component
class Transform(Component, frozen=True):
    """Where an entity stands, relative to its parent."""

    position: Annotated[Vec3, about("Place relative to the parent.", unit="m", step=0.05, dtype="f8")] = (0.0, 0.0, 0.0)
    rotation: Annotated[Quat, about("Turn relative to the parent, as a unit quaternion x y z w.", step=0.01)] = (
        0.0,
        0.0,
        0.0,
        1.0,
    )
    scale: Annotated[Vec3, about("Stretch along the local axes.", step=0.05)] = (1.0, 1.0, 1.0)


@component
class RigidBody(Component, frozen=True):
    """Lets physics move the entity (dynamic), or lets it push others (kinematic, static)."""

    motion: Annotated[
        Literal["dynamic", "kinematic", "static"],
        about("Moved by forces, moved only by its velocity, or never moved."),
    ] = "dynamic"
    mass: Annotated[float, about("Mass of the whole body.", unit="kg", minimum=1e-6, maximum=1e9, step=0.1)] = 1.0
    linear_velocity: Annotated[Vec3, about("Velocity of the centre of mass.", unit="m/s")] = (0.0, 0.0, 0.0)
    angular_velocity: Annotated[Vec3, about("Turning speed about the world axes.", unit="rad/s")] = (0.0, 0.0, 0.0)
    linear_damping: Annotated[float, about("Share of the velocity lost.", unit="1/s", minimum=0.0, step=0.01)] = 0.0
    angular_damping: Annotated[float, about("Share of the spin lost.", unit="1/s", minimum=0.0, step=0.01)] = 0.0
    gravity_scale: Annotated[float, about("How much of the scene's gravity acts on it.")] = 1.0
    lock_move_x: Annotated[bool, about("Never moves along the world's x axis.")] = False
    lock_move_y: Annotated[bool, about("Never moves along the world's y axis.")] = False
    lock_move_z: Annotated[bool, about("Never moves along the world's z axis.")] = False
    lock_turn_x: Annotated[bool, about("Never turns about the world's x axis.")] = False
    lock_turn_y: Annotated[bool, about("Never turns about the world's y axis.")] = False
    lock_turn_z: Annotated[bool, about("Never turns about the world's z axis.")] = False


@component
class Collider(Component, frozen=True):
    """The shape with which an entity collides; without a RigidBody on it or above it, an immovable obstacle."""

    shape: Annotated[
        Literal["box", "sphere", "capsule", "cylinder", "hull", "mesh", "plane", "height_field"],
        about(
            "Form of the collider. Hull and mesh take the entity's mesh; a mesh is static, a plane fills all below it; a "
            "height field is static ground after `heights`."
        ),
    ] = "box"
    size: Annotated[
        Vec3,
        about(
            "Full edge lengths of a box, or of a height field along x and z and the height of 1 in its file, before scale.",
            unit="m",
            minimum=1e-4,
            step=0.05,
        ),
    ] = (1.0, 1.0, 1.0)
    heights: Annotated[
        str,
        about(
            "Of a height field: grayscale PNG, black 0 and white 1, or .npy. North up: x to the right, z down.",
            kind=Kind.ASSET,
        ),
    ] = ""
    radius: Annotated[
        float, about("Radius of a sphere, capsule or cylinder, before scale.", unit="m", minimum=1e-4, step=0.05)
    ] = 0.5
    half_length: Annotated[
        float,
        about(
            "Half the length along y of a cylinder, or of a capsule without its caps.",
            unit="m",
            minimum=1e-4,
            step=0.05,
        ),
    ] = 0.5
    offset: Annotated[Vec3, about("Centre of the shape in the entity's space.", unit="m", step=0.05)] = (0.0, 0.0, 0.0)
    friction: Annotated[
        float, about("Coulomb coefficient; a pair takes the geometric mean.", minimum=0.0, step=0.01)
    ] = 0.5
    restitution: Annotated[
        float, about("Bounce; a pair takes the smaller one.", minimum=0.0, maximum=1.0, step=0.01)
    ] = 0.0
    rolling_friction: Annotated[
        float,
        about("Arm of the load that resists rolling; a pair takes the larger one.", unit="m", minimum=0.0, step=0.001),
    ] = 0.0
    spin_friction: Annotated[
        float,
        about("Arm of the load that resists spinning; a pair takes the larger one.", unit="m", minimum=0.0, step=0.001),
    ] = 0.0
    density: Annotated[
        float,
        about("Gives the body its mass by volume; 0 shares the body's mass.", unit="kg/m^3", minimum=0.0, step=10.0),
    ] = 0.0
    layer: Annotated[int, about("Layers it is in, as bits.")] = 1
    mask: Annotated[int, about("Layers that it collides with, as bits; -1 for all.")] = -1
    is_trigger: Annotated[bool, about("Notices what touches it and pushes nothing.")] = False


@component
class Joint(Component, frozen=True):
    """Joins the body that the entity is, or is part of, to another body or to the world.

    The joint's COORDINATE is how far this body has turned (a hinge, the twist of a cone) or moved (a slider) against the other
    along `axis`, or the distance between the anchors; limits, spring and motor act on it.
    """

    kind: Annotated[
        Literal["fixed", "ball", "hinge", "slider", "distance", "cone_twist", "gear", "motor"],
        about(
            "What stays free: nothing, all turns, a turn or a way along the axis, all but a length, a cone of directions. A gear "
            "couples two joints, a motor drives all six axes."
        ),
    ] = "fixed"
    other: Annotated[int, about("Entity that it is joined to; none for the world.", kind=Kind.ENTITY)] = 0
    anchor: Annotated[Vec3, about("Where it is joined, in this entity's space.", unit="m", step=0.05, dtype="f8")] = (
        0.0,
        0.0,
        0.0,
    )
    axis: Annotated[
        Vec3, about("Of a hinge, slider or cone, in this entity's space, of any length.", step=0.05, dtype="f8")
    ] = (1.0, 0.0, 0.0)
    fit: Annotated[
        bool,
        about(
            "Takes other_anchor, rest_rotation and a length that is not given from how the two stand, once, and turns itself off."
        ),
    ] = True
    other_anchor: Annotated[
        Vec3, about("Where it is joined, in the other's space.", unit="m", step=0.05, dtype="f8")
    ] = (0.0, 0.0, 0.0)
    rest_rotation: Annotated[
        Quat, about("How this entity is turned in the other's space where angles are 0.", step=0.01, dtype="f8")
    ] = (0.0, 0.0, 0.0, 1.0)
    collide_connected: Annotated[bool, about("Whether the two bodies collide with each other.")] = False
    frequency: Annotated[
        float, about("How stiffly it holds what is not free; 0 is rigid.", unit="Hz", minimum=0.0, step=0.5)
    ] = 0.0
    damping_ratio: Annotated[float, about("Of what is held softly; 1 is critical.", minimum=0.0, step=0.05)] = 1.0
    limited: Annotated[bool, about("Whether the coordinate stays between lower and upper.")] = False
    lower: Annotated[float, about("Least coordinate.", unit="rad | m", step=0.05)] = 0.0
    upper: Annotated[float, about("Largest coordinate.", unit="rad | m", step=0.05)] = 0.0
    swing_limit: Annotated[
        float, about("Half the opening of a cone_twist's cone.", unit="rad", minimum=0.0, maximum=3.1, step=0.01)
    ] = 3.1
    spring_frequency: Annotated[
        float, about("Of a spring on the coordinate, as the masses are; 0 for none.", unit="Hz", minimum=0.0, step=0.1)
    ] = 0.0
    spring_damping: Annotated[float, about("Damping ratio of the spring.", minimum=0.0, step=0.05)] = 0.0
    spring_rest: Annotated[float, about("Coordinate at which the spring rests.", unit="rad | m", step=0.05)] = 0.0
    spring_limit: Annotated[
        float, about("Most torque or force of the spring; 0 for any.", unit="N m | N", minimum=0.0, step=1.0)
    ] = 0.0
    motor_speed: Annotated[float, about("Wanted speed of the coordinate; 0 brakes.", unit="rad/s | m/s", step=0.1)] = (
        0.0
    )
    motor_limit: Annotated[
        float, about("Most torque or force of the motor; 0 for none.", unit="N m | N", minimum=0.0, step=1.0)
    ] = 0.0
    drive_velocity: Annotated[
        Vec3, about("Of a motor: velocity against the other, along the other's axes.", unit="m/s")
    ] = (0.0, 0.0, 0.0)
    drive_spin: Annotated[
        Vec3, about("Of a motor: turning speed against the other, about the other's axes.", unit="rad/s")
    ] = (0.0, 0.0, 0.0)
    drive_force: Annotated[float, about("Of a motor: its most force.", unit="N", minimum=0.0, step=1.0)] = 0.0
    drive_torque: Annotated[float, about("Of a motor: its most torque.", unit="N m", minimum=0.0, step=1.0)] = 0.0
    joint_a: Annotated[int, about("Of a gear: entity with the first joint.", kind=Kind.ENTITY)] = 0
    joint_b: Annotated[int, about("Of a gear: entity with the second joint.", kind=Kind.ENTITY)] = 0
    ratio: Annotated[float, about("Of a gear: change of the second coordinate for one of the first.", step=0.1)] = 1.0
    break_force: Annotated[float, about("Breaks above it; 0 for never.", unit="N", minimum=0.0, step=10.0)] = 0.0
    break_torque: Annotated[float, about("Breaks above it; 0 for never.", unit="N m", minimum=0.0, step=10.0)] = 0.0
    broken: Annotated[bool, about("Holds nothing: set when it breaks, and taken away to join again.")] = False


@component
class MeshRenderer(Component, frozen=True):
    """Draws a mesh at the entity's place."""

    mesh: Annotated[str, about("box, sphere, cylinder, cone, capsule, plane, or a mesh asset.", kind=Kind.ASSET)] = (
        "box"
    )
    visible: Annotated[bool, about("Drawn at all.")] = True
    cast_shadows: Annotated[bool, about("Stops the light of the sun and of lamps.")] = True
    tangents: Annotated[
        Literal["auto", "vertices", "pixels"],
        about(
            "A normal map lies along tangents of vertices, computed if need be, or of pixels; auto: as the mesh has them."
        ),
    ] = "auto"


@component
class Material(Component, frozen=True):
    """How the entity's mesh looks: glTF metallic-roughness."""

    base_color: Annotated[Vec3, about("Colour, linear.", minimum=0.0, maximum=1.0, step=0.01, kind=Kind.COLOR)] = (
        0.8,
        0.8,
        0.8,
    )
    opacity: Annotated[float, about("Coverage: 1 is solid.", minimum=0.0, maximum=1.0, step=0.01)] = 1.0
    metallic: Annotated[float, about("0 dielectric, 1 metal.", minimum=0.0, maximum=1.0, step=0.01)] = 0.0
    roughness: Annotated[float, about("0 mirror, 1 chalk.", minimum=0.0, maximum=1.0, step=0.01)] = 0.6
    emissive: Annotated[Vec3, about("Light it gives off by itself, linear.", minimum=0.0, kind=Kind.COLOR)] = (
        0.0,
        0.0,
        0.0,
    )
    base_color_texture: Annotated[
        str,
        about(
            "Image times base_color, sRGB; image.png?scale=2,2&uv=1&wrap=clamp lays it differently.", kind=Kind.ASSET
        ),
    ] = ""
    metallic_roughness_texture: Annotated[
        str, about("Image: green times roughness, blue times metallic.", kind=Kind.ASSET)
    ] = ""
    normal_texture: Annotated[str, about("Tangent-space normal map.", kind=Kind.ASSET)] = ""
    normal_scale: Annotated[float, about("How steep the normal map's bumps are.", minimum=-100.0, maximum=100.0)] = 1.0
    occlusion_texture: Annotated[str, about("Image whose red channel darkens ambient light.", kind=Kind.ASSET)] = ""
    occlusion_strength: Annotated[
        float, about("How much the occlusion texture darkens.", minimum=0.0, maximum=1.0, step=0.01)
    ] = 1.0
    emissive_texture: Annotated[str, about("Image times emissive, sRGB.", kind=Kind.ASSET)] = ""
    alpha_mode: Annotated[Literal["opaque", "mask", "blend"], about("What opacity means.")] = "opaque"
    alpha_cutoff: Annotated[float, about("Opacity below which mask drops a pixel.", minimum=0.0, maximum=1.0)] = 0.5
    double_sided: Annotated[bool, about("Drawn from behind as well.")] = False
    unlit: Annotated[bool, about("Shows base_color as it is, whatever light there is.")] = False
    ior: Annotated[float, about("Index of refraction: how much a dielectric mirrors.", minimum=0.0, step=0.01)] = 1.5
    specular: Annotated[
        float,
        about("How much of that is there: 0 takes a dielectric's highlights.", minimum=0.0, maximum=1.0, step=0.01),
    ] = 1.0
    specular_color: Annotated[
        Vec3, about("Tint of a dielectric's highlights seen head-on, linear.", minimum=0.0, kind=Kind.COLOR)
    ] = (1.0, 1.0, 1.0)
    specular_texture: Annotated[str, about("Image: alpha times specular.", kind=Kind.ASSET)] = ""
    specular_color_texture: Annotated[str, about("Image times specular_color, sRGB.", kind=Kind.ASSET)] = ""
    clearcoat: Annotated[float, about("Share covered by a clear varnish.", minimum=0.0, maximum=1.0, step=0.01)] = 0.0
    clearcoat_roughness: Annotated[float, about("Of the varnish.", minimum=0.0, maximum=1.0, step=0.01)] = 0.0
    clearcoat_texture: Annotated[str, about("Image: red times clearcoat.", kind=Kind.ASSET)] = ""
    clearcoat_roughness_texture: Annotated[str, about("Image: green times clearcoat_roughness.", kind=Kind.ASSET)] = ""
    clearcoat_normal_texture: Annotated[str, about("Normal map of the varnish.", kind=Kind.ASSET)] = ""


@component
class Skin(Component, frozen=True):
    """Lets the mesh be bent by other entities, its joints; where the entity itself stands does not matter then."""

    skin: Annotated[
        str, about("Which joints, and where they were when bound, as model.glb#skin/0.", kind=Kind.ASSET)
    ] = ""
    root: Annotated[int, about("The entity below which the joints are, by name.", kind=Kind.ENTITY)] = 0


@component
class Morph(Component, frozen=True):
    """How far the mesh is drawn towards each of its morph targets."""

    weights: Annotated[str, about("A number for each target, as 0.5 0 1; those not named are 0.")] = ""


@component
class Light(Component, frozen=True):
    """A lamp, as in KHR_lights_punctual."""

    kind: Annotated[Literal["directional", "point", "spot"], about("Sun, bulb or torch.")] = "directional"
    color: Annotated[Vec3, about("Colour, linear.", minimum=0.0, maximum=1.0, step=0.01, kind=Kind.COLOR)] = (
        1.0,
        1.0,
        1.0,
    )
    intensity: Annotated[float, about("Illuminance of a sun [lx], candela of others.", unit="lx | cd", minimum=0.0)] = (
        3.0
    )
    over_time: Annotated[
        Curve,
        about(
            "What the intensity is multiplied with, over the time of the simulation; begins anew after the last key.",
            minimum=0.0,
            maximum=1000.0,
        ),
    ] = ()
    range: Annotated[float, about("Where a bulb's light ends; 0 for never.", unit="m", minimum=0.0)] = 0.0
    inner_cone_angle: Annotated[
        float, about("Full light inside.", unit="rad", minimum=0.0, maximum=1.5708, step=0.01)
    ] = 0.0
    outer_cone_angle: Annotated[
        float, about("No light outside.", unit="rad", minimum=0.0, maximum=1.5708, step=0.01)
    ] = 0.7853982
    cast_shadows: Annotated[bool, about("Throws shadows.")] = True


@component
class Environment(Component, frozen=True):
    """Light from far away all around, instead of the scene's background and ambient colours; turned as its entity is."""

    kind: Annotated[
        Literal["image", "sky", "color"],
        about("A picture of light from everywhere, a clear sky around the scene's sun, or the same from everywhere."),
    ] = "sky"
    image: Annotated[str, about("Equirectangular picture: .hdr or .exr, or any image in sRGB.", kind=Kind.ASSET)] = ""
    color: Annotated[Vec3, about("What it is multiplied with, linear.", minimum=0.0, step=0.01, kind=Kind.COLOR)] = (
        1.0,
        1.0,
        1.0,
    )
    intensity: Annotated[
        float,
        about(
            "Radiance of a colour, factor on a picture; under a sky, radiance of a white level surface in the shade.",
            minimum=0.0,
            step=0.05,
        ),
    ] = 1.0
    turbidity: Annotated[float, about("Haze of a sky: 2 is clear, 8 is milky.", minimum=1.8, maximum=10.0)] = 3.0
    ground_color: Annotated[
        Vec3, about("Below the horizon of a sky, as seen in its light.", minimum=0.0, step=0.01, kind=Kind.COLOR)
    ] = (0.3, 0.28, 0.25)
    visible: Annotated[bool, about("Seen behind everything; else it only lights.")] = True


@component
class Camera(Component, frozen=True):
    """A point of view."""

    projection: Annotated[
        Literal["perspective", "orthographic"], about("Whether what is farther away looks smaller.")
    ] = "perspective"
    field_of_view: Annotated[
        float, about("Vertical opening angle.", unit="rad", minimum=0.02, maximum=3.0, step=0.01)
    ] = 0.9
    ortho_height: Annotated[
        float, about("Of what an orthographic camera sees, from below to above.", unit="m", minimum=1e-3, step=0.1)
    ] = 10.0
    near: Annotated[float, about("Nearest distance seen.", unit="m", minimum=1e-4, step=0.01)] = 0.05
    far: Annotated[float, about("Farthest distance seen.", unit="m", minimum=1e-3, step=1.0)] = 500.0
    priority: Annotated[int, about("The enabled camera with the highest one is the scene's view.")] = 0
    player: Annotated[
        int, about("Windows of this player look through it, others do not; 0: all may.", minimum=0, maximum=16)
    ] = 0


@component
class Script(Component, frozen=True):
    """What an entity does, written in Python; see docs/scripts.md."""

    source: Annotated[str, about("Python file and class in it, as door.py#Door.", kind=Kind.ASSET)] = ""
    enabled: Annotated[bool, about("Whether the behaviour runs.")] = True
    values: Annotated[Values, about("The script's own fields, where they are not their defaults.")] = {}

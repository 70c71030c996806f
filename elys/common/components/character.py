"""Who walks, and the camera that follows: what people set, what scripts wish in each tick, and what came of it."""

from __future__ import annotations

from typing import Annotated, Literal

from elys.common.components.declaration import Component, Kind, Vec3, about, component


@component
class Character(Component, frozen=True):
    """Walks, runs, jumps, crouches, swims or flies as it is told; its entity stands at its feet. See docs/characters.md."""

    mode: Annotated[
        Literal["walk", "swim", "fly"], about("On feet and under gravity, or free to go up and down as well.")
    ] = "walk"
    player: Annotated[
        int, about("Whose keys and pointer it follows; 0 for nobody's.", minimum=0.0, maximum=16.0, step=1.0)
    ] = 0
    radius: Annotated[float, about("Of its capsule.", unit="m", minimum=0.05, maximum=50.0, step=0.01, dtype="f8")] = (
        0.3
    )
    height: Annotated[
        float, about("From its soles to its crown, upright.", unit="m", minimum=0.2, maximum=200.0, dtype="f8")
    ] = 1.8
    crouch_height: Annotated[
        float, about("The same when it crouches.", unit="m", minimum=0.1, maximum=200.0, dtype="f8")
    ] = 1.1
    walk_speed: Annotated[
        float, about("Along the ground, on a slope too.", unit="m/s", minimum=0.0, maximum=100.0, dtype="f8")
    ] = 3.0
    run_speed: Annotated[float, about("The same when it runs.", unit="m/s", minimum=0.0, maximum=100.0, dtype="f8")] = (
        6.0
    )
    crouch_speed: Annotated[
        float, about("The same when it crouches.", unit="m/s", minimum=0.0, maximum=100.0, dtype="f8")
    ] = 1.5
    swim_speed: Annotated[float, about("In mode swim.", unit="m/s", minimum=0.0, maximum=100.0, dtype="f8")] = 2.0
    fly_speed: Annotated[float, about("In mode fly.", unit="m/s", minimum=0.0, maximum=100.0, dtype="f8")] = 8.0
    fall_speed: Annotated[
        float, about("Fastest fall.", unit="m/s", minimum=0.1, maximum=200.0, step=1.0, dtype="f8")
    ] = 55.0
    acceleration: Annotated[
        float, about("Towards a wished velocity.", unit="m/s^2", minimum=0.0, maximum=1e4, step=1.0, dtype="f8")
    ] = 30.0
    braking: Annotated[
        float, about("Without a wish.", unit="m/s^2", minimum=0.0, maximum=1e4, step=1.0, dtype="f8")
    ] = 40.0
    air_control: Annotated[
        float, about("Share of the acceleration in the air.", minimum=0.0, maximum=1.0, step=0.05, dtype="f8")
    ] = 0.3
    jump_height: Annotated[
        float, about("How high its soles get.", unit="m", minimum=0.0, maximum=100.0, step=0.05, dtype="f8")
    ] = 1.2
    coyote_time: Annotated[
        float,
        about(
            "It may jump for so long after the ground ended.", unit="s", minimum=0.0, maximum=2.0, step=0.01, dtype="f8"
        ),
    ] = 0.1
    jump_buffer: Annotated[
        float,
        about(
            "It still jumps when it lands so long after it was told.",
            unit="s",
            minimum=0.0,
            maximum=2.0,
            step=0.01,
            dtype="f8",
        ),
    ] = 0.12
    slope_limit: Annotated[
        float, about("Steepest ground it stands on.", unit="deg", minimum=0.0, maximum=89.0, step=1.0, dtype="f8")
    ] = 50.0
    step_height: Annotated[
        float,
        about("Highest step it climbs and goes down.", unit="m", minimum=0.0, maximum=50.0, step=0.01, dtype="f8"),
    ] = 0.35
    push_force: Annotated[
        float, about("Most force on a body in its way.", unit="N", minimum=0.0, maximum=1e7, step=10.0, dtype="f8")
    ] = 500.0
    mass: Annotated[
        float, about("Whose weight is on what it stands on.", unit="kg", minimum=0.0, maximum=1e6, step=1.0, dtype="f8")
    ] = 80.0
    gravity_scale: Annotated[
        float, about("How much of the scene's gravity acts on it.", minimum=0.0, maximum=100.0, dtype="f8")
    ] = 1.0
    wish: Annotated[
        Vec3,
        about(
            "Where it shall go in world space: as fast as it can at length 1; y counts in modes swim and fly.",
            dtype="f8",
        ),
    ] = (0.0, 0.0, 0.0)
    wish_run: Annotated[bool, about("It shall run.")] = False
    wish_jump: Annotated[bool, about("It shall jump: once each time this becomes true.")] = False
    wish_crouch: Annotated[bool, about("It shall crouch.")] = False
    yaw: Annotated[
        float, about("Where it faces: 0 is along -z, a quarter turn along -x.", unit="rad", step=0.01, dtype="f8")
    ] = 0.0
    velocity: Annotated[
        Vec3, about("Its own, beside what carries it. Physics writes it.", unit="m/s", dtype="f8", is_memory=True)
    ] = (
        0.0,
        0.0,
        0.0,
    )
    carried: Annotated[
        Vec3, about("Velocity of what carries it. Physics writes it.", unit="m/s", dtype="f8", is_memory=True)
    ] = (
        0.0,
        0.0,
        0.0,
    )
    grounded: Annotated[bool, about("Whether it stands. Physics writes it.", is_memory=True)] = False
    ground_normal: Annotated[
        Vec3,
        about(
            "Of the ground, or of a slope too steep to stand on; else 0. Physics writes it.", dtype="f8", is_memory=True
        ),
    ] = (0.0, 0.0, 0.0)
    ground: Annotated[
        int, about("What it stands on; none in the air. Physics writes it.", kind=Kind.ENTITY, is_memory=True)
    ] = 0
    blocked: Annotated[bool, about("Whether something was in its way. Physics writes it.", is_memory=True)] = False
    stature: Annotated[
        float,
        about(
            "Its height now; 0 before the first tick. Physics writes it.",
            unit="m",
            minimum=0.0,
            dtype="f8",
            is_memory=True,
        ),
    ] = 0.0
    air_time: Annotated[
        float, about("Since it last stood. Physics writes it.", unit="s", minimum=0.0, dtype="f8", is_memory=True)
    ] = 0.0
    jump_time: Annotated[
        float,
        about("Since it was last told to jump. Physics writes it.", unit="s", minimum=0.0, dtype="f8", is_memory=True),
    ] = 1e9
    jump_held: Annotated[
        bool, about("Whether it was told to jump in the last tick. Physics writes it.", is_memory=True)
    ] = False
    has_jumped: Annotated[bool, about("Whether it left the ground by itself. Physics writes it.", is_memory=True)] = (
        False
    )


@component
class CameraRig(Component, frozen=True):
    """Keeps a camera behind or in the head of what it follows, and out of walls. See docs/characters.md."""

    target: Annotated[int, about("Entity that it follows.", kind=Kind.ENTITY)] = 0
    view: Annotated[Literal["third", "first"], about("From behind, or from the eyes.")] = "third"
    player: Annotated[int, about("Whose pointer turns it; 0 for nobody's.", minimum=0.0, maximum=16.0, step=1.0)] = 0
    height: Annotated[
        float,
        about("Of the eyes above the target's place; with a crouching one they sink.", unit="m", step=0.05, dtype="f8"),
    ] = 1.6
    distance: Annotated[
        float, about("Behind the eyes, in third person.", unit="m", minimum=0.0, maximum=1000.0, dtype="f8")
    ] = 4.0
    shoulder: Annotated[
        float,
        about(
            "To the right of the target, in third person.",
            unit="m",
            minimum=-100.0,
            maximum=100.0,
            step=0.05,
            dtype="f8",
        ),
    ] = 0.4
    radius: Annotated[
        float, about("It keeps so far from walls.", unit="m", minimum=0.01, maximum=10.0, step=0.01, dtype="f8")
    ] = 0.2
    yaw: Annotated[
        float, about("Where it looks: 0 is along -z, a quarter turn along -x.", unit="rad", step=0.01, dtype="f8")
    ] = 0.0
    pitch: Annotated[
        float, about("How far up it looks.", unit="rad", minimum=-1.57, maximum=1.57, step=0.01, dtype="f8")
    ] = -0.2
    least_pitch: Annotated[
        float, about("Farthest down it looks.", unit="rad", minimum=-1.57, maximum=1.57, step=0.01, dtype="f8")
    ] = -1.4
    most_pitch: Annotated[
        float, about("Farthest up it looks.", unit="rad", minimum=-1.57, maximum=1.57, step=0.01, dtype="f8")
    ] = 1.4
    sensitivity: Annotated[
        float,
        about("How far the pointer turns it.", unit="rad", minimum=0.0, maximum=1.0, step=0.001, dtype="f8"),
    ] = 0.003
    return_rate: Annotated[
        float,
        about(
            "How fast it goes back to its distance when the way is free again.",
            unit="1/s",
            minimum=0.0,
            maximum=1000.0,
            dtype="f8",
        ),
    ] = 6.0
    follow_rate: Annotated[
        float,
        about(
            "How fast it follows steps up and down; 0 for at once.", unit="1/s", minimum=0.0, maximum=1000.0, dtype="f8"
        ),
    ] = 15.0
    turns_with_ground: Annotated[bool, about("Whether it turns with the platform that its target stands on.")] = True
    reach: Annotated[
        float,
        about(
            "How far it is behind the eyes now; below 0 before the first tick.",
            unit="m",
            minimum=-1.0,
            dtype="f8",
            is_memory=True,
        ),
    ] = -1.0
    eye: Annotated[Vec3, about("Where the eyes are now.", unit="m", dtype="f8", is_memory=True)] = (0.0, 0.0, 0.0)

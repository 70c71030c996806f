"""The playground's stations: what is green can be done, what is red cannot, and the rest does what it is there for."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from elys.bus.messages.commands import Input
from elys.common.assets import AssetStore
from elys.common.components import CameraRig, Character, Material, RigidBody, Transform
from elys.common.ids import Entity
from elys.common.scene import open_scene
from elys.samples import write_sample
from elys.samples.playground import (
    _CAN,
    _CANNOT,
    CEILING,
    LANDING,
    SLOPE_LIMIT,
    SLOPES,
    STEP_HEIGHT,
    STEPS,
    WATER,
)
from elys.sim_node.simulation import Simulation

AHEAD, BACK, LEFT, RIGHT = (0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)


class Visit:
    """Somebody in the playground who is put beside a station and told what to do there."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.world = simulation.world
        self.walker = self.named("Walker")

    def named(self, path: str) -> Entity:
        return self.world.hierarchy.find(path)

    def place(self, path: str) -> np.ndarray:
        """Where an entity is in the world [m]."""
        return np.array(self.world.transforms.world_pose(self.named(path))[0])

    def is_green(self, path: str) -> bool:
        color = self.world.get(self.named(path), Material).base_color
        assert color in (pytest.approx(_CAN), pytest.approx(_CANNOT))
        return color == pytest.approx(_CAN)

    def stand(self, x: float, y: float, z: float) -> None:
        """Stands somewhere and does nothing."""
        still = {"velocity": (0.0, 0.0, 0.0), "carried": (0.0, 0.0, 0.0), "grounded": False, "ground": 0}
        self.world.set_fields(self.walker, Character, still)  # where it was is no ground of it any more
        self.world.set_fields(self.walker, Transform, {"position": (x, y, z)})
        self.go(2)

    def go(self, ticks: int, wish=(0.0, 0.0, 0.0), *, run=False, jump=False, crouch=False) -> np.ndarray:
        """Places (T, 3) of the soles at the ends of ticks."""
        wishes = {"player": 0, "wish": wish, "wish_run": run, "wish_jump": jump, "wish_crouch": crouch}
        self.world.set_fields(self.walker, Character, wishes)
        places = []
        for _ in range(ticks):
            self.simulation.step()
            places.append(self.place("Walker"))
        return np.array(places)

    @property
    def legs(self) -> Character:
        return self.world.get(self.walker, Character)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("playground") / "playground.scene.json"
    write_sample("playground", path)
    return path


@pytest.fixture
def visit(file: Path) -> Iterator[Visit]:
    assets = AssetStore()
    yield Visit(Simulation.load(open_scene(file, assets), assets))


def test_each_step_is_climbed_or_not_as_its_colour_says(visit: Visit) -> None:
    for height in STEPS:
        step = f"Steps/Step {height:.2f} m"
        x, _, z = visit.place(step)
        visit.stand(x, 0.02, z + 2.5)
        highest = visit.go(60, AHEAD)[:, 1].max()
        assert (highest > height - 0.005) == visit.is_green(step) == (height <= STEP_HEIGHT), height
    assert not visit.is_green(f"Steps/Step {STEPS[-1]:.2f} m")


def test_each_slope_is_climbed_or_not_as_its_colour_says(visit: Visit) -> None:
    for degrees in SLOPES:
        slope = f"Slopes/Slope {degrees:.0f} deg"
        z = visit.place(slope)[2]
        visit.stand(12.0, 0.02, z)
        highest = visit.go(150, RIGHT)[:, 1].max()
        assert (highest > 2.0) == visit.is_green(slope) == (degrees <= SLOPE_LIMIT), degrees


def test_stairs_are_gone_up_and_the_slope_behind_them_down(visit: Visit) -> None:
    x, _, z = visit.place("Stairs/Stair 1")
    visit.stand(x - 1.0, 0.02, z)
    path = visit.go(330, RIGHT)
    assert path[:, 1].max() == pytest.approx(2.4, abs=0.02)
    assert path[-1, 1] < 0.1 and path[-1, 0] > x + 11.0
    assert np.diff(path[path[:, 0] > x + 7.5], axis=0)[:, 1].max() < 0.01  # no jumping down


def test_the_tunnel_lets_only_who_crouches_through_and_up_again_behind_it(visit: Visit) -> None:
    x, _, z = visit.place("Tunnel/Roof")
    visit.stand(x, 0.02, z + 4.0)
    assert visit.go(120, AHEAD)[-1, 2] > z + 2.0  # stands before it
    visit.go(20, crouch=True)
    inside = visit.go(90, AHEAD, crouch=True)
    assert z - 2.0 < inside[-1, 2] < z + 1.5
    visit.go(5)
    assert visit.legs.stature <= CEILING  # there is no room to rise, though nobody wishes to crouch
    assert visit.go(240, AHEAD)[-1, 2] < z - 2.5
    assert visit.legs.stature == visit.legs.height


def test_running_into_the_corner_ends_without_trembling(visit: Visit) -> None:
    x, _, z = visit.place("Corner")
    for aside in (0.0, 0.12):
        visit.stand(x, 0.02, z + 3.0)
        path = visit.go(240, (aside, 0.0, -1.0), run=True)
        assert path[-1, 2] < z + 2.5  # it is in
        assert np.ptp(path[-60:], axis=0).max() < 1e-6


def test_nothing_is_felt_of_the_seams_between_tiles(visit: Visit) -> None:
    visit.stand(-3.5, 0.12, 6.0)
    path = visit.go(130, (1.0, 0.0, -0.73))
    assert np.ptp(path[5:, 1]) < 1e-6
    assert np.linalg.norm(np.diff(path[30:, ::2], axis=0), axis=1) == pytest.approx(3.0 / 60.0, rel=1e-6)


def test_the_disc_turns_who_stands_on_it_and_the_carousel_takes_him_round(visit: Visit) -> None:
    middle = visit.place("Disc")
    visit.stand(middle[0] + 2.0, 0.28, middle[2])
    visit.go(5)
    yaw, path = visit.legs.yaw, visit.go(120)
    assert np.hypot(*(path[:, ::2] - middle[::2]).T) == pytest.approx(2.0, abs=0.01)
    assert visit.legs.yaw - yaw == pytest.approx(0.7 * 2.0, rel=1e-3)
    at = visit.place("Carousel/Gondola 0")
    visit.stand(at[0], at[1] + 0.17, at[2])
    visit.go(5)
    away = visit.go(120)[-1] - visit.place("Carousel/Gondola 0")
    assert np.hypot(*away[::2]) < 0.3


def test_light_crates_are_pushed_and_the_heavy_one_is_not(visit: Visit) -> None:
    for number, is_light in ((0, True), (2, False)):
        x, _, z = visit.place(f"Crates/Crate {number}")
        visit.stand(x, 0.02, z + 1.6)
        visit.go(90, AHEAD)
        assert (z - visit.place(f"Crates/Crate {number}")[2] > 0.5) == is_light, number
        visit.stand(0.0, 0.02, 13.0)


def test_the_seesaw_goes_down_under_who_stands_on_its_end(visit: Visit) -> None:
    x, _, z = visit.place("Seesaw/Plank")
    for side in (1.0, -1.0):
        visit.stand(x + 2.0 * side, 1.3, z)
        visit.go(90)
        rotation = visit.world.transforms.world_pose(visit.named("Seesaw/Plank"))[1]
        assert 2.0 * math.atan2(rotation[2], rotation[3]) == pytest.approx(-0.24 * side, abs=0.03)


def test_nobody_runs_through_the_fence(visit: Visit) -> None:
    x, _, z = visit.place("Fence/Sheet")
    visit.stand(x + 1.0, 0.02, z + 5.0)
    assert visit.go(120, AHEAD, run=True)[:, 2].min() > z + 0.3


def test_one_walks_into_the_pool_swims_and_comes_out_again(visit: Visit) -> None:
    x, _, z = visit.place("Pool/Stair up 1")
    visit.stand(x - 1.0, 0.02, z)
    path = visit.go(85, RIGHT)
    assert path[:, 1].max() == pytest.approx(1.6, abs=0.02) and visit.legs.mode == "walk"
    visit.go(150, RIGHT)
    assert visit.legs.mode == "swim"
    swum = visit.go(60, RIGHT)
    assert swum[-1, 0] - swum[0, 0] < 2.0 * 1.01  # as fast as it swims, and no faster
    high = visit.go(150, jump=True)[-60:, 1]
    assert high.max() < WATER and high.min() > 0.1  # at the surface, head out, and neither flying nor sunk
    visit.go(60)
    back = visit.go(420, LEFT)
    assert visit.legs.mode == "walk" and back[-1, 0] < x
    assert back[-1, 1] < 0.1


def test_the_lift_takes_one_up_to_the_landing(visit: Visit) -> None:
    x, y, z = visit.place("Lift's place/Lift/Platform")
    visit.stand(x, y + 0.15, z)
    heights = visit.go(400)[:, 1]
    assert heights.max() == pytest.approx(LANDING, abs=0.03)
    assert heights.min() < 0.4  # and down
    visit.stand(x, visit.place("Lift's place/Lift/Platform")[1] + 0.15, z)
    while visit.place("Lift's place/Lift/Platform")[1] < LANDING - 0.126:
        visit.go(1)
    path = visit.go(60, RIGHT)
    assert path[-1, 0] > x + 2.0 and path[-1, 1] == pytest.approx(LANDING, abs=0.03)


def test_v_changes_between_first_and_third_person(visit: Visit) -> None:
    rig = visit.named("Camera")

    def press(key: str, ticks: int) -> tuple[str, float]:
        """The view, and how far the camera is from the walker's head [m]."""
        for is_down in (True, False):
            visit.simulation.inputs.take(Input(player=1, source="test", changes=((key, is_down),)))
            visit.simulation.step()
        for _ in range(ticks):
            visit.simulation.step()
        eye = visit.place("Camera")
        return visit.world.get(rig, CameraRig).view, float(
            np.linalg.norm(eye - visit.place("Walker") - np.array((0.0, 1.65, 0.0)))
        )

    for _ in range(10):
        visit.simulation.step()
    view, distance = press("v", 60)
    assert view == "first" and distance < 0.3
    view, distance = press("v", 120)
    assert view == "third" and distance > 2.0


def test_what_moves_by_itself_is_kinematic(visit: Visit) -> None:
    for path in ("Disc", "Carousel", "Lift's place/Lift/Platform"):
        assert visit.world.get(visit.named(path), RigidBody).motion == "kinematic"

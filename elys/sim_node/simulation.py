"""A scene that runs: a world, its physics and its tick. No process and no bus, so tests and notebooks can drive it too.

    simulation = Simulation.load(open_scene("yard.scene.json", assets), assets)
    for _ in range(600):
        simulation.step()
    simulation.moving_bodies().position        # [N, 3] m

What happens in a tick is `simulation.systems`, in the order in which they stand there. One more is put in front of them; what it
records in `world.commands` is done when it returns, and physics sees it in the same tick:

    def rain(world: World) -> None:
        world.commands.spawn([Transform(position=(0.0, 9.0, 0.0)), RigidBody(), Collider()])

    simulation.systems = (rain, *simulation.systems)
"""

from __future__ import annotations

import hashlib
import logging
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.session import Event
from elys.common.assets.store import AssetStore
from elys.common.components import CameraRig, Joint, RigidBody, Transform
from elys.common.ids import Entity
from elys.common.scene import OpenedScene, SceneSettings
from elys.sim_node.animation.root_walks import Driven
from elys.sim_node.capture import captured, restored
from elys.sim_node.character.cameras import Cameras
from elys.sim_node.character.movement import Characters
from elys.sim_node.character.players import Players
from elys.sim_node.character.telling import told
from elys.sim_node.ecs.changes import WorldChanges
from elys.sim_node.ecs.schedule import System, run
from elys.sim_node.ecs.text_sweep import EVERY, sweep_texts
from elys.sim_node.ecs.world import World
from elys.sim_node.input_actions import Declared, declared_in
from elys.sim_node.inputs import Inputs
from elys.sim_node.physics.checks import named
from elys.sim_node.physics.settings import Attractor, PhysicsSettings
from elys.sim_node.physics.states import WorldEvents
from elys.sim_node.physics.world import PhysicsWorld
from elys.sim_node.scene.edited_values import EditedValues
from elys.sim_node.scene.loading import load_records
from elys.sim_node.scripts.runner import Scripts
from elys.sim_node.state import State
from elys.sim_node.systems.play_animations import Animated, Animations
from elys.sim_node.systems.pull_grabbed import Hands
from elys.sim_node.systems.simulate_physics import MovingBodies, RigidBodies
from elys.sim_node.tick_time import TickTime

_log = logging.getLogger(__name__)


class Simulation:
    """A world at a tick.

    Attributes:
        world: entities and components; change it between ticks.
        physics: its rigid bodies, kept equal to the components by the step.
        tick: steps done since the beginning. tick_time: since when the tick rate is what it is.
        path: the file its scene came from; empty if from none.
        edited: what steps have moved, as it was edited.
        inputs: what players do, by their numbers: `inputs[1].action("jump")`.
        systems: what a step does, in this order.
        stage_times: what each of them took in the last step [ms], the stages of physics as `physics.STAGE` among them.
    """

    def __init__(
        self,
        *,
        name: str = "",
        settings: SceneSettings | None = None,
        assets: AssetStore | None = None,
        threads: int = 1,
    ) -> None:
        self.name = name
        self.settings = settings if settings is not None else SceneSettings()
        self.assets = assets if assets is not None else AssetStore()
        self.world = World()
        self._threads = threads
        self.physics = PhysicsWorld(physics_settings(self.settings, threads))
        self.physics.named = self.named
        self.tick = 0
        self.tick_time = TickTime()
        self.path = ""
        self.edited = EditedValues(self.world)
        self.systems: tuple[System, ...] = (
            self.run_scripts,
            self.follow_changes,
            self.play_animations,
            self.move_characters,
            self.simulate_physics,
            self.aim_cameras,
            self.propagate_transforms,
            self.update_scripts,
        )
        self.stage_times: dict[str, float] = {}
        self.hands = Hands(self.physics)
        self.inputs = Inputs(self.declared_input)
        self._bodies = RigidBodies(self.world, self.physics, self.assets)
        self._animations = Animations(self.world, self.assets)
        self._characters = Characters(self.world, self.physics)
        self._cameras = Cameras(self.world, self.physics)
        self._players = Players(self.world, self.inputs)
        self.scripts = Scripts(self)
        self._changes: list[WorldChanges] = []
        self._events: list[Event] = []
        self._is_stopped = False

    @classmethod
    def load(cls, opened: OpenedScene, assets: AssetStore, *, threads: int = 1) -> Simulation:
        """The simulation of a scene, before its first tick; `threads` work on large steps of physics."""
        simulation = cls(name=opened.name, settings=opened.settings, assets=assets, threads=threads)
        simulation.path = str(opened.path or "")
        load_records(simulation.world, opened.records)
        simulation.settle()
        simulation.take_changes()  # who joins gets a snapshot; nothing has changed since
        return simulation

    @property
    def time(self) -> float:
        """Simulated time since the beginning [s]."""
        return self.time_at(self.tick)

    def time_at(self, tick: int) -> float:
        """The time [s] of a tick of the present tick rate."""
        return self.tick_time.at(tick, self.settings.tick_rate)

    @property
    def is_held(self) -> bool:
        """Whether a script lets time stand in this step, or let it in the last one: nothing moves then."""
        return self.scripts.hold.stands

    def step(self) -> None:
        """One tick: every system in its turn."""
        self.stage_times = {}
        self.edited.capture()
        if self.tick % EVERY == 0:
            sweep_texts(self.world)
        run(self.world, self.systems, self.stage_times)
        self.inputs.end_tick()
        self.tick += 1

    def settle(self) -> None:
        """Makes bodies and world transforms follow what was changed, without letting time go on."""
        self.follow_changes(self.world)

    # Systems

    def run_scripts(self, world: World) -> None:
        """What behaviours do before physics: they hear what happened, go on where they wait, and push."""
        self.scripts.run(world)

    def update_scripts(self, world: World) -> None:
        """What behaviours do when everything has moved."""
        self.scripts.run_late(world)
        self._events += self.scripts.take_events()

    def follow_changes(self, world: World) -> None:
        """Bodies and world transforms become what was changed by hand, by commands or by systems before this one."""
        self._characters.complete()
        changes = world.drain_changes()
        if changes:
            self._changes.append(changes)
            if self._animations.is_needed:  # clips pose what they move at once, before time goes on
                self.edited.capture()
            stopped = [*self._animations.follow(changes), *self._bodies.follow(changes), *self._cameras.stopped()]
            self._tell_where_they_are(stopped)
            self._note_changes()
            self._report_problems()
        self.scripts.pushes.do_waiting()
        world.transforms.propagate()

    def play_animations(self, world: World) -> None:
        """Brings clips to the time of this tick's end, and what they move into the components."""
        if self.is_held:
            return
        self._animations.advance(1.0 / self.settings.tick_rate)
        self.scripts.hear(self._animations.take_events())
        self._drive(self._animations.take_driven())

    def _drive(self, driven: Driven | None) -> None:
        """Bodies that go by root motion get the velocities for it; what falls goes on falling."""
        if driven is None:
            return
        present = np.flatnonzero(np.isin(driven.entity, self.physics.bodies.entity))
        if not len(present):
            return
        entity, linear = driven.entity[present], driven.linear[present]
        table = self.world.table(RigidBody)
        falling = table.column("linear_velocity")[table.rows(entity), 1]
        linear[:, 1] = np.where(driven.rises[present], linear[:, 1], falling)
        self.physics.set_velocities(entity, linear=linear, angular=driven.angular[present])

    def move_characters(self, world: World) -> None:
        """Where characters get to in this tick, if there are any: physics takes them there."""
        if self.is_held:
            return
        if self._players.has_any:
            with told(world, self._changes):
                self._players.steer()
                self._characters.move(1.0 / self.settings.tick_rate)

    def simulate_physics(self, world: World) -> None:
        """Moves the bodies by one tick, and their poses and velocities into the components."""
        if self.is_held:
            return
        seconds: dict[str, float] = {}
        self.hands.pull(1.0 / self.settings.tick_rate)
        self.physics.step(1.0 / self.settings.tick_rate, seconds)
        self.stage_times.update({f"physics.{stage}": 1000.0 * time for stage, time in seconds.items()})
        self._report_problems()
        self._bodies.write_back()
        self._tell_what_broke(world)

    def aim_cameras(self, world: World) -> None:
        """Cameras that follow go to where they belong, if there are any."""
        if self.is_held:
            return
        if self._cameras.is_needed:
            with told(world, self._changes, (CameraRig,)):
                self._cameras.aim(1.0 / self.settings.tick_rate)

    def propagate_transforms(self, world: World) -> None:
        """World transforms from local ones, parents before children, where anything moved."""
        world.transforms.propagate()

    def _tell_where_they_are(self, entities: list[Entity]) -> None:
        """Puts into the changes what physics wrote into components: who follows them has heard of it in frames alone."""
        for entity in entities:
            for component in (Transform, RigidBody):
                value = self.world.try_get(entity, component)
                if value is not None:
                    self.world.set(entity, value)

    def _tell_what_broke(self, world: World) -> None:
        """Joints that broke in the step say so in their components, and are events."""
        broken = self._bodies.joints.take_broken()
        for joint in broken:
            other = world.get(Entity(joint.joint), Joint).other
            values = {"force": joint.force, "torque": joint.torque}
            self._events.append(Event(kind="joint_broken", entity=joint.joint, other=other, values=values))
        if broken:
            self.follow_changes(world)

    def _note_changes(self) -> None:
        """Keeps what physics itself wrote into components for those who follow them."""
        changes = self.world.drain_changes()
        if changes:
            self._changes.append(changes)

    def _report_problems(self) -> None:
        in_step = self.physics.take_problems()
        self._is_stopped |= bool(in_step) and self.physics.settings.on_problem == "pause"
        for problem in self._animations.take_problems():
            _log.error("%s", problem.text)
            self._events.append(Event(kind="animation", entity=problem.entity, values={"text": problem.text}))
        for problem in (*self._bodies.take_problems(), *self._characters.take_problems(), *in_step):
            _log.error("%s", problem.text)
            values = {"text": problem.text, **({"cause": problem.cause} if problem.cause else {})}
            self._events.append(Event(kind="physics", entity=problem.entity, values=values))

    # What others ask

    def declared_input(self) -> Declared:
        """What players can do in the scene as it is now."""
        return declared_in(self.world, self.settings.tick_rate)

    def named(self, entity: int) -> str:
        """How an entity is called in a sentence: by its id and, where it lives and has one, its name."""
        name = self.world.hierarchy.name_of(Entity(entity)) if self.world.is_alive(entity) else ""
        return f"{named(entity)} '{name}'" if name else named(entity)

    def change_settings(self, settings: SceneSettings) -> None:
        """Gravity, substeps and the like, from the next tick on."""
        if settings.tick_rate != self.settings.tick_rate:
            self.tick_time.turn(self.tick, self.settings.tick_rate)
            self.scripts.hold.held.turn(self.scripts.hold.ticks, self.settings.tick_rate)
        self.settings = settings
        self.physics.settings = physics_settings(settings, self._threads)

    def take_physics_back(self, snapshot: dict[str, NDArray[Any]]) -> None:
        """Physics as `physics.snapshot` gave it, when components are what they were then."""
        self.physics.restore(snapshot)
        self._bodies.outdate()

    def moving_bodies(self) -> MovingBodies:
        """Where all bodies that can move are."""
        return self._bodies.moving()

    @property
    def animations(self) -> Animations:
        """Who plays which clips."""
        return self._animations

    def animated(self) -> Animated:
        """What clips move, and the cameras that follow, as it is now."""
        by_clips, cameras = self._animations.animated(), self._cameras.animated()
        if cameras is None:
            return by_clips
        return Animated(*(np.concatenate(both) for both in zip(by_clips, cameras, strict=True)))

    def state_hash(self) -> int:
        """64 bits of where everything that moves by itself is: of the physics, and of what clips move if there is any."""
        of_physics, animated = self.physics.state_hash(), self.animated()
        if not (len(animated.local_entity) or len(animated.weight)):
            return of_physics
        digest = hashlib.blake2b(of_physics.to_bytes(8, "little"), digest_size=8)
        for column in animated:
            digest.update(column.tobytes())
        return int.from_bytes(digest.digest(), "little")

    # Other times

    def capture(self, previous: State | None = None) -> State:
        """All that decides what comes next, as it is between two ticks; what equals that of `previous` is shared with it.

        A system of your own that keeps anything beside components is asked for nothing: keep it in components.
        """
        values = captured(self, previous.values if previous is not None else {})
        return State(tick=self.tick, time=self.time, values=values, is_ours=True)

    def restore(self, state: State) -> None:
        """Goes back to where `capture` was called: the ticks from here give the same bits as they did, on any number of threads.

        Who follows the changes of the scene has to look at all of it anew.

        Raises:
            StateError, PhysicsError: it is no state of this version's simulations. Nothing has changed then.
        """
        restored(self, state.values, is_ours=state.is_ours)
        self.world.outdate()
        self._bodies.outdate()
        self._animations.bind_anew()

    @property
    def events(self) -> WorldEvents:
        """Contacts and visits to triggers that the last tick began or ended, and those that go on."""
        return self.physics.events

    def take_changes(self) -> list[WorldChanges]:
        """What changed in the scene since this was last asked, oldest first."""
        changes, self._changes = self._changes, []
        return changes

    def take_stop(self) -> bool:
        """Whether time shall stop because physics found a problem since this was last asked."""
        is_stopped, self._is_stopped = self._is_stopped, False
        return is_stopped

    def take_events(self) -> list[Event]:
        """What happened since this was last asked, in order."""
        events, self._events = self._events, []
        return events


def physics_settings(settings: SceneSettings, threads: int = 1) -> PhysicsSettings:
    """What the scene's settings mean for physics."""
    return PhysicsSettings(
        gravity=settings.gravity,
        attractors=tuple(Attractor(**msgspec.structs.asdict(attractor)) for attractor in settings.attractors),
        substeps=settings.substeps,
        strengths=settings.strengths,
        on_problem=settings.on_problem,
        threads=threads,
    )

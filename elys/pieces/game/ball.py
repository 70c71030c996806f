"""The ball that a player rolls, and the camera that follows it."""

import math
from typing import Annotated

from elys.script import Behaviour, Entity, Rotation, Vector, about, components

from .race import Race

LOOSE = 8  # bodies in a row that a camera looks through
COYOTE = 0.10  # [s] after it has left the ground in which it may still jump
SLIP = 3.0  # [m/s] by which its skin may be faster than the road
ROLLS_OUT, BRAKES = 0.35, 2.5  # [1/s] of its speed that it loses where nobody pushes it, and behind the finish
BUFFER = 0.12  # [s] before it reaches the ground in which a jump is not lost


class Ball(Behaviour):
    """Rolls where the player pushes it, as seen by the camera; jumps; goes back to the last gate when it has fallen."""

    player: Annotated[int, about("Whose keys and sticks move it.", minimum=1, maximum=16)] = 1
    top_speed: Annotated[float, about("That it can be brought to on level ground.", unit="m/s", minimum=1.0)] = 17.0
    grip: Annotated[float, about("Greatest acceleration on the ground.", unit="m/s^2", minimum=0.1)] = 13.0
    air_grip: Annotated[float, about("Greatest acceleration in the air.", unit="m/s^2", minimum=0.0)] = 5.0
    response: Annotated[float, about("How fast its speed becomes the one wanted.", unit="1/s", minimum=0.1)] = 1.8
    jump_height: Annotated[float, about("How high it jumps.", unit="m", minimum=0.0)] = 1.6
    look_speed: Annotated[float, about("How fast a stick turns the camera.", unit="rad/s", minimum=0.0)] = 2.8
    is_followed: Annotated[bool, about("Whether the camera turns behind it by itself.")] = True

    def start(self):
        body = self.entity.get(components.RigidBody)
        self.mass, self.radius = body.mass, self.entity.get(components.Transform).scale[0] / 2
        forward = self.entity.forward()
        self.heading = math.atan2(-forward.x, -forward.z)  # of the camera; 0 looks along -z
        self.home = self.entity.position, forward
        self.before = self.entity.position
        self.ground_time = self.jump_time = -1.0
        self.ground_normal = Vector(0, 1, 0)
        self.hand_time = -10.0  # when the camera was turned by hand

    @property
    def race(self):
        """The race that it is part of, if there is one."""
        return next(iter(self.world.behaviours(Race)), None)

    def fixed_update(self, dt):
        player, race = self.world.input(self.player), self.race
        is_away = race is not None and race.is_away(self.player)
        self.look(None if is_away else player, dt)
        self.feel_ground()
        if race is not None and not race.is_on:
            self.entity.velocity, self.entity.spin = (0, min(self.entity.velocity.y, 0), 0), (0, 0, 0)
            return
        if is_away:  # others race on, and it rolls by itself
            self.roll(Vector(0, 0, 0))
            return
        if race is not None and self.player in race.times:  # behind the finish the road ends soon
            self.roll(Vector(0, 0, 0), slowing=BRAKES)
            return
        if player.action("jump").was_pressed:
            self.jump_time = self.world.time
        push = self.wanted(player)
        self.roll(push)
        if self.world.time - self.jump_time <= BUFFER and self.world.time - self.ground_time <= COYOTE:
            self.jump()
        if player.action("use").was_pressed:
            self.go_back()
        if player.action("restart").was_pressed:
            self.world.emit("race_wanted", what="restart", player=self.player)

    def update(self, dt):
        race, now = self.race, self.entity.position
        if race is not None:
            race.moved(self.player, self.before, now)
            if now.y < race.lowest_of(self.player, self.home[0]):
                self.go_back()
        self.before = self.entity.position

    def wanted(self, player):
        """Where the player pushes, level, at most 1 long."""
        move = player.vector("move")
        push = Vector(math.cos(self.heading), 0, -math.sin(self.heading)) * move.x
        push += Vector(-math.sin(self.heading), 0, -math.cos(self.heading)) * move.y
        return push / max(push.length, 1.0)

    def roll(self, push, slowing=ROLLS_OUT):
        """Brings its speed towards the one wanted: on the ground by turning it, in the air by a little push."""
        now = self.entity.velocity
        level = Vector(now.x, 0, now.z)
        if push.length < 0.05:
            change = level * -slowing
        else:
            change = (push * self.top_speed - level) * self.response
        on_ground = self.world.time - self.ground_time <= self.world.dt
        most = self.grip if on_ground else self.air_grip
        change = change * min(1.0, most / max(change.length, 1e-9))
        if on_ground:
            axis = self.ground_normal.cross(change).normalized()
            slip = (self.entity.spin - self.ground_normal.cross(level) / self.radius).dot(axis) * self.radius
            if slip < SLIP:  # one that is held fast does not wind itself up
                # A solid ball: torque T at its middle moves it by T / (m r (1 + 2/5)).
                self.entity.apply_torque(axis * (change.length * 1.4 * self.mass * self.radius))
        elif push.length >= 0.05:
            self.entity.apply_force(change * self.mass)

    def jump(self):
        """Straight up, to its height, whatever it did before."""
        speed = math.sqrt(2.0 * self.world.gravity.length * self.jump_height)
        now = self.entity.velocity
        self.entity.apply_impulse((0, (speed - min(now.y, 0.0)) * self.mass, 0))
        self.jump_time = self.ground_time = -1.0
        self.world.emit("ball_jumped", player=self.player)

    def feel_ground(self):
        """Whether there is something to push against below."""
        middle = self.entity.position
        hit = self.world.raycast(middle, (0, -1, 0), self.radius * 1.5 + 0.15, exclude=[self.entity.id])
        if hit is None or hit.normal.y < 0.4:
            return
        # Of the slope below, the distance of the ball's skin is what counts.
        if hit.distance * hit.normal.y <= self.radius + 0.08:
            self.ground_time, self.ground_normal = self.world.time, hit.normal

    def go_back(self):
        """To the last gate, at rest."""
        race = self.race
        place, forward = race.rest_of(self.player, self.home) if race is not None else self.home
        self.entity.position = place
        self.entity.velocity, self.entity.spin = (0, 0, 0), (0, 0, 0)
        self.heading = math.atan2(-forward.x, -forward.z)
        self.before = place
        self.world.emit("ball_fell", player=self.player)

    def look(self, player, dt):
        """Turns the camera: by hand, or behind the way that the ball goes."""
        by_hand = player.vector("look").x * self.look_speed * dt if player is not None else 0.0
        if by_hand:
            self.heading -= by_hand
            self.hand_time = self.world.time
        now = self.entity.velocity
        speed = math.hypot(now.x, now.z)
        if self.is_followed and speed > 2.0 and self.world.time - self.hand_time > 1.0:
            off = math.remainder(math.atan2(-now.x, -now.z) - self.heading, math.tau)
            if abs(off) < 2.4:  # who rolls backwards looks where he looks
                self.heading += off * min(1.0, 1.6 * dt * min(speed / 8.0, 1.0))


class ChaseCamera(Behaviour):
    """Looks over a ball's shoulder."""

    ball: Entity | None = None
    distance: Annotated[float, about("Behind the ball.", unit="m", minimum=1.0)] = 6.5
    height: Annotated[float, about("Above it.", unit="m", minimum=0.0)] = 2.9

    def start(self):
        self.middle = None

    def update(self, dt):  # where the ball is after the step, also in the tick in which it went back to a gate
        if self.ball is None or not self.ball.is_alive:
            return
        ball = self.ball.script(Ball)
        now = self.ball.position
        if self.middle is None or self.middle.distance(now) > 8.0:
            self.middle = now
        # Follows at once along the ground and softly upwards, so that small bumps do not shake the picture.
        self.middle = Vector(now.x, self.middle.y + (now.y - self.middle.y) * min(1.0, 9.0 * dt), now.z)
        back = Vector(math.sin(ball.heading), 0, math.cos(ball.heading))
        eye = back * self.distance + (0, self.height, 0)
        look_at = self.middle + Vector(0, 0.7, 0)
        reach = eye.length
        free = self.free_way(self.ball, look_at, eye.normalized(), reach)
        eye = look_at + eye.normalized() * (reach if free == reach else max(free - 0.3, 0.6))
        down = math.atan2(eye.y - look_at.y, math.hypot(eye.x - look_at.x, eye.z - look_at.z))
        turn = Rotation.about((0, 1, 0), ball.heading) * Rotation.about((1, 0, 0), -down)
        self.entity.set(components.Transform, position=tuple(eye), rotation=tuple(turn))

    def free_way(self, ball, start, direction, reach):
        """How far [m] nothing stands in the way but what is loose: bricks that fly about would have it leap to and fro."""
        passed = [ball.id]
        for _ in range(LOOSE):
            hit = self.world.raycast(start, direction, reach, exclude=passed)
            if hit is None:
                return reach
            body = hit.entity.get(components.RigidBody) if hit.entity.has(components.RigidBody) else None
            if body is None or body.motion != "dynamic":
                return hit.distance
            passed.append(hit.entity.id)
        return reach

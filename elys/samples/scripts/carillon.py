"""Balls fall on bars that ring; a board over the picture shows which one did."""

from __future__ import annotations

from typing import Annotated

from elys.script import Behaviour, Vec3, about, components

LONGEST = 40  # balls that lie about before the first ones are taken away
COLORS: tuple[Vec3, ...] = ((0.8, 0.25, 0.2), (0.85, 0.6, 0.15), (0.25, 0.55, 0.75), (0.4, 0.65, 0.3))
FADE = 1.2  # [s] until a row of the board is as it was


class Bar(Behaviour):
    """Rings when it is struck."""

    pitch: Annotated[float, about("Of its tone, against the lowest.", minimum=0.1, maximum=8.0)] = 1.0
    number: Annotated[int, about("Its place, from 0.")] = 0

    def on_contact(self, other, touch):
        if touch.speed < 1.0:
            return
        volume = min(touch.speed / 9.0, 1.0)
        self.entity.play_sound("chime", volume=volume, pitch=self.pitch, reference_distance=8.0)
        self.world.emit("struck", number=self.number)


class Carillon(Behaviour):
    """Drops balls over the bars, and keeps the board."""

    pause: Annotated[float, about("Between two balls.", unit="s", minimum=0.1)] = 0.6

    def start(self):
        self.balls = []
        self.struck = 0
        self.rows = [child for child in self.world.find("Board").children if child.name.startswith("Row")]
        self.glow = [0.0] * len(self.rows)
        self.next = 0.5

    def on_event(self, event):
        if event.kind != "struck":
            return
        number = event.values["number"]
        self.struck += 1
        self.glow[number] = 1.0
        self.world.find("Count").set(components.OverlayText, value=float(self.struck))
        bar = self.world.find(f"Bar {number + 1}")
        self.world.find("Label").set(components.Overlay, visible=True, follow=int(bar.id))

    def fixed_update(self, dt):
        self.next -= dt
        if self.next <= 0.0:
            self.next += self.pause
            self.drop()
            self.entity.play_sound("whoosh", volume=0.25, pitch=1.6, spatial=False)
        for number, row in enumerate(self.rows):
            if self.glow[number] > 0.0:
                self.glow[number] = max(self.glow[number] - dt / FADE, 0.0)
                row.set(components.OverlayPanel, opacity=0.9 * self.glow[number])
        self.world.find("Clock").set(components.OverlayText, value=self.world.time)
        self.world.find("Wait").set(components.OverlayBar, value=1.0 - min(max(self.next / self.pause, 0.0), 1.0))

    def drop(self):
        place = (self.random.uniform(-4.4, 4.4), 6.5, self.random.uniform(-0.6, 0.2))
        color = COLORS[len(self.balls) % len(COLORS)]
        self.balls.append(
            self.world.spawn(
                components.RigidBody(),
                components.Collider(shape="sphere", radius=0.22, restitution=0.75, rolling_friction=0.01),
                components.MeshRenderer(mesh="sphere"),
                components.Material(base_color=color, roughness=0.35),
                components.Transform(position=place, scale=(0.44, 0.44, 0.44)),
                name="Ball",
            )
        )
        if len(self.balls) > LONGEST:
            self.balls.pop(0).destroy()

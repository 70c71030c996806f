"""What stands on a player's picture: the clock, the gates, the speed, and what has just happened."""

import math
from typing import Annotated

from elys.script import Behaviour, about, components

from .ball import Ball
from .race import Race

SHOWN = 2.2  # [s] that a message stays
LARGE, SMALL = 0.12, 0.065  # letters, in heights of the picture: what is said on the way does not hide it
MEDALS = {"gold": (0.9, 0.62, 0.1), "silver": (0.62, 0.66, 0.7), "bronze": (0.55, 0.26, 0.1), "": (0.9, 0.9, 0.9)}
FASTER, SLOWER, PLAIN = (0.1, 0.7, 0.2), (0.85, 0.16, 0.08), (0.95, 0.95, 0.95)


class Hud(Behaviour):
    """Writes the overlays below its entity."""

    player: Annotated[int, about("Whose they are.", minimum=1, maximum=16)] = 1
    best: Annotated[str, about("Times at the gates of the run to be beaten, with commas between [s].")] = ""

    def start(self):
        self.message_until = -1.0
        self.is_finished = False
        self.counted = 0
        self.to_beat = [float(part) for part in self.best.split(",") if part]

    def update(self, dt):
        race = next(iter(self.world.behaviours(Race)), None)
        ball = next((ball for ball in self.world.behaviours(Ball) if ball.player == self.player), None)
        if race is None or ball is None or not race.is_begun:
            return
        time = race.times.get(self.player, max(race.clock, 0.0))
        self.write("Clock", value=time)
        velocity = ball.entity.velocity
        self.write("Speed", value=math.hypot(velocity.x, velocity.z) * 3.6)
        self.write("Gates", text=f"{race.passed.get(self.player, 0)} / {len(race.gates)}")
        self.count_down(race)
        if 0.0 <= self.message_until <= self.world.time:
            self.message_until = -1.0
            self.write("Message", text="")

    def count_down(self, race):
        left = math.ceil(-race.clock / 0.5)
        if race.clock < 0.0 and left != self.counted:
            self.counted = left
            self.say(str(left) if left < 4 else "", PLAIN, 0.5)
            if left < 4:
                self.world.play_sound("click", pitch=1.0)

    def on_event(self, event):
        if event.kind == "race_go":
            self.say("Go!", FASTER, 1.0)
            self.world.play_sound("click", pitch=2.0)
        if event.values.get("player") != self.player:
            return
        if event.kind == "race_gate":
            self.say_split(event.values["number"], event.values["time"])
            self.world.play_sound("chime", volume=0.7)
        elif event.kind == "race_finished":
            self.is_finished = True
            medal = event.values["medal"]
            self.say(f"{clock_text(event.values['time'])}  {medal or 'no medal'}", MEDALS[medal], 60.0)
            self.world.play_sound("chime", pitch=0.5)
        elif event.kind == "ball_fell" and not self.is_finished:
            self.say("Fallen", SLOWER, SHOWN)
            self.world.play_sound("hit", volume=0.6)

    def say_split(self, number, time):
        """How the time at a gate compares with that of the run to be beaten."""
        if number > len(self.to_beat):
            self.say(clock_text(time), PLAIN, SHOWN, size=SMALL)
            return
        behind = round(time - self.to_beat[number - 1], 2)
        color = SLOWER if behind > 0.0 else FASTER if behind < 0.0 else PLAIN
        self.say(f"{behind:+.2f}" if behind else "0.00", color, SHOWN, size=SMALL)

    def say(self, text, color, seconds, size=LARGE):
        self.write("Message", text=text, color=color, size=size)
        self.message_until = self.world.time + seconds

    def write(self, name, **values):
        self.entity.child(name).set(components.OverlayText, **values)


def clock_text(time):
    """A time as clocks show it, 1:02.46."""
    minutes, seconds = divmod(round(time * 100) / 100, 60)
    return f"{int(minutes)}:{seconds:05.2f}"

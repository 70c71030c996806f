"""A race against the clock: gates in their order, a countdown before them, a time and a medal at their end."""

from typing import Annotated

from elys.script import Behaviour, about

from .menu import Menu


class Gate(Behaviour):
    """One gate: whoever's middle goes through its opening, the right way round, has passed it."""

    number: Annotated[int, about("Its place in the order, from 1; the highest is the finish.", minimum=1)] = 1
    width: Annotated[float, about("Of the opening.", unit="m", minimum=0.1)] = 6.0
    height: Annotated[float, about("Of the opening, from the gate's place up.", unit="m", minimum=0.1)] = 4.0

    def share_of(self, before, after):
        """How much of a way lies before the gate, from 0 to 1; None if the way does not lead through it."""
        turn_back = self.entity.rotation.inverse
        a, b = turn_back * (before - self.entity.position), turn_back * (after - self.entity.position)
        if not a.z > 0.0 >= b.z:
            return None
        share = a.z / (a.z - b.z)
        place = a.lerp(b, share)
        return share if abs(place.x) <= self.width / 2 and -1.0 <= place.y <= self.height else None

    def light(self, color):
        """Shows who passes here whether it is the next."""
        for child in self.entity.children:
            if child.has("Material"):
                child.set("Material", emissive=color)


AHEAD, NEXT, PASSED = (0.02, 0.05, 0.12), (0.2, 1.6, 3.2), (0.05, 0.6, 0.12)


class Race(Behaviour):
    """Counts down, measures, and says how it went. Events: race_go, race_gate, race_finished; race_wanted,
    race_paused, race_resumed.
    """

    gold: Annotated[float, about("Time for a gold medal.", unit="s", minimum=0.0)] = 30.0
    silver: Annotated[float, about("Time for a silver medal.", unit="s", minimum=0.0)] = 40.0
    bronze: Annotated[float, about("Time for a bronze medal.", unit="s", minimum=0.0)] = 60.0
    countdown: Annotated[float, about("Before it begins.", unit="s", minimum=0.0)] = 1.5
    fall: Annotated[float, about("How far below the last gate a ball has fallen.", unit="m", minimum=1.0)] = 12.0

    def start(self):
        self.gates = sorted(self.world.behaviours(Gate), key=lambda gate: gate.number)
        self.began = None  # the tick at which the countdown begins
        self.passed = {}  # gates by player
        self.times = {}  # [s] at the finish, by player
        self.splits = {}  # [s] at each gate, by player
        self.light()

    def fixed_update(self, dt):
        # What is opened in the middle of a race does not keep others from racing: with one player time itself stands.
        if self.began is None and not any(menu.is_open and not menu.in_race for menu in self.world.behaviours(Menu)):
            self.began = self.world.tick

    @property
    def is_begun(self):
        """Whether the countdown has begun."""
        return self.began is not None

    @property
    def is_on(self):
        """Whether the countdown is over."""
        return self.clock >= 0.0

    def is_away(self, player):
        """Whether a player's hands are at the menu."""
        return any(menu.is_open and menu.player == player for menu in self.world.behaviours(Menu))

    @property
    def clock(self):
        """Time [s] since it began; below 0 in the countdown, and before it."""
        if self.began is None:
            return -self.countdown
        return (self.world.tick - self.began) * self.world.dt - self.countdown

    def update(self, dt):
        if self.is_begun and -dt / 2 <= self.clock < dt / 2:
            self.world.emit("race_go")

    def moved(self, player, before, after):
        """A player's ball went from one place to another in this tick."""
        number = self.passed.get(player, 0)
        if number >= len(self.gates) or not self.is_on:
            return
        share = self.gates[number].share_of(before, after)
        if share is None:
            return
        # Where the tick ended is half the truth: what lies behind the gate is not part of the time to it.
        time = self.clock + share * self.world.dt
        self.passed[player] = number + 1
        self.splits.setdefault(player, []).append(time)
        self.world.emit("race_gate", player=player, number=number + 1, time=time)
        if number + 1 == len(self.gates):
            self.times[player] = time
            self.world.emit("race_finished", player=player, time=time, medal=self.medal(time))
        self.light()

    def medal(self, time):
        """What a time is worth; "" if nothing."""
        medals = (("gold", self.gold), ("silver", self.silver), ("bronze", self.bronze))
        return next((name for name, most in medals if time <= most), "")

    def rest_of(self, player, home):
        """Where a fallen ball goes on: at the gate that it passed last, or at home; and which way it looks there."""
        number = self.passed.get(player, 0)
        if number:
            gate = self.gates[number - 1].entity
            return gate.position + gate.rotation * (0.0, 0.8, 0.0), gate.forward()
        return home

    def lowest_of(self, player, home):
        """How high [m] a ball must at least be not to have fallen."""
        number = self.passed.get(player, 0)
        nearest = [gate.entity.position.y for gate in self.gates[max(number - 1, 0) : number + 1]]
        return min([home.y, *nearest] if number == 0 else nearest) - self.fall

    def light(self):
        """The gates show what the one who is behind most has still to do."""
        players = max((menu.players for menu in self.world.behaviours(Menu)), default=1)
        least = min(self.passed.get(player, 0) for player in range(1, players + 1))
        for place, gate in enumerate(self.gates):
            gate.light(PASSED if place < least else NEXT if place == least else AHEAD)

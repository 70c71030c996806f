"""The menu: which level to race on, and how. Before a race it is there for all; in a race for the one who asks for it.

With one player time stands while it is open, and goes on as it was; with several it is a matter of that player's picture alone,
whose ball rolls on by itself.
"""

from typing import Annotated, Any

from elys.script import Behaviour, Entity, about, components

ROW, SMALL_ROW, GAP = 0.075, 0.058, 0.03  # heights of the picture
HEAD, FOOT = 0.18, 0.11  # above the rows, and below
RESULT = 0.055  # more above them, for how the race before ended
PLAIN, CHOSEN, NEWS = (0.75, 0.77, 0.8), (1.0, 0.8, 0.25), (0.45, 0.75, 1.0)
IN_RACE = (("go_on", "Go on"), ("restart", "Restart"))


class Menu(Behaviour):
    """Rows below a panel: levels, settings, controls. `move` chooses and changes, `confirm` goes, `pause` opens and closes."""

    is_open: Annotated[bool, about("Whether it is open at first.")] = False
    levels: Annotated[str, about("A line for each level: name|title|best time|medal.")] = ""
    level: Annotated[str, about("The name of this one.")] = ""
    settings: Annotated[str, about("A line for each setting: name|title|choice|choices, with commas.")] = ""
    result: Annotated[str, about("How the race before ended.")] = ""
    players: Annotated[int, about("How many race.", minimum=1, maximum=16)] = 1

    def start(self):
        self.entries = [tuple((line + "|||").split("|")[:4]) for line in self.levels.splitlines() if line]
        self.choices = [tuple((line + "|||").split("|")[:4]) for line in self.settings.splitlines() if line]
        self.values = {name: now for name, _, now, _ in self.choices}
        self.player = 1  # whose hands it is in
        self.in_race = False  # opened in the middle of one
        self.held_before = 0.0  # [s]
        self.leaned: tuple[int, ...] = (0, 0)
        self.build()
        self.show()

    def build(self):
        """Its rows anew: what can be done in a race, the levels, the settings."""
        for row in self.entity.child("Rows").children:
            row.destroy()
        self.rows: list[Entity] = []
        self.does: list[tuple[str, Any]] = []  # what each row is for, and which
        y = 0.0
        if self.result and not self.in_race:
            text = components.OverlayText(text=self.result, size=0.038, color=NEWS)
            self.world.spawn(components.Overlay(anchor="top", y=-0.01), text, parent=self.entity.child("Rows"))
            y = RESULT
        if self.in_race:
            for what, title in IN_RACE:
                y = self.row(y, SMALL_ROW, title, "", (what, ""))
            y += GAP
        height = SMALL_ROW if self.in_race else ROW
        for name, title, best, medal in self.entries:
            y = self.row(y, height, title, f"{best}  {medal}".strip() if best else "-", ("level", name))
        y += GAP
        for number, (name, title, _, _) in enumerate(self.choices):
            y = self.row(y, SMALL_ROW, title, self.values[name], ("setting", number))
        y = self.row(y, SMALL_ROW, "Controls", "keys, gamepad", ("controls", ""))
        self.entity.set(components.Overlay, height=max(HEAD + y + FOOT, 0.5))
        self.chosen = (
            0
            if self.in_race
            else next((place for place, does in enumerate(self.does) if does == ("level", self.level)), 0)
        )

    def row(self, y, height, title, value, does):
        """A row: what it is on the left, how it is on the right. Where the next one begins."""
        row = self.world.spawn(
            components.Overlay(anchor="top", y=y, width=0.86, height=height * 0.9),
            components.OverlayPanel(color=(0.1, 0.12, 0.16), opacity=0.0, radius=0.01),
            name=f"Row {len(self.rows) + 1}",
            parent=self.entity.child("Rows"),
        )
        left, right = components.Overlay(anchor="left", x=0.03), components.Overlay(anchor="right", x=-0.03)
        for place, text in ((left, title), (right, value)):
            self.world.spawn(place, components.OverlayText(text=text, size=height * 0.56, color=PLAIN), parent=row)
        self.rows.append(row)
        self.does.append(does)
        return y + height

    def fixed_update(self, dt):
        if self.is_open:
            self.use()
            return
        for number in range(1, self.players + 1):
            if self.world.input(number).action("pause").was_pressed:
                self.open(number)
                return

    def open(self, player):
        """In the middle of a race: time stands, where nobody else races."""
        self.is_open, self.in_race, self.player = True, True, player
        self.leaned = self.lean()  # who drives has not chosen anything yet
        self.entity.set(components.Overlay, player=player if self.players > 1 else 0)
        self.build()
        self.show()
        if self.players == 1:
            self.held_before = self.world.held_time
            self.world.hold(self)
            self.world.emit("race_paused", player=player)

    def go_on(self):
        """Back into the race, as it was left."""
        self.is_open = False
        self.show()
        if self.world.is_held:
            self.world.let_go()
            self.world.emit("race_resumed", player=self.player, held=self.world.held_time - self.held_before)

    def lean(self):
        """Which way the one who has it leans: aside and down."""
        move = self.world.input(self.player).vector("move")
        return tuple((value > 0.5) - (value < -0.5) for value in (move.x, -move.y))

    def use(self):
        player = self.world.input(self.player)
        if player.action("pause").was_pressed:
            if self.in_race:
                self.go_on()
            else:
                self.is_open = False
                self.show()
                self.want(what="restart")
            return
        if not self.rows:
            return
        leaned = self.lean()
        aside, down = (now if now != before else 0 for now, before in zip(leaned, self.leaned, strict=True))
        self.leaned = leaned
        if down:
            self.chosen = (self.chosen + down) % len(self.rows)
            self.world.play_sound("click", volume=0.5)
            self.show()
        what, which = self.does[self.chosen]
        has_confirmed = player.action("confirm").was_pressed
        if what == "setting" and (aside or has_confirmed):
            self.change(which, aside or 1)
        elif what != "setting" and has_confirmed:
            self.world.play_sound("click", pitch=1.5)
            if what == "go_on":
                self.go_on()
            elif what == "restart":
                self.want(what="restart")
            elif what == "controls":  # they are chosen at the player's own machine: its window shows a card
                self.world.emit("controls_wanted", player=self.player)
            else:
                self.want(what="level", name=which)

    def want(self, **values):
        """Tells the one who puts races in place."""
        self.world.emit("race_wanted", player=self.player, **values)

    def change(self, setting, step):
        """The next choice of a setting, or the one before."""
        name, _, _, choices = self.choices[setting]
        every = choices.split(",")
        now = self.values[name]
        self.values[name] = every[(every.index(now) + step) % len(every)] if now in every else every[0]
        _, shown = self.rows[self.chosen].children
        shown.set(components.OverlayText, text=self.values[name])
        self.world.play_sound("click", volume=0.5, pitch=1.2)
        self.want(what="setting", name=name, value=self.values[name])

    def show(self):
        self.entity.set(components.Overlay, visible=self.is_open)
        for number, row in enumerate(self.rows):
            is_chosen = number == self.chosen
            row.set(components.OverlayPanel, opacity=0.9 if is_chosen else 0.0)
            for part in row.children:
                part.set(components.OverlayText, color=CHOSEN if is_chosen else PLAIN)

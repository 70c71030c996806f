"""The menu: which level to race on, and how. While it is open nobody races; whoever opens it has left the race."""

from typing import Annotated

from elys.script import Behaviour, about, components

ROW, SMALL_ROW, GAP = 0.075, 0.058, 0.03  # heights of the picture
PLAIN, CHOSEN = (0.75, 0.77, 0.8), (1.0, 0.8, 0.25)


class Menu(Behaviour):
    """Rows below a panel: levels, then settings. `move` chooses and changes, `confirm` goes, `pause` opens and closes."""

    is_open: Annotated[bool, about("Whether it is open at first.")] = False
    levels: Annotated[str, about("A line for each level: name|title|best time|medal.")] = ""
    level: Annotated[str, about("The name of this one.")] = ""
    settings: Annotated[str, about("A line for each setting: name|title|choice|choices, with commas.")] = ""

    def start(self):
        self.entries = [tuple((line + "|||").split("|")[:4]) for line in self.levels.splitlines() if line]
        self.choices = [tuple((line + "|||").split("|")[:4]) for line in self.settings.splitlines() if line]
        self.values = {name: now for name, _, now, _ in self.choices}
        names = [entry[0] for entry in self.entries]
        self.chosen = names.index(self.level) if self.level in names else 0
        self.leaned: tuple[int, ...] = (0, 0)
        self.rows = [
            self.row(number, number * ROW, ROW, title, f"{best}  {medal}".strip() if best else "-")
            for number, (_, title, best, medal) in enumerate(self.entries)
        ]
        below = len(self.entries) * ROW + GAP
        for number, (_, title, now, _) in enumerate(self.choices):
            place = len(self.entries) + number
            self.rows.append(self.row(place, below + number * SMALL_ROW, SMALL_ROW, title, now))
        self.show()

    def row(self, number, y, height, title, value):
        """A row: what it is on the left, how it is on the right."""
        row = self.world.spawn(
            components.Overlay(anchor="top", y=y, width=0.86, height=height * 0.9),
            components.OverlayPanel(color=(0.1, 0.12, 0.16), opacity=0.0, radius=0.01),
            name=f"Row {number + 1}",
            parent=self.entity.child("Rows"),
        )
        left, right = components.Overlay(anchor="left", x=0.03), components.Overlay(anchor="right", x=-0.03)
        for place, text in ((left, title), (right, value)):
            self.world.spawn(place, components.OverlayText(text=text, size=height * 0.56, color=PLAIN), parent=row)
        return row

    def fixed_update(self, dt):
        player = self.world.input(1)
        if player.action("pause").was_pressed:
            self.is_open = not self.is_open
            self.show()
            if not self.is_open:
                self.world.emit("race_wanted", what="restart", player=1)
        if not self.is_open or not self.rows:
            return
        move = player.vector("move")
        leaned = tuple((value > 0.5) - (value < -0.5) for value in (move.x, -move.y))
        aside, down = (now if now != before else 0 for now, before in zip(leaned, self.leaned, strict=True))
        self.leaned = leaned
        if down:
            self.chosen = (self.chosen + down) % len(self.rows)
            self.world.play_sound("click", volume=0.5)
            self.show()
        setting = self.chosen - len(self.entries)
        has_confirmed = player.action("confirm").was_pressed
        if setting >= 0 and (aside or has_confirmed):
            self.change(setting, aside or 1)
        elif setting < 0 and has_confirmed:
            self.world.play_sound("click", pitch=1.5)
            self.world.emit("race_wanted", what="level", name=self.entries[self.chosen][0], player=1)

    def change(self, setting, step):
        """The next choice of a setting, or the one before."""
        name, _, _, choices = self.choices[setting]
        every = choices.split(",")
        now = self.values[name]
        self.values[name] = every[(every.index(now) + step) % len(every)] if now in every else every[0]
        _, shown = self.rows[self.chosen].children
        shown.set(components.OverlayText, text=self.values[name])
        self.world.play_sound("click", volume=0.5, pitch=1.2)
        self.world.emit("race_wanted", what="setting", name=name, value=self.values[name], player=1)

    def show(self):
        self.entity.set(components.Overlay, visible=self.is_open)
        for number, row in enumerate(self.rows):
            is_chosen = number == self.chosen
            row.set(components.OverlayPanel, opacity=0.9 if is_chosen else 0.0)
            for part in row.children:
                part.set(components.OverlayText, color=CHOSEN if is_chosen else PLAIN)

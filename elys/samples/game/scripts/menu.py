"""The menu: which level to race on. While it is open nobody races; whoever opens it has left the race."""

from typing import Annotated

from elys.script import Behaviour, about, components

ROW = 0.075  # heights of the picture
PLAIN, CHOSEN = (0.75, 0.77, 0.8), (1.0, 0.8, 0.25)


class Menu(Behaviour):
    """Rows below a panel: the levels. Chosen with `move` and `confirm`, opened and closed with `pause`."""

    is_open: Annotated[bool, about("Whether it is open at first.")] = False
    levels: Annotated[str, about("A line for each level: name|title|best time|medal.")] = ""
    level: Annotated[str, about("The name of this one.")] = ""

    def start(self):
        self.entries = [tuple((line + "|||").split("|")[:4]) for line in self.levels.splitlines() if line]
        names = [entry[0] for entry in self.entries]
        self.chosen = names.index(self.level) if self.level in names else 0
        self.leaned = 0
        self.rows = [self.row(number, entry) for number, entry in enumerate(self.entries)]
        self.show()

    def row(self, number, entry):
        """The row of a level: its title on the left, the best time on the right."""
        panel = self.entity.child("Rows")
        row = self.world.spawn(
            components.Overlay(anchor="top", y=number * ROW, width=0.86, height=ROW * 0.9),
            components.OverlayPanel(color=(0.1, 0.12, 0.16), opacity=0.0, radius=0.01),
            name=f"Row {number + 1}",
            parent=panel,
        )
        best = f"{entry[2]}  {entry[3]}".strip() if entry[2] else "-"
        left, right = components.Overlay(anchor="left", x=0.03), components.Overlay(anchor="right", x=-0.03)
        for place, text in ((left, entry[1]), (right, best)):
            self.world.spawn(place, components.OverlayText(text=text, size=0.042, color=PLAIN), parent=row)
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
        lean = player.vector("move").y
        step = -1 if lean > 0.5 else 1 if lean < -0.5 else 0
        if step and step != self.leaned:
            self.chosen = (self.chosen + step) % len(self.rows)
            self.world.play_sound("click", volume=0.5)
            self.show()
        self.leaned = step
        if player.action("confirm").was_pressed:
            self.world.play_sound("click", pitch=1.5)
            self.world.emit("race_wanted", what="level", name=self.entries[self.chosen][0], player=1)

    def show(self):
        self.entity.set(components.Overlay, visible=self.is_open)
        for number, row in enumerate(self.rows):
            is_chosen = number == self.chosen
            row.set(components.OverlayPanel, opacity=0.9 if is_chosen else 0.0)
            for part in row.children:
                part.set(components.OverlayText, color=CHOSEN if is_chosen else PLAIN)

"""Which lines of the console are seen: as a plain search over all of them says, however they came."""

from __future__ import annotations

import random
import re

import pytest

from elys.common.scene import EntityRecord
from elys.editor_node import console_log
from elys.editor_node.console_log import LEVELS, ConsoleLog, ConsoleView, Filter, text_of
from elys.editor_node.entity_mentions import EntityMentions

WORDS = ("late", "drawing", "Été", "joint broke", "TICK 7", "tick 12")


def fill(log: ConsoleLog, rng: random.Random, count: int) -> None:
    for number in range(count):
        log.add(
            rng.choice(("simulation", "render", "editor")), rng.choice(LEVELS), rng.choice(WORDS), tick=number, at=1.0
        )


@pytest.mark.parametrize(
    ("wanted", "plain"),
    [
        (Filter(), lambda line: True),
        (Filter(levels=frozenset({"error"})), lambda line: line.level == "error"),
        (Filter(hidden_nodes=frozenset({"render"})), lambda line: line.node != "render"),
        (Filter(text="ÉTÉ"), lambda line: "Été" in line.text),
        (Filter(text="SIMUL"), lambda line: line.node == "simulation"),
        (Filter(text=r"tick \d\d", is_regex=True), lambda line: re.search(r"tick \d\d", line.text)),
        (Filter(text="^rend", is_regex=True), lambda line: line.node == "render"),
    ],
)
def test_a_view_that_grows_with_its_log_is_what_a_plain_search_finds(wanted, plain, monkeypatch):
    monkeypatch.setattr(console_log, "LINE_LIMIT", 500)
    log, rng = ConsoleLog(), random.Random(5)
    view, merged = ConsoleView(log), ConsoleView(log)
    for _ in range(40):
        fill(log, rng, rng.randrange(200))
        expected = [line for line in log if plain(line)]
        assert [row.line for row in view.rows(wanted)] == expected
        counts: dict[tuple[str, str, str], int] = {}
        for line in expected:
            key = (line.node, line.level, line.text)
            counts[key] = counts.get(key, 0) + line.count
        rows = merged.rows(wanted, merges=True)
        assert {(row.line.node, row.line.level, row.line.text): row.count for row in rows} == counts
        assert len(rows) == len(counts)
        for level in LEVELS:
            assert log.counts[level] == sum(line.count for line in log if line.level == level)
        for node in ("simulation", "render", "editor"):
            assert log.nodes.get(node, 0) == sum(line.count for line in log if line.node == node)
    assert len(log) <= 500
    log.clear()
    assert view.rows(wanted) == []
    assert not log.nodes


def test_a_line_that_repeats_while_it_is_shown_counts_on():
    log = ConsoleLog()
    view, merged = ConsoleView(log), ConsoleView(log)
    for text in ("late", "late", "on time", "late"):
        log.add("simulation", "warning", text)
        view.rows(Filter())
        merged.rows(Filter(), merges=True)
    log.add("simulation", "warning", "late")
    assert [(row.line.text, row.count) for row in view.rows(Filter())] == [("late", 2), ("on time", 1), ("late", 2)]
    assert [(row.line.text, row.count) for row in merged.rows(Filter(), merges=True)] == [("late", 4), ("on time", 1)]


def test_a_pattern_that_cannot_be_read_hides_nothing_and_says_why():
    log = ConsoleLog()
    log.add("editor", "info", "a (b")
    view = ConsoleView(log)
    assert len(view.rows(Filter(text="(b", is_regex=True))) == 1
    assert "unterminated" in view.error
    assert len(view.rows(Filter(text="(b"))) == 1
    assert view.error == ""


def test_a_hundred_thousand_lines_are_looked_at_once():
    log = ConsoleLog()
    for number in range(100_000):
        log.add("simulation", "info", f"line {number}")
    view, looked = ConsoleView(log), []
    assert len(view.rows(Filter())) == 100_000
    fits = view._fits
    view._fits = lambda line: looked.append(line) or fits(line)
    log.add("simulation", "info", "another")
    assert len(log) == 90_001  # the oldest are dropped together
    view.rows(Filter())
    view._fits = lambda line: looked.append(line) or fits(line)
    for number in range(10):
        log.add("simulation", "info", f"new {number}")
        assert view.rows(Filter())[-1].line.text == f"new {number}"
    assert len(looked) == 10


def test_copied_lines_hold_everything():
    log = ConsoleLog()
    log.add("render", "error", "lost\nfor good", tick=7)
    log.add("render", "error", "lost\nfor good", tick=8)
    (text,) = [text_of(ConsoleView(log).rows(Filter()))]
    stamp, tick, node, level, line = text.split("\t")
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d", stamp)
    assert (tick, node, level, line) == ("8", "render", "error", "lost\nfor good (2x)")


def test_entities_are_found_by_id_in_quotes_and_by_name(on_stage):
    async def scenario(stage):
        mentions = EntityMentions(stage.model.scene)
        crate, box, upper = stage.named("Crate"), stage.named("Box 3"), stage.named("Box 3 upper lid")
        for text, expected in (
            (f"entity {crate} 'Box 3' left", crate),
            (f"#{box}: gone", box),
            ("the joint of 'Box 3' broke", box),
            ("the joint of “Box 3” broke", box),
            ("Box 3 fell, and so did Crate", box),
            ("Box 3 upper lid fell", upper),
            ("Duplicate Crate.", crate),
            ("entity 4000 left, Crate stays", crate),
            ("craters are no crates", 0),
            ("entity 'Nobody' left", 0),
            ("", 0),
        ):
            assert mentions.find(text) == expected, text
        stage.model.edit.rename(box, "Kiste")
        await stage.settle()
        assert mentions.find("Kiste") == box
        assert mentions.find("Box 3 fell") == 0

    records = [EntityRecord(name=name, components={"Transform": {}}) for name in ("Crate", "Box 3", "Box 3 upper lid")]
    on_stage(scenario, records)

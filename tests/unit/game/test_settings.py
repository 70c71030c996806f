"""What is chosen in the menu is kept; what is none changes nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from elys.game.settings import CHOICES, Settings, lines


def test_choices_are_kept_for_the_next_time(tmp_path: Path) -> None:
    assert Settings.load(tmp_path) == Settings()
    chosen = Settings().changed("ghosts", "off").changed("look", "fast").changed("camera", "off")
    chosen.save(tmp_path)
    assert Settings.load(tmp_path) == chosen
    assert chosen.of_ball()["is_followed"] is False
    assert chosen.of_ball()["look_speed"] > Settings().of_ball()["look_speed"]


@pytest.mark.parametrize(("name", "value"), [("ghosts", "perhaps"), ("look", ""), ("players", "3"), ("sound", "on")])
def test_what_is_no_choice_changes_nothing(name: str, value: str) -> None:
    assert Settings().changed(name, value) == Settings()


@pytest.mark.parametrize("text", ["", "{", '{"ghosts": "maybe"}', "[1]", "\x00"])
def test_settings_that_cannot_be_read_are_said_and_left_aside(tmp_path: Path, text: str, caplog) -> None:
    (tmp_path / "settings.json").write_text(text)
    assert Settings.load(tmp_path) == Settings()
    assert "cannot be read" in caplog.text


def test_a_folder_that_takes_nothing_is_said(tmp_path: Path, caplog) -> None:
    (tmp_path / "file").write_text("")
    Settings(look="slow").save(tmp_path / "file" / "folder")
    assert "cannot be kept" in caplog.text


def test_the_menu_is_told_each_choice() -> None:
    told = [line.split("|") for line in lines(Settings(look="slow"), 2).splitlines()]
    assert {name: now for name, _, now, _ in told} == {"players": "2", "ghosts": "on", "look": "slow", "camera": "on"}
    assert [tuple(choices.split(",")) for *_, choices in told] == list(CHOICES.values())

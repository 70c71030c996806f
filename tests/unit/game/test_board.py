"""The best times: in order, few enough, and what is damaged is said."""

from __future__ import annotations

import pytest

from elys.common.errors import ElysError
from elys.game.board import KEPT, Board, Entry


def entry(time: float, *, player: str = "ann", file: str = "") -> Entry:
    return Entry(
        file=file or f"{time:.3f}.mcap",
        player=player,
        time=time,
        medal="",
        date="2026-01-01",
        began=1.5,
        splits=(time,),
    )


def test_times_are_kept_fastest_first_and_recordings_of_the_slowest_go(tmp_path):
    board = Board("meadow", tmp_path)
    for number in range(KEPT + 2):
        board.folder.mkdir(exist_ok=True)
        (board.folder / f"{30 - number:.3f}.mcap").write_bytes(b"run")
        assert board.add(entry(30.0 - number)) == 1
    assert board.add(entry(99.0)) == 0
    again = Board("meadow", tmp_path)
    assert [one.time for one in again.entries] == [30.0 - number for number in range(KEPT + 1, 1, -1)]
    assert len(list(board.folder.glob("*.mcap"))) == KEPT
    assert again.best() == again.entries[0]


def test_ghosts_are_ones_own_best_and_the_fastest_of_others(tmp_path):
    board = Board("meadow", tmp_path)
    for time, player in ((20.0, "bob"), (21.0, "ann"), (22.0, "bob"), (23.0, "cid"), (24.0, "ann"), (25.0, "dan")):
        board.add(entry(time, player=player))
    for one in board.entries:
        if one.player != "cid":  # whose recording somebody took away
            board.path_of(one).write_bytes(b"run")
    assert [(one.player, one.time) for one in board.ghosts("ann")] == [("ann", 21.0), ("bob", 20.0), ("dan", 25.0)]
    assert [one.player for one in board.ghosts("eve", count=2)] == ["bob", "ann"]


def test_what_is_not_proven_is_no_entry(tmp_path):
    board = Board("meadow", tmp_path)
    board.add(entry(20.0))
    board.add(entry(21.0))
    board.prove("20.000.mcap", "different: tick 3")
    board.prove("21.000.mcap", "equal")
    assert [(one.time, one.proof) for one in Board("meadow", tmp_path).entries] == [(21.0, "equal")]


def test_what_another_wrote_meanwhile_stays(tmp_path):
    before, after = Board("meadow", tmp_path), Board("meadow", tmp_path)  # the next race has one of its own
    before.add(entry(20.0))
    after.add(entry(21.0))
    before.prove("20.000.mcap", "equal")
    after.add(entry(22.0))
    listed = [(one.time, one.proof) for one in Board("meadow", tmp_path).entries]
    assert listed == [(20.0, "equal"), (21.0, ""), (22.0, "")]


@pytest.mark.parametrize("content", [b"", b"{}", b"[1]", b'[{"file": 3}]', b"\xff"])
def test_a_damaged_list_is_said_and_left(tmp_path, content):
    (tmp_path / "meadow").mkdir()
    path = tmp_path / "meadow" / "times.json"
    path.write_bytes(content)
    with pytest.raises(ElysError, match=r"times\.json cannot be read .*mend the file or take it away"):
        Board("meadow", tmp_path)
    assert path.read_bytes() == content


def test_a_list_names_nothing_outside_its_folder(tmp_path):
    board = Board("meadow", tmp_path)
    board.add(entry(20.0))
    path = board.folder / "times.json"
    path.write_text(path.read_text().replace("20.000.mcap", "../../secret.mcap"))
    assert Board("meadow", tmp_path).entries == []


def test_races_of_several_have_a_board_of_their_own(tmp_path):
    Board("meadow", tmp_path).add(entry(20.0))
    Board("meadow", tmp_path, players=2).add(entry(19.0, player="ann 2"))
    assert [one.time for one in Board("meadow", tmp_path).entries] == [20.0]
    assert [one.time for one in Board("meadow", tmp_path, players=2).entries] == [19.0]

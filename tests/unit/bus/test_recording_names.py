"""Names of recordings: what is there stays, whoever records under its name."""

from __future__ import annotations

from pathlib import Path

import pytest

from elys.bus.recorder import Recorder
from elys.bus.recording_names import claimed, free_name, is_recording
from elys.bus.recording_plan import RecordingPlan
from elys.common.errors import RecordingError
from tests.unit.bus.told_recordings import write_told


def test_a_name_that_is_taken_gets_the_first_number_that_is_free(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    assert free_name(path) == path
    for name in ("run.mcap", "run-2.mcap", "run-4.mcap"):
        (tmp_path / name).touch()
    assert free_name(path) == tmp_path / "run-3.mcap"
    assert free_name(path, taken=[tmp_path / "run-3.mcap"]) == tmp_path / "run-5.mcap"
    (tmp_path / "run-3.mcap").symlink_to("nowhere")  # opening it would make what it points to
    assert free_name(path) == tmp_path / "run-5.mcap"


def test_two_that_claim_a_name_at_once_get_two_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.mcap"
    assert claimed(path, overwrites=False) == path
    # The other looked before this one had made its file.
    answers = iter([path, tmp_path / "run-2.mcap"])
    monkeypatch.setattr("elys.bus.recording_names.free_name", lambda _: next(answers))
    assert claimed(path, overwrites=False) == tmp_path / "run-2.mcap"
    assert claimed(path, overwrites=True) == path
    with pytest.raises(RecordingError, match="cannot be written"):
        monkeypatch.undo()
        claimed(tmp_path / "gone" / "run.mcap", overwrites=False)


def test_a_device_is_no_recording_that_could_be_lost(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").symlink_to("/dev/null")
    assert claimed(tmp_path / "run.mcap", overwrites=False) == tmp_path / "run.mcap"


def test_no_recorder_writes_over_what_holds_something(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_text("precious")
    with pytest.raises(RecordingError, match="is there already"):
        Recorder(path, session="s", scene="")
    assert path.read_text() == "precious"
    Recorder(path, session="s", scene="", plan=RecordingPlan(overwrites=True)).close()
    assert is_recording(path)


def test_a_recording_is_told_from_what_else_has_its_suffix(tmp_path: Path) -> None:
    path = write_told(tmp_path / "told.mcap")
    assert is_recording(path)
    other = bytearray(path.read_bytes())
    other[21:25] = b"ros2"
    (tmp_path / "other.mcap").write_bytes(other)
    (tmp_path / "short.mcap").write_bytes(other[:5])
    for name in ("other.mcap", "short.mcap", "none.mcap", "."):
        assert not is_recording(tmp_path / name)

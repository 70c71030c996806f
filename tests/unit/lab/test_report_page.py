"""The page of a study: whole, without network, and its curves drawn by an independent reader of their specifications."""

from __future__ import annotations

import base64
import json
import re

import numpy as np
import pytest

from elys.common.errors import ElysError
from elys.lab.report_page import Picture, energy_spec, front_spec, parts_spec, require_page, write_page
from elys.lab.setting import Setting
from tests.unit.lab.test_observables import motion_of, standing
from tests.unit.lab.test_pareto import made_study

vl_convert = pytest.importorskip("vl_convert")

PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYPhfDwAChwGA60e6kgAAAABJRU5ErkJggg=="
)


@pytest.fixture
def motions():
    return [motion_of(standing(), setting=setting) for setting in (Setting(480, 8, 5), Setting(60, 8, 5))]


def test_curves_draw_what_the_study_says(motions):
    study = made_study()
    for spec in (front_spec(study), parts_spec(study), energy_spec(study, motions)):
        svg = vl_convert.vegalite_to_svg(spec)
        assert svg.startswith("<svg") and spec["title"] in svg
    points = front_spec(study)["data"]["values"]
    assert [point["setting"] for point in points] == ["30 Hz x 8", "60 Hz x 8", "120 Hz x 8"]
    assert [point["cost"] for point in points] == [1.0, 4.0, 8.0]
    assert [point["chosen"] for point in points] == [True, False, False]
    energies = energy_spec(study, motions)["data"]["values"]
    assert len(energies) == 2 * len(motions[0].time)
    assert energies[0]["energy"] == pytest.approx(float(motions[0].energy[0]))


def test_a_page_holds_everything_and_asks_no_network(tmp_path, motions):
    path = tmp_path / "page.html"
    write_page(path, [made_study(scene="A & <b>")], motions=[motions], pictures=[[Picture("A moment <i>", PNG)]])
    text = path.read_text()
    assert "A &amp; &lt;b&gt;" in text and "A moment &lt;i&gt;" in text
    assert not re.findall(r"""(?:src|href)\s*=\s*["']https?:""", text)
    assert base64.b64encode(PNG).decode() in text
    begin = text.index("const specs = ") + len("const specs = ")
    specs, _ = json.JSONDecoder().raw_decode(text[begin:])
    assert set(specs) == {"front0", "parts0", "energy0"}
    assert all(f"id='{place}'" in text for place in specs)
    assert text.count("</script>") == 1
    table = text[text.index("<table>") : text.index("</table>")]
    assert table.count("<tr") == 1 + len(made_study().outcomes)


def test_a_name_that_ends_a_script_ends_none(tmp_path, motions):
    named = [motion._replace(names=("</script>", "B")) for motion in motions]
    path = tmp_path / "page.html"
    study = made_study(scene="</script><script>alert(1)</script>")
    write_page(path, [study], motions=[named], pictures=[[]])
    assert "<script>alert" not in path.read_text()
    assert path.read_text().count("</script>") == 1


def test_a_page_that_cannot_be_written_is_told(tmp_path, motions):
    with pytest.raises(ElysError, match="cannot be written"):
        write_page(tmp_path / "nowhere" / "page.html", [made_study()], motions=[motions], pictures=[[]])


def test_a_page_that_nothing_can_be_written_to_is_refused_before_anything_runs(tmp_path, monkeypatch):
    require_page(tmp_path / "page.html")
    with pytest.raises(ElysError, match="no folder"):
        require_page(tmp_path / "nowhere" / "page.html")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ElysError, match=r"elys\[lab\]"):
        require_page(tmp_path / "page.html")


def test_a_motion_that_left_the_numbers_has_no_curve(motions):
    lost = motions[1]._replace(kinetic=np.full(len(motions[1].time), np.nan))
    values = energy_spec(made_study(), [motions[0], lost])["data"]["values"]
    assert {value["setting"] for value in values} == {"480 Hz x 8"}

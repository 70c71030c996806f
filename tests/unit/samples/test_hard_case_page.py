"""docs/hard-cases.md, which `make gallery` makes: it shows every case of the registry, as it is."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from elys.samples.hard_cases import HARD_CASES

DOCS = Path(__file__).parents[3] / "docs"
PAGE = (DOCS / "hard-cases.md").read_text()


@pytest.mark.parametrize("name", HARD_CASES)
def test_a_case_stands_on_the_page_with_its_picture(name):
    case = HARD_CASES[name]
    section = PAGE.split(f"### {name}\n", 1)[1].split("\n### ", 1)[0]
    assert case.difficulty in section and case.answer in section
    for measure in case.measures:
        assert f"| [{name}](#{name}) | {measure.name} | " in PAGE
        assert measure.known_miss in PAGE
    with Image.open(DOCS / "pictures" / "hard-cases" / f"{name}.png") as picture:
        assert picture.size == (480, 270)


def test_the_gallery_is_small_and_shows_no_case_that_is_none():
    pictures = list((DOCS / "pictures" / "hard-cases").glob("*.png"))
    assert {picture.stem for picture in pictures} == set(HARD_CASES)
    assert sum(picture.stat().st_size for picture in pictures) < 1_500_000

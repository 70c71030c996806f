"""Textures as texts: what a scene file says of how an image is laid over a mesh."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.common.assets.texture import (
    MAGNIFIERS,
    MINIFIERS,
    WRAPS,
    Sampling,
    Texture,
    parse_texture,
    split_texture,
    texture_text,
)
from elys.common.errors import AssetError

NUMBERS = st.floats(-1e6, 1e6)
PAIRS = st.tuples(NUMBERS, NUMBERS)
WRAP = st.sampled_from(WRAPS)
SAMPLINGS = st.builds(Sampling, st.tuples(WRAP, WRAP), st.sampled_from(MAGNIFIERS), st.sampled_from(MINIFIERS))
TEXTURES = st.builds(Texture, st.just("a b.png"), st.integers(0, 1), PAIRS, NUMBERS, PAIRS, SAMPLINGS)


@given(TEXTURES)
def test_a_text_is_read_as_it_was_written(texture: Texture) -> None:
    assert parse_texture(texture_text(texture)) == texture


def test_only_what_differs_is_written() -> None:
    assert texture_text(Texture("a.png")) == "a.png"
    assert texture_text(Texture("a.png", scale=(4.0, 0.5))) == "a.png?scale=4,0.5"
    assert parse_texture("a.png?wrap=clamp").sampling.wrap == ("clamp", "clamp")
    assert split_texture("what?.png") == ("what?.png", "")


@pytest.mark.parametrize(
    "text, expected",
    [
        ("a.png?scale=4", "scale=4: expected 2 numbers"),
        ("a.png?scale=nan,1", "expected 2 numbers"),
        ("a.png?rotation=1e9", "expected 1 number"),
        ("a.png?uv=2", "uv sets, 0 and 1"),
        ("a.png?wrap=clip", "one of repeat, mirror, clamp"),
        ("a.png?minify=best", "nearest-mipmap-nearest"),
        ("a.png?colour=red", "has no option 'colour'; options are uv, offset"),
    ],
)
def test_what_is_wrong_is_one_sentence(text: str, expected: str) -> None:
    with pytest.raises(AssetError) as caught:
        parse_texture(text)
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_coordinates_are_scaled_then_turned_then_moved() -> None:
    texture = Texture("", offset=(10.0, 20.0), rotation=math.pi / 2, scale=(2.0, 3.0))
    # v grows downwards: a quarter counter-clockwise takes +u to -v and +v to +u.
    assert np.allclose(texture.image_from_mesh @ (1.0, 0.0, 1.0), (10.0, 18.0))
    assert np.allclose(texture.image_from_mesh @ (0.0, 1.0, 1.0), (13.0, 20.0))

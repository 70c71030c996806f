"""What the tests of golden pictures share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from elys.common.errors import DisplayError
from elys.render_node.gpu import Context, offscreen_context


@pytest.fixture(scope="module")
def context() -> Iterator[Context]:
    """OpenGL; golden pictures are for software renderers, whose pixels are the same on every machine."""
    try:
        made = offscreen_context()
    except DisplayError as error:
        pytest.skip(str(error))
    if not made.is_software:
        pytest.skip("golden pictures are compared on software OpenGL only")
    yield made
    made.release()

"""The same bits on processors that this machine is not, as qemu emulates them (`make soak`)."""

from __future__ import annotations

import shutil

import pytest

from tests import pinned_hashes

pytestmark = [pytest.mark.process, pytest.mark.timeout(900)]

# qemu's name of a processor, and the level it has. None is told its level: it has to find that itself.
PROCESSORS = {"Haswell": "v3", "EPYC": "v3", "Nehalem": "v2"}


@pytest.mark.parametrize("processor", PROCESSORS)
def test_another_processor_reaches_the_pinned_states(processor, soak):
    if not soak:
        pytest.skip("emulation takes its time: run with --soak (make soak)")
    emulator = shutil.which("qemu-x86_64")
    if emulator is None:
        pytest.skip("qemu is missing, so no other processor can be tried. Install it:  sudo apt install qemu-user")
    level = PROCESSORS[processor]
    # First without the emulator, which would take minutes to compile.
    assert pinned_hashes.hashes_in_another_process(level) == pinned_hashes.pinned(level)
    assert pinned_hashes.hashes_in_another_process("", emulator, "-cpu", processor) == pinned_hashes.pinned(level)

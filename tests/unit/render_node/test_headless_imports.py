"""The simulation and the bus run where nothing can be drawn: proved in a process that refuses the drawing libraries."""

from __future__ import annotations

import subprocess
import sys

SCRIPT = """
import sys
FORBIDDEN = ("moderngl", "glcontext", "glfw", "imgui_bundle", "PIL", "simplejpeg", "av", "OpenEXR")

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in FORBIDDEN:
            raise ImportError(f"{name} must not be needed here")

sys.meta_path.insert(0, Refuse())
import elys.bus.mirror, elys.bus.session, elys.bus.asset_service, elys.bus.transports.loopback
import elys.common.scene, elys.common.assets
import elys.sim_node
print("fine", [name for name in FORBIDDEN if name in sys.modules])
"""


def test_the_simulation_needs_nothing_that_draws() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "fine []"

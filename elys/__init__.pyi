from elys import samples as samples
from elys.bus.discovery import join_session as join_session
from elys.bus.mirror import SceneMirror as SceneMirror
from elys.bus.recording import Recording as Recording
from elys.common import components as components
from elys.common.assets.store import AssetStore as AssetStore
from elys.common.errors import ElysError as ElysError
from elys.common.math.aabb import Aabb as Aabb
from elys.common.math.obb import Obb as Obb
from elys.common.scene import open_scene as open_scene
from elys.render_node.offline import OfflineRenderer as OfflineRenderer
from elys.sim_node.ecs.world import World as World
from elys.sim_node.physics.world import PhysicsWorld as PhysicsWorld
from elys.sim_node.simulation import Simulation as Simulation

__version__: str

"""The exceptions a user or another module may meet.

    ElysError                 one clear sentence; the command line prints it and exits 1
    ├── SceneError            a scene, prefab or model file is missing or wrong: file, place, field, what was expected
    ├── AssetError            an asset cannot be read or is not known
    ├── ComponentError        a component or one of its fields does not exist or has a value of the wrong kind
    ├── EntityError           an entity does not exist (any more), or a structural change is impossible
    │   └── HierarchyError    a parent would become its own descendant
    ├── StateError            the state of a simulation is not one, or not one that it can go back to
    ├── PhysicsError          a body, collider or setting that physics cannot work with: the entity, what, what to do
    ├── InputError            a control is none, or a file of bindings cannot be read: which word or line, what may stand there
    ├── ScriptError           a script cannot be read, or says what cannot be run: file, line, what to write instead
    ├── BusError
    │   ├── MessageError      a payload that is not what its topic promises
    │   ├── ProtocolError     the other side speaks another version of the protocol
    │   ├── ConnectionLost    nobody answers at the endpoint
    │   ├── AccessError       the host lets nobody in as who this is, or a key is none
    │   └── RequestError      the other side answered, and refused
    │       └── EditConflict  because somebody else has changed the same meanwhile
    ├── RecordingError        a recording is not one, or is damaged beyond repair
    ├── DisplayError          no display, no EGL, no OpenGL driver
    │   └── ShaderError       the driver does not take a shader: file, line, source line
    ├── ContextLost           the driver has lost all that was being drawn with: this process cannot draw any more
    └── LaunchError           a launch file is wrong or a process could not be started

Every message is written for the person who reads it: what was wrong, where, and what to do.
"""

from __future__ import annotations


class ElysError(Exception):
    """Root of everything ELYS raises on purpose."""


class SceneError(ElysError):
    """A scene file cannot be understood."""


class AssetError(ElysError):
    """An asset cannot be read."""


class ComponentError(ElysError):
    """A component value is not what its declaration says."""


class EntityError(ElysError):
    """An entity does not exist, or not any more."""


class HierarchyError(EntityError):
    """A change of parent would make a cycle."""


class StateError(ElysError):
    """The state of a simulation cannot be read, or not be gone back to."""


class PhysicsError(ElysError):
    """Physics cannot work with a value."""


class InputError(ElysError):
    """What is written of keys, sticks and motions means nothing."""


class ScriptError(ElysError):
    """A script cannot be read or run."""


class BusError(ElysError):
    """Something between processes went wrong."""


class MessageError(BusError):
    """A payload is not what its topic promises."""


class ProtocolError(BusError):
    """The two sides speak different versions of the protocol."""


class ConnectionLost(BusError):
    """Nobody answers."""


class AccessError(BusError):
    """Who this is is not let in."""


class RequestError(BusError):
    """The other side refused a request."""


class EditConflict(RequestError):
    """Somebody else has changed meanwhile what an edit would change."""


class RecordingError(ElysError):
    """A recording cannot be read."""


class DisplayError(ElysError):
    """Nothing can be drawn on this machine."""


class ShaderError(DisplayError):
    """A shader is missing, or the driver does not take it."""


class ContextLost(ElysError):
    """The driver has lost the context. No DisplayError: those are over with the picture that they hit."""


class LaunchError(ElysError):
    """Processes could not be started as described."""

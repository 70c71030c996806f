"""What the lower panels read of a session: profiles, plots, topics and the plan. Listened to only while it is looked at."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable
from typing import Final, TypeVar

from elys.bus import codec, topics
from elys.bus.messages.physics import Diagnostics
from elys.bus.messages.plan import PhysicsPlan, PlanRequest, RenderProfile
from elys.bus.messages.session import TickProfile
from elys.bus.session import Session
from elys.bus.topics import Topic
from elys.bus.transports.transport import Closer
from elys.common.errors import BusError, MessageError, ProtocolError
from elys.editor_node.contact_counts import ContactCounts
from elys.editor_node.entity_mentions import EntityMentions
from elys.editor_node.frame_profiles import ProfileTrack, Sample
from elys.editor_node.language import tr
from elys.editor_node.model import EditorModel
from elys.editor_node.plots import Plots
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.topic_watch import TopicWatch

PLAN_INTERVAL: Final = 0.5  # [s] between two questions for the plan
SIMULATION: Final = "simulation"
EDITOR: Final = "editor"
REDRAW: Final = 0.25  # [s] within which a number that changed is drawn
FRAME_BUDGET: Final = 1000.0 / 60.0  # [ms] of a picture and of the editor's own frame
M = TypeVar("M")
_log = logging.getLogger(__name__)


class Instruments:
    """One for an editor; it stays when the session changes."""

    def __init__(self, model: EditorModel) -> None:
        self._model = model
        self._session = model.session
        self._redraw = model.request_redraw
        self.mentions = EntityMentions(model.scene)
        self.tracks: dict[str, ProfileTrack] = {}  # of the simulation, of each view, of the editor
        self.views: dict[str, RenderProfile] = {}  # the newest of each view
        self.measured: deque[Diagnostics] = deque(maxlen=240)  # the newest last
        contacts = ContactCounts(model.session, on_refusal=self._contacts_refused)
        self.plots = Plots(model.scene, watch=self._watch_every, contacts=contacts)
        self.topics = TopicWatch(model.session, on_message=lambda: self._redraw(REDRAW))
        self.plan = PlanWatch(model.session, on_change=lambda: self._redraw(0.0))
        model.session.on_link(self._link_changed)

    def watch_ticks(self) -> Closer:
        """Listens to what ticks cost."""
        return self._session.subscribe(topics.PROFILE, self._tick_arrived)

    def watch_views(self) -> Closer:
        """Listens to what pictures cost, and what they consist of."""
        return self._session.subscribe(topics.RENDER_PROFILE, self._view_arrived)

    def watch_measured(self) -> Closer:
        """Listens to what the host measures."""
        return self._session.subscribe(topics.DIAGNOSTICS, self._measured_arrived)

    def add_editor_frame(self, number: int, total: float, stages: dict[str, float]) -> None:
        """Takes note of a frame of the editor's own [ms]."""
        self._track(EDITOR, FRAME_BUDGET).add(Sample(number=number, at=time.monotonic(), total=total, stages=stages))

    # --- inside ----------------------------------------------------------------------------------------------------

    def _track(self, name: str, budget: float) -> ProfileTrack:
        track = self.tracks.setdefault(name, ProfileTrack())
        track.budget = budget
        return track

    def _tick_arrived(self, profile: TickProfile, _: str) -> None:
        self._track(SIMULATION, self._tick_budget()).add(
            Sample(
                number=profile.tick,
                at=time.monotonic(),
                total=profile.total,
                stages=profile.stages,
                late=profile.late,
                counts=profile.counts,
            )
        )
        self._redraw(REDRAW)

    def _tick_budget(self) -> float:
        """[ms] in which a tick has to be done for time to go on as it shall."""
        status = self._model.status
        if status is None or status.tick_rate <= 0.0 or status.rate <= 0.0:
            return 0.0  # as fast as it can
        return 1000.0 / (status.tick_rate * status.rate)

    def _view_arrived(self, profile: RenderProfile, key: str) -> None:
        self.views[key] = profile
        counts = {"pixels": profile.width * profile.height}
        self._track(f"view {key}", FRAME_BUDGET).add(
            Sample(
                number=profile.sequence,
                at=time.monotonic(),
                total=profile.total,
                stages=profile.stages,
                counts=counts,
            )
        )
        self._redraw(REDRAW)

    def _measured_arrived(self, found: Diagnostics, _: str) -> None:
        self.measured.append(found)
        self._redraw(REDRAW)

    def _watch_every(self, topic: Topic[M], heard: Callable[[M], None], /) -> Closer:
        def arrived(_: str, payload: bytes) -> None:
            try:
                message: M = codec.decode(payload, topic.message, topic.encoding)
            except (MessageError, ProtocolError) as error:
                _log.debug("a message on %s is left out of the plots: %s", topic.name, error)
                return
            heard(message)
            self._redraw(REDRAW)

        return self._session.subscribe_payloads(topic, arrived, every=True)

    def _contacts_refused(self, reason: str) -> None:
        self._model.say("warning", tr("contacts cannot be counted: {reason}", reason=tr_sentence(reason)))

    def _link_changed(self, connected: bool) -> None:
        """What another run measured is no part of this one's curves."""
        if connected:
            self.tracks = {name: track for name, track in self.tracks.items() if name == EDITOR}
            self.views.clear()
            self.measured.clear()
            self.plan.forget()
            self.plots.another_run()


class PlanWatch:
    """The host's plan of a step, asked for again and again while somebody looks."""

    def __init__(self, session: Session, *, on_change: Callable[[], None] = lambda: None) -> None:
        self.newest: PhysicsPlan | None = None
        self.refusal = ""  # why there is none
        self._session = session
        self._on_change = on_change
        self._is_asking = False
        self._asked_at = -PLAN_INTERVAL

    def refresh(self, now: float) -> None:
        """Asks anew if the last question was long enough ago. Call it in each frame that shows the plan; `now` [s]."""
        if not self._is_asking and now >= self._asked_at + PLAN_INTERVAL:
            self._is_asking, self._asked_at = True, now
            self._session.start(self._ask())

    def forget(self) -> None:
        """Of a host that is gone."""
        self.newest, self.refusal = None, ""

    async def _ask(self) -> None:
        before = (self.newest, self.refusal)
        try:
            self.newest, self.refusal = await self._session.request(topics.PLAN, PlanRequest(), timeout=2.0), ""
        except BusError as error:
            self.newest, self.refusal = None, str(error)
        finally:
            self._is_asking = False
        if (self.newest, self.refusal) != before:
            self._on_change()

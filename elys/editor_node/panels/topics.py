"""Topics: what is said on the bus, how often, how much and how late, and the last message of the one that is chosen."""

from __future__ import annotations

from typing import Any, Final

from imgui_bundle import imgui

from elys.bus import topics
from elys.bus.topics import Topic
from elys.editor_node.instruments import Instruments
from elys.editor_node.language import tr, tr_title
from elys.editor_node.theme import ERROR, TEXT_DIM, icons
from elys.editor_node.topic_watch import TopicFlow, TopicKey
from elys.editor_node.ui import Ui, centered_text, color_code, colored_text, dim_text
from elys.editor_node.value_tree import TreeRow, tree_rows

TITLE: Final = f"{icons.ICON_FA_TOWER_BROADCAST}  Topics###Topics"
_LIST_SHARE: Final = 0.62
_COLUMNS: Final = ("topic", "messages", "rate", "size", "throughput", "latency")
_WEIGHTS: Final = {"topic": 2.0, "messages": 1.3, "throughput": 1.35}


class TopicsPanel:
    """Listens while it is drawn."""

    def __init__(self, instruments: Instruments) -> None:
        self._topics = instruments.topics
        self._chosen = TopicKey("state", "")
        self._opened: set[str] = set()

    @property
    def chosen(self) -> TopicKey:
        """Of which the last message is shown."""
        return self._chosen

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(tr_title(TITLE))[0]:
            ui.watches.keep("topics", self._topics.start)
            width = imgui.get_content_region_avail().x * _LIST_SHARE
            if imgui.begin_child("###flows", (width, 0.0)):
                self._draw_flows(ui)
            imgui.end_child()
            imgui.same_line()
            if imgui.begin_child("###message"):
                self._draw_message(ui)
            imgui.end_child()
        imgui.end()

    def _draw_flows(self, ui: Ui) -> None:
        flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.scroll_y | imgui.TableFlags_.resizable
        if not imgui.begin_table("###topics", len(_COLUMNS), int(flags)):
            return
        imgui.table_setup_scroll_freeze(0, 1)
        for column in _COLUMNS:
            stretch = imgui.TableColumnFlags_.width_stretch.value
            imgui.table_setup_column(f"{tr(column)}###{column}", stretch, _WEIGHTS.get(column, 1.0))
        imgui.table_headers_row()
        for flow in self._topics.flows():
            imgui.table_next_row()
            imgui.table_next_column()
            self._draw_name(ui, flow)
            for text in self._figures(flow):
                imgui.table_next_column()
                dim_text(text)
        imgui.end_table()

    def _draw_name(self, ui: Ui, flow: TopicFlow) -> None:
        label = f"{flow.topic.name}/{flow.key}" if flow.key else flow.topic.name
        is_chosen = flow.name == self._chosen
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*TEXT_DIM) if not flow.total else imgui.get_style().color_(
            imgui.Col_.text))  # fmt: skip
        pressed = imgui.selectable(f"{label}###{label}", is_chosen, imgui.SelectableFlags_.span_all_columns.value)[0]
        imgui.pop_style_color()
        ui.landmarks.note(f"topics/{label}")
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            imgui.set_tooltip(_explanation(flow.topic))
        if pressed:
            self._chosen = flow.name
            self._topics.choose(flow.topic.name)

    def _figures(self, flow: TopicFlow) -> tuple[str, ...]:
        if not self._topics.is_heard(flow.topic.name):
            return (tr("on demand"), "", "", "", "")
        if not flow.total:
            return ("0", "", "", "", "")
        rate = flow.rate()
        latency = flow.latency
        return (
            str(flow.total),
            f"{rate.rate:.1f} Hz" if rate.rate else "—",
            size_text(flow.bytes_total / flow.total),
            f"{size_text(rate.bandwidth)}/s" if rate.bandwidth else "—",
            f"{latency * 1e3:.1f} ms" if latency is not None else "",
        )

    # --- the message -----------------------------------------------------------------------------------------------

    def _draw_message(self, ui: Ui) -> None:
        flow = self._topics.flow(self._chosen)
        if flow is None or not flow.total:
            imgui.dummy((0.0, imgui.get_frame_height() * 0.5))
            centered_text(tr("Nothing was said here yet"), imgui.get_content_region_avail().x)
            return
        message = flow.message()
        if flow.error:
            colored_text(ERROR, flow.error)
            return
        rows = self._rows(message)
        imgui.push_font(ui.fonts.mono, 0.0)
        clipper = imgui.ListClipper()
        clipper.begin(len(rows), imgui.get_text_line_height_with_spacing())
        while clipper.step():
            for place in range(clipper.display_start, clipper.display_end):
                self._draw_row(ui, rows[place])
        clipper.end()
        imgui.pop_font()

    def _rows(self, message: Any) -> list[TreeRow]:
        """A message that is a value alone has a line all the same."""
        return tree_rows(message, self._opened, label="" if isinstance(message, (dict, list, tuple)) else "=")

    def _draw_row(self, ui: Ui, row: TreeRow) -> None:
        indent = row.depth * imgui.get_font_size()
        at, letter = imgui.get_cursor_screen_pos(), imgui.calc_text_size("0").x
        if imgui.selectable(f"###{row.path}", False)[0] and row.is_open is not None:
            self._opened ^= {row.path}
        ui.landmarks.note(f"topics/message{row.path}")
        draw_list = imgui.get_window_draw_list()
        mark = {None: " ", True: "-", False: "+"}[row.is_open]
        draw_list.add_text((at.x + indent, at.y), color_code(TEXT_DIM), f"{mark} {row.label}")
        x = at.x + indent + (max(len(row.label) + 4, 20)) * letter
        draw_list.add_text((x, at.y), imgui.get_color_u32(imgui.Col_.text), row.text)


def size_text(count: float) -> str:
    """Bytes as people say them."""
    for unit in ("B", "kB", "MB"):
        if count < 1000.0 or unit == "MB":
            return f"{count:.0f} B" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1000.0
    raise AssertionError("unreachable")


def _explanation(topic: Topic[Any]) -> str:
    lines = [topic.text, f"{topic.message.__name__}, {topic.delivery.value}, {topic.encoding.value}"]
    if topic in topics.ON_DEMAND:
        lines.append(tr("made only while somebody listens: click to listen"))
    return "\n".join(lines)

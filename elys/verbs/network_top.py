"""top --network: how the nodes of a session do, as a table that follows them, a line a second into a pipe, or once."""

from __future__ import annotations

import asyncio
import sys
from typing import Final

from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from elys.bus.messages.vitals import HostFacts
from elys.bus.network import NetworkReport, NetworkWatch, NodeRow
from elys.verbs.nodes import joined, run_until_asked
from elys.verbs.output import facts_console, print_json, size_text

ROUND: Final = 1.0  # [s] between two rounds of questions
_COLUMNS: Final = (
    "node",
    "address",
    "round trip",
    "hears",
    "bytes/s",
    "says",
    "bytes/s",
    "states",
    "missed",
    "skipped",
    "age p50 / p99",
)
_NARROW: Final = (0, 2, 6, 8, 10)  # node, round trip, bytes said, states missed, age
_WIDE: Final = 140  # columns of a terminal in which all have room
SHOWN: Final = 40  # nodes that the table holds; of hundreds those that do worst
_ROUNDS_ONCE: Final = 2  # rates are known after the second


def top(connect: str | None, *, once: bool, json: bool) -> None:
    """Shows the network of a session until Ctrl-C; with `once` or `json` as it is now."""

    async def work() -> None:
        async with joined(connect, kind="tool") as session:
            watch = NetworkWatch(session)
            if once or json:
                for number in range(_ROUNDS_ONCE):
                    await asyncio.sleep(ROUND if number else 0.1)  # the first: until all there are were heard of
                    await watch.ask()
                report = watch.report()
                if json:
                    print_json(report)
                else:
                    console = facts_console()
                    console.print(picture(report, console.width))
            elif sys.stdout.isatty():
                await _show_live(watch)
            else:
                await _print_lines(watch)

    run_until_asked(work())


async def _show_live(watch: NetworkWatch) -> None:
    await watch.ask()
    with Live(auto_refresh=False) as live:
        live.update(picture(watch.report(), live.console.width), refresh=True)
        while True:
            await asyncio.sleep(ROUND)
            await watch.ask()
            live.update(picture(watch.report(), live.console.width), refresh=True)


async def _print_lines(watch: NetworkWatch) -> None:
    await watch.ask()
    while True:
        await asyncio.sleep(ROUND)
        await watch.ask()
        print(line(watch.report()), flush=True)


def line(report: NetworkReport) -> str:
    """The most important figures in one line."""
    clients = [row for row in report.nodes if row.state_rate >= 0.0]
    silent = sum(not row.answers for row in report.nodes)
    parts = [f"{report.session}: {len(report.nodes)} nodes" + (f", {silent} of them silent" if silent else "")]
    if report.host is not None:
        parts.append(host_text(report.host))
    parts.append(f"sent {size_text(sum(row.sent_size for row in report.nodes))}/s")
    parts.append(f"heard {size_text(sum(row.heard_size for row in report.nodes))}/s")
    if clients:
        slowest = max(clients, key=lambda row: row.age_p99)
        parts.append(f"states missed {sum(row.missed for row in clients)}")
        parts.append(f"oldest {slowest.age_p99:.1f} ms at {slowest.node}")
    return "; ".join(parts)


def host_text(host: HostFacts) -> str:
    """What a host carries, in a few words."""
    load = f", load {100 * host.load:.0f} %" if host.load >= 0.0 else ""
    rate = f", {host.tick_rate:g} Hz" if host.tick_rate else ""
    return f"{host.scene}{rate}, {host.realtime_factor:.2f} times real time{load}"


def picture(report: NetworkReport, width: int) -> Group:
    """The figures, as a terminal of that many columns shows them: on a narrow one only those that tell how somebody does."""
    title = report.session + (f": {host_text(report.host)}" if report.host is not None else "")
    table = Table(box=None, pad_edge=False, header_style="dim")
    columns = range(len(_COLUMNS)) if width >= _WIDE else _NARROW
    for name in (_COLUMNS[column] for column in columns):
        table.add_column(name, justify="left" if name in ("node", "address") else "right", no_wrap=True)
    shown = report.nodes if len(report.nodes) <= SHOWN else _worst(report.nodes)
    for row in shown:
        cells = _cells(row)
        table.add_row(*(cells[column] for column in columns), style="" if row.answers else "red")
    rest = len(report.nodes) - len(shown)
    more = [Text(f"and {rest} more, which do better", style="dim")] if rest else []
    return Group(Text(title, style="bold"), table, *more)


def _worst(rows: tuple[NodeRow, ...]) -> list[NodeRow]:
    """Hosts and routers, and of the others the silent, then those that miss and wait most."""
    order = sorted(
        rows,
        key=lambda row: (row.kind not in ("simulation", "replay", "router"), row.answers, -row.missed, -row.age_p99),
    )
    chosen = {row.node for row in order[:SHOWN]}
    return [row for row in rows if row.node in chosen]


def _cells(row: NodeRow) -> tuple[str, ...]:
    address = row.address.partition("/")[2] or row.machine
    if not row.answers:
        return (row.node, address, "silent", *[""] * 8)
    has_state = row.state_rate >= 0.0
    return (
        row.node,
        address + (f", {row.links} links" if row.kind == "router" else ""),
        f"{row.round_trip:.1f} ms",
        f"{row.heard_rate:.0f}/s",
        size_text(row.heard_size),
        f"{row.sent_rate:.0f}/s",
        size_text(row.sent_size),
        f"{row.state_rate:.1f} Hz" if has_state else "",
        str(row.missed) if has_state else "",
        str(row.skipped),
        f"{row.age_p50:.1f} / {row.age_p99:.1f} ms" if has_state and row.age_p99 >= 0.0 else "",
    )

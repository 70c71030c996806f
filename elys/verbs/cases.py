"""cases: lists the hard cases, runs them and judges them, several at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape

from elys.common.errors import SceneError
from elys.samples.hard_cases import HARD_CASES, HardCase, hard_case
from elys.verbs.output import print_json, print_table

if TYPE_CHECKING:
    from elys.lab.cases import CaseOutcome, MeasuredError


def list_cases(*, json: bool) -> None:
    """Prints the cases with what makes them hard, and what must come out."""
    if json:
        print_json([_facts(case) for case in HARD_CASES.values()])
        return
    rows = ((case.name, case.title, case.difficulty) for case in HARD_CASES.values())
    print_table(("case", "what it is", "what makes it hard"), rows)
    print("\nTry: elys cases run NAME, or elys run NAME to look at it.")


def run_cases(names: Sequence[str], *, every: bool, quick: bool, jobs: int, json: bool) -> int:
    """Runs cases and prints their errors; returns 1 where a bound is missed, else 0.

    Raises:
        SceneError: there is no case of a name, or none was named.
    """
    chosen = _chosen(names, every=every)
    _compile_for(chosen, quick=quick)
    outcomes = {outcome.case: outcome for outcome in _outcomes(chosen, quick=quick, jobs=jobs)}
    ordered = [outcomes[case.name] for case in chosen]
    if json:
        print_json(ordered)
    else:
        _print_outcomes(ordered)
    return 0 if all(outcome.is_met for outcome in ordered) else 1


def _chosen(names: Sequence[str], *, every: bool) -> list[HardCase]:
    if every:
        return list(HARD_CASES.values())
    if not names:
        raise SceneError("name the cases to run, or say --all; elys cases list shows them")
    return [hard_case(name) for name in dict.fromkeys(names)]


def _compile_for(cases: Sequence[HardCase], *, quick: bool) -> None:
    """What all of them need, before any clock runs and before processes would compile the same kernels at once."""
    from elys.lab.cases import opened_case
    from elys.verbs.kernels import compile_with_progress

    for case in cases:
        sized = case.quick if quick else case
        compile_with_progress(opened_case(sized, sized.seeds[0]))


def _outcomes(cases: Sequence[HardCase], *, quick: bool, jobs: int) -> Iterator[CaseOutcome]:
    """The cases' outcomes as they come, with a bar that tells how far it is."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from elys.lab.jobs import completed, usable_processors

    console = Console(stderr=True)
    columns = (TextColumn("Running cases"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(
        *columns, TextColumn("{task.description}"), console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("", total=float(len(cases)))
        if min(jobs or usable_processors(), len(cases)) == 1:
            for done, case in enumerate(cases):

                def show(share: float, done: int = done, name: str = case.name) -> None:
                    bar.update(task, completed=done + share, description=name)

                yield _run_here(case, quick, show)
            return
        for _, outcome in completed(run_named, [(case.name, quick) for case in _longest_first(cases)], processes=jobs):
            bar.update(task, advance=1.0, description=outcome.case)
            yield outcome


def run_named(job: tuple[str, bool]) -> CaseOutcome:
    """A case by its name, at its small size or whole, in a process of its own."""
    name, quick = job
    return _run_here(hard_case(name), quick, lambda share: None)


def _run_here(case: HardCase, quick: bool, show: Callable[[float], None]) -> CaseOutcome:
    from elys.lab.cases import run_case

    return run_case(case.quick if quick else case, progress=show)


def _longest_first(cases: Sequence[HardCase]) -> list[HardCase]:
    """So that no processor waits for a long one that came last."""
    return sorted(cases, key=lambda case: -case.duration * len(case.seeds))


def _print_outcomes(outcomes: Sequence[CaseOutcome]) -> None:
    errors = [error for outcome in outcomes for error in outcome.errors]
    wide = max(len(error.name) for error in errors)
    figure = max(len(error_text(error)) for error in errors)
    bound = max(len(f"{error.bound:g}") for error in errors)
    console = Console(highlight=False)
    for outcome in outcomes:
        console.print(f"[bold]{outcome.case}[/bold]  {escape(outcome.title)}  [dim]({outcome.seconds:.1f} s)[/dim]")
        console.print(f"  [dim]hard: {escape(outcome.difficulty)}[/dim]")
        for error in outcome.errors:
            color = "green" if error.is_met else "red"
            text = f"  {error.name:<{wide}}  {error_text(error):>{figure}}  at most {error.bound:<{bound}g}"
            console.print(f"{escape(text)}  [{color}]{verdict(error)}[/{color}]")
    missed = [outcome.case for outcome in outcomes if not outcome.is_met]
    met = len(outcomes) - len(missed)
    print(f"\n{met} of {len(outcomes)} cases within all bounds." + (f" Missed: {', '.join(missed)}." if missed else ""))


def error_text(error: MeasuredError) -> str:
    """An error with its unit."""
    if error.value is None:
        return "not finite"
    figure = f"{error.value:.0f}" if abs(error.value) >= 100.0 else f"{error.value:.3g}"
    return figure + (f" {error.unit}" if error.unit != "1" else "")


def verdict(error: MeasuredError) -> str:
    """Whether an error is within its bound, and whether it is known that it is not."""
    if error.is_met:
        return "met"
    return "MISSED, known" if error.known_miss else "MISSED"


def _facts(case: HardCase) -> dict[str, object]:
    return {
        "name": case.name,
        "title": case.title,
        "difficulty": case.difficulty,
        "answer": case.answer,
        "duration": case.duration,
        "seeds": len(case.seeds),
        "errors": [
            {"name": m.name, "unit": m.unit, "bound": m.bound, "known_miss": m.known_miss} for m in case.measures
        ],
    }

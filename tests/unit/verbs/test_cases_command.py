"""elys cases: what it lists, how it judges, and with which status it ends."""

from __future__ import annotations

import json

import pytest

from elys.samples.hard_cases import HARD_CASES
from elys.verbs.cases import verdict


def test_all_cases_are_listed_with_what_makes_them_hard(elys):
    said = elys("cases", "list")
    assert said.status == 0
    assert all(name in said.out for name in HARD_CASES)
    facts = json.loads(elys("cases", "list", "--json").out)
    assert [fact["name"] for fact in facts] == list(HARD_CASES)
    assert all(fact["difficulty"] and fact["answer"] and fact["errors"] for fact in facts)


def test_a_case_within_its_bounds_ends_with_0(elys):
    said = elys("cases", "run", "motor-limit", "--jobs", "1")
    assert said.status == 0
    assert "1 of 1 cases within all bounds." in said.out
    assert said.out.count(" met") == len(HARD_CASES["motor-limit"].measures)


def test_a_case_above_a_bound_ends_with_1_and_says_which(elys):
    said = elys("cases", "run", "newtons-cradle", "motor-limit", "--json", "--jobs", "1")
    assert said.status == 1
    outcomes = json.loads(said.out)
    assert [outcome["case"] for outcome in outcomes] == ["newtons-cradle", "motor-limit"]
    missed = [error for error in outcomes[0]["errors"] if not error["is_met"]]
    assert [error["name"] for error in missed] == ["energy"]
    assert missed[0]["value"] > missed[0]["bound"] and missed[0]["known_miss"]


def test_cases_run_in_processes_of_their_own(elys):
    said = elys("cases", "run", "slip-to-roll", "motor-limit", "zeno", "--json", "--jobs", "2")
    assert said.status == 0
    here = elys("cases", "run", "slip-to-roll", "motor-limit", "zeno", "--json", "--jobs", "1")
    errors = [[outcome["errors"] for outcome in json.loads(run.out)] for run in (said, here)]
    assert errors[0] == errors[1]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("newton-cradle",), "there is no hard case 'newton-cradle'; did you mean 'newtons-cradle'?"),
        (("qq",), "elys cases list shows all"),
        ((), "name the cases to run, or say --all"),
        (("zeno", "--jobs", "-1"), "--jobs"),
    ],
)
def test_a_mistake_is_one_sentence(elys, words, expected):
    assert expected in elys("cases", "run", *words).sentence


def test_samples_and_cases_open_by_name(elys):
    assert "newtons-cradle" in elys("samples").out
    assert elys("samples", "zeno", "-o", "it.scene.json").status == 0
    said = elys("run", "zeno", "--headless", "--steps", "2", "--json")
    assert said.status == 0
    assert json.loads(said.out[said.out.index("{") :])["ticks"] == 2


def test_a_verdict_tells_what_is_known():
    from elys.lab.cases import MeasuredError

    values = {"name": "x", "unit": "m", "value": 2.0, "bound": 1.0}
    assert verdict(MeasuredError(**values, is_met=False)) == "MISSED"
    assert verdict(MeasuredError(**values, is_met=False, known_miss="so it is")) == "MISSED, known"
    assert verdict(MeasuredError(**values, is_met=True)) == "met"
